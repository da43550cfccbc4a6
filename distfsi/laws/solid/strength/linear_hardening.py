"""A yield stress in proportion to the plastic strain."""

from dataclasses import dataclass

from distfsi.laws.law import Strength, quantity


@dataclass(frozen=True)
class LinearHardening(Strength):
    """Yield stress that grows linearly with the plastic strain."""

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    yield_stress: float = quantity("Pa", "initial yield stress", above=0.0)
    hardening_modulus: float = quantity("Pa", "its growth with plastic strain", at_least=0.0)
