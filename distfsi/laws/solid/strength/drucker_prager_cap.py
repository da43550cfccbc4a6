"""The strength of soil, rock and powder by Drucker and Prager, with a cap that plastic compaction pushes on
(DiMaggio & Sandler, J. Eng. Mech. Div. ASCE 97, 1971)."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log

from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import FAILS
from distfsi.laws.law import PLASTIC_STRAIN, Column, Strength, StrengthMemory, Trial, number, quantity


@dataclass(frozen=True)
class DruckerPragerCap(Strength):
    """Soil, rock, powder: yield at cohesion + friction p, or, beyond a pressure p_a, at an ellipse with the half-axes
    p_b - p_a along p and (p_b - p_a)/eccentricity along the von Mises stress, p_b being the pressure at which the
    material is compacted.

    p_b = cap_pressure - ln(1 - e/maximum_compaction)/hardening, e the plastic compaction (a logarithmic strain); p_a is
    where the ellipse's top meets the line. On the ellipse flow is normal to it, on the line it keeps the volume. What
    is compacted has no pressure: the equation of state gets the elastic part of the density. Without a failure model no
    tension beyond tensile_strength is carried; with one, cracks limit it instead.
    """

    shear_modulus: float = quantity("Pa", "shear modulus G", above=0.0)
    cohesion: float = quantity("Pa", "von Mises stress at yield without pressure", at_least=0.0)
    friction: float = number("its growth with pressure", above=0.0)
    tensile_strength: float = quantity("Pa", "largest tension; a `failure` takes its place", at_least=0.0, default=0.0)
    eccentricity: float = number("extent of the cap along p over that along the von Mises stress", above=0.0)
    cap_pressure: float = quantity("Pa", "pressure at which virgin material is compacted", above=0.0)
    hardening: float = quantity("1/Pa", "how fast compaction approaches its maximum with pressure", above=0.0)
    maximum_compaction: float = number("largest plastic compaction", above=0.0)

    columns = (PLASTIC_STRAIN, Column("compacted_strain", "1", "plastic compaction, a logarithmic strain"))

    def check(self) -> None:
        """The cap begins under pressure, and the line in tension."""
        if self.tensile_strength * self.friction > self.cohesion:
            raise ValueError("tensile_strength must not be above cohesion/friction")
        if self.cap_pressure <= self.eccentricity * self.cohesion:
            raise ValueError("cap_pressure must be above eccentricity * cohesion")

    def elastic_density(self, density, memory: StrengthMemory):
        return density * exp(-memory.compacted_strain)

    def flow_stress_at_rest(self):
        return self.cohesion

    def respond(self, trial: Trial, dt, memory: StrengthMemory):
        before = memory.compacted_strain
        # On the cap: normal to it.
        compaction = self.compaction(trial, before) if self.is_beyond_cap(trial, before) else 0.0
        pressure = trial.pressure - trial.bulk * compaction
        flow = compaction / max(pressure - self.cap_start(before + compaction), 1e-300)
        capped = trial.stress / (1.0 + self.stiffness() * flow)
        # On the line: at one pressure.
        carried = pressure if FAILS else max(pressure, -self.tensile_strength)
        line = max(self.cohesion + self.friction * carried, 0.0)
        stress = capped if compaction > 0.0 else min(trial.stress, line)
        increment = (trial.stress - stress) / (3.0 * self.shear_modulus)
        return (stress, carried, increment, memory.plastic_strain + increment, before + compaction)

    def compaction_pressure(self, compacted):
        """p_b [Pa], the pressure at which material is compacted further."""
        return self.cap_pressure - log(max(1.0 - compacted / self.maximum_compaction, 1e-12)) / self.hardening

    def cap_start(self, compacted):
        """p_a [Pa], where the cap meets the line."""
        through = self.compaction_pressure(compacted) - self.eccentricity * self.cohesion
        return through / (1.0 + self.eccentricity * self.friction)

    def stiffness(self):
        """3 G R^2, by which flow normal to the cap lowers the von Mises stress; R is the eccentricity."""
        return 3.0 * self.shear_modulus * self.eccentricity * self.eccentricity

    def is_beyond_cap(self, trial: Trial, compacted):
        """Whether the trial stress lies outside the cap."""
        start = self.cap_start(compacted)
        along, aside = trial.pressure - start, self.eccentricity * trial.stress
        extent = self.compaction_pressure(compacted) - start
        return along > 0.0 and along * along + aside * aside > extent * extent

    def compaction(self, trial: Trial, before):
        """Increment of the plastic compaction that brings the stress back to the cap.

        Newton's method; where it would leave what is known to hold the root, that is halved.
        """
        low, left = 0.0, self.maximum_compaction - before
        high = min((trial.pressure - self.cap_start(before)) / trial.bulk, left)
        x = 0.0
        for _ in static_range(12):
            excess, slope = self.excess(trial, before, x)
            low = x if excess > 0.0 else low
            high = high if excess > 0.0 else x
            better = x - excess / slope
            x = better if better >= low and better <= high else 0.5 * (low + high)
        return x

    def excess(self, trial: Trial, before, x):
        """How far outside the cap [Pa2] the stress is after an increment x of the compaction, and the slope with x."""
        grown = 1.0 / (self.hardening * max(self.maximum_compaction - before - x, 1e-300))  # of p_b
        moved = grown / (1.0 + self.eccentricity * self.friction)  # of p_a
        start = self.cap_start(before + x)
        extent = self.compaction_pressure(before + x) - start
        along = trial.pressure - trial.bulk * x - start
        closer = -trial.bulk - moved
        # Flow normal to the cap: x = flow along.
        flow = x / max(along, 1e-300)
        less = 1.0 + self.stiffness() * flow
        aside = self.eccentricity * trial.stress / less
        lower = -aside / less * self.stiffness() * (along - x * closer) / max(along * along, 1e-300)
        excess = along * along + aside * aside - extent * extent
        slope = 2.0 * (along * closer + aside * lower - extent * (grown - moved))
        return (excess if along > 0.0 else -extent * extent, slope)

    def carried_share(self, pressure, damage):
        """Closed cracks carry by friction."""
        return 1.0 if pressure >= 0.0 else 1.0 - damage
