"""The stages that make a step: Runge-Kutta methods that are strong-stability-preserving."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Stage:
    """One stage of a Runge-Kutta method: U_new = U_n + b (U - dt D(U) - U_n); `weight`: its share in the whole step."""

    number: int
    b: float
    weight: float


SSP_RK2 = (Stage(0, 1.0, 0.5), Stage(1, 0.5, 0.5))  # Gottlieb, Shu, Tadmor, SIAM Rev. 43, 2001
SSP_RK3 = (Stage(0, 1.0, 1.0 / 6.0), Stage(1, 0.25, 1.0 / 6.0), Stage(2, 2.0 / 3.0, 2.0 / 3.0))  # paper, Eq. 16
SCHEMES = {"rk2": SSP_RK2, "rk3": SSP_RK3}
