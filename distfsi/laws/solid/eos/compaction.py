"""The pressure of concrete, whose pores close (Holmquist, Johnson & Cook 1993)."""

from dataclasses import dataclass

from distfsi.laws.law import SolidEos, number, quantity


@dataclass(frozen=True)
class Compaction(SolidEos):
    """Concrete, with strength `concrete`: elastic to the crush point, pores closing up to the lock pressure, then dense
    with p = K1 x + K2 x^2 + K3 x^3, x = (rho/rho0 - 1 - lock_strain)/(1 + lock_strain)."""

    crush_pressure: float = quantity("Pa", "pressure at which pores begin to close", above=0.0)
    crush_strain: float = number("rho/rho0 - 1 there", above=0.0)
    lock_pressure: float = quantity("Pa", "pressure at which all pores are closed", above=0.0)
    lock_strain: float = number("rho/rho0 - 1 of the material without pores, at no pressure", above=0.0)
    K1: float = quantity("Pa", "dense material, first coefficient", above=0.0)
    K2: float = quantity("Pa", "second")
    K3: float = quantity("Pa", "third")

    def check(self) -> None:
        """The crush point comes first."""
        if self.crush_pressure >= self.lock_pressure or self.crush_strain >= self.lock_strain:
            raise ValueError("the crush point must lie below the lock point")
