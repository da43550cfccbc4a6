"""The yield stress of metals by Johnson and Cook (paper, A.6)."""

from dataclasses import dataclass

from distfsi.laws.law import Strength, number, quantity


@dataclass(frozen=True)
class JohnsonCook(Strength):
    """Yield stress (A + B eps^n)(1 + C ln(rate/reference_rate))(1 - T*^m)."""

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    A: float = quantity("Pa", "initial yield stress", above=0.0)
    B: float = quantity("Pa", "hardening modulus", at_least=0.0)
    n: float = number("hardening exponent", above=0.0)
    C: float = number("rate coefficient", at_least=0.0)
    m: float = number("exponent of thermal softening (the paper's k)", above=0.0)
    reference_rate: float = quantity("1/s", "strain rate at which the rate factor is one", above=0.0, default=1.0)
    room_temperature: float = quantity("K", "temperature at the start, without softening", at_least=0.0)
    melt_temperature: float = quantity("K", "temperature at which no strength is left", at_least=0.0)
    heat_capacity: float = quantity("J/(kg K)", "specific heat capacity", above=0.0)
    taylor_quinney: float = number("share of plastic work that becomes heat", at_least=0.0, at_most=1.0, default=0.9)

    def check(self) -> None:
        """The material is solid at the start."""
        if self.melt_temperature <= self.room_temperature:
            raise ValueError("melt_temperature must be above room_temperature")
