"""Hooke's law up to a yield stress, then radial return (paper, A.5)."""

from dataclasses import dataclass

from distfsi.laws.law import Strength, quantity


@dataclass(frozen=True)
class PerfectlyPlastic(Strength):
    """Elastic up to a constant yield stress."""

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    yield_stress: float = quantity("Pa", "yield stress", above=0.0)
