"""The shock equation of state of metals (paper, A.1 corrected)."""

from dataclasses import dataclass

from distfsi.laws.law import SolidEos, number, quantity


@dataclass(frozen=True)
class MieGrueneisen(SolidEos):
    """Shock EOS with U = c0 + s1 u (+ s2, s3) and Grueneisen gamma0 + a mu.

    Energies are per reference volume.
    """

    c0: float = quantity("m/s", "bulk sound speed", above=0.0)
    s1: float = number("slope of the shock speed")
    s2: float = number("second coefficient", default=0.0)
    s3: float = number("third coefficient", default=0.0)
    gamma0: float = number("Grueneisen coefficient")
    a: float = number("its change with compression", default=0.0)
