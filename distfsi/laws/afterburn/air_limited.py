"""Afterburn as far as the air goes: combustion is fast, mixing decides (Kuhl, Oppenheim and Ferguson, Combustion of TNT
products in a confined explosion, 1999: the limit of fast chemistry)."""

from __future__ import annotations

from dataclasses import dataclass

from distfsi.laws.law import Afterburn, number, quantity


@dataclass(frozen=True)
class AirLimited(Afterburn):
    """Products burn at once with the air that is in their cell, `air` kilograms for each of theirs, and no further.

    What mixes them is what the cells resolve, and cells themselves: finer ones burn later. Air keeps no record of what
    it has burnt, so it serves anew where burnt products leave it. The balance of a compound with oxygen gives `air`; of
    TNT, C7H5N3O6 + 5.25 O2, it is 0.740/0.2314 = 3.20.
    """

    needs_air = True

    energy: float = quantity("J/kg", "energy of the afterburn, beside that of the detonation", above=0.0)
    air: float = number("mass of air that burns a unit mass of products to the end", above=0.0)

    def left(self, share, unburnt, pressure, air, dt):
        # What is burnt, 1 - share of the products, has used up `air` times its mass of the cell's air. Nothing burns on
        # before the detonation has passed: an explosive that shares a cell with hot products would be blown up by them.
        return min(share, max(1.0 - air / self.air, 0.0)) if unburnt <= 0.0 else share
