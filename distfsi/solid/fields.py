"""What is written of particles: position, velocity, scalars, stress."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from distfsi.laws.law import Column

ALWAYS = ("density", "energy", "id", "body")
SHEARS = ((), (), (3,), (3, 5, 4))  # where the shear stresses xy, xz, yz stand in xx, yy, zz, xy, yz, xz


def outputs(
    columns: Mapping[str, np.ndarray], remembered: Iterable[Column], others: Iterable[str]
) -> dict[str, np.ndarray]:
    """Position and velocity (n, 3), the scalars (n,), those that materials have `remembered` and those `others` among
    them that there are, and the stress (n, 6) with the components xx, yy, zz, xy, yz, xz, of particles with these
    columns."""
    D = columns["position"].shape[1]
    vectors = {name: np.pad(columns[name], ((0, 0), (0, 3 - D))) for name in ("position", "velocity")}
    names = [*ALWAYS, *(column.name for column in remembered if column.written)]
    names += [name for name in ("piece", *others) if name in columns]
    stress = cauchy_stress(columns["deviator"], columns["pressure"], D)
    return vectors | {name: columns[name] for name in names} | {"stress": stress}


def cauchy_stress(deviator: np.ndarray, pressure: np.ndarray, D: int) -> np.ndarray:
    """(n, 6) stress [Pa], tension positive; the normal stresses out of the plane share what makes the deviator's trace
    vanish."""
    stress = np.zeros((len(deviator), 6))
    stress[:, :D] = deviator[:, :D]
    stress[:, D:3] = -deviator[:, :D].sum(axis=1, keepdims=True) / max(3 - D, 1)
    stress[:, :3] -= pressure[:, None]
    for column, component in zip(SHEARS[D], deviator[:, D:].T, strict=True):
        stress[:, column] = component
    return stress
