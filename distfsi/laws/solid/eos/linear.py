"""Pressure in proportion to the compression."""

from dataclasses import dataclass

from distfsi.laws.law import SolidEos, quantity


@dataclass(frozen=True)
class LinearEos(SolidEos):
    """p = K (rho/rho0 - 1)."""

    bulk_modulus: float = quantity("Pa", "bulk modulus K", above=0.0)
