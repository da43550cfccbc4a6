"""Hooke's law (paper, A.3)."""

from dataclasses import dataclass

from distfsi.laws.law import Strength, quantity


@dataclass(frozen=True)
class Elastic(Strength):
    """Hooke's law for the deviatoric stress."""

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
