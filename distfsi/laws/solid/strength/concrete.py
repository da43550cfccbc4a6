"""The strength of concrete by Holmquist, Johnson & Cook 1993 (paper, A.8-A.11 corrected)."""

from dataclasses import dataclass

from distfsi.laws.law import Strength, number, quantity


@dataclass(frozen=True)
class Concrete(Strength):
    """Concrete of Holmquist, Johnson & Cook: yield at f_c (A (1 - wear) + B p*^N)(1 + C ln(rate/reference_rate)), at
    most cap f_c. It needs the eos `compaction`; cracks in tension come from a `failure`.

    Plastic and compacted strain over max(D1 (p* + T*)^D2, least_failure_strain) sum up to the wear.
    """

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    compressive_strength: float = quantity("Pa", "uniaxial compressive strength f_c", above=0.0)
    tensile_strength: float = quantity("Pa", "largest tension T; a `failure` takes its place", above=0.0)
    A: float = number("cohesion", at_least=0.0)
    B: float = number("hardening by pressure p* = p/f_c", at_least=0.0)
    N: float = number("its exponent", above=0.0)
    C: float = number("rate coefficient", at_least=0.0)
    cap: float = number("largest strength over f_c", above=0.0, default=7.0)
    D1: float = number("wear: failure strain D1 (p* + T*)^D2", above=0.0)
    D2: float = number("its exponent", at_least=0.0, default=1.0)
    least_failure_strain: float = number("and its floor", above=0.0)
    reference_rate: float = quantity("1/s", "strain rate at which the rate factor is one", above=0.0, default=1.0)
