"""What strength models of metals share: isotropic hardening with radial return (paper, A.3-A.5)."""

from __future__ import annotations

from math import exp

from distfsi.formulas.subset import static_range
from distfsi.laws.law import PLASTIC_STRAIN, Column, Strength, StrengthMemory, Trial


class Metal(Strength):
    """A yield stress that grows with the plastic strain: a law gives `initial_yield` and `flow`."""

    columns = (PLASTIC_STRAIN,)

    def initial_yield(self, strain, temperature):
        """Yield stress [Pa] of slow flow at a plastic `strain`."""
        raise NotImplementedError

    def flow(self, strain, increment, dt, temperature):
        """Yield stress [Pa] after an `increment` of the plastic `strain` in `dt` [s], and its slope with the logarithm
        of the increment [Pa]."""
        raise NotImplementedError

    def plastic_increment(self, stress, strain, temperature, dt):
        """Increment x of the plastic strain: trial `stress` - 3 G x = yield stress after it.

        Newton's method for log(x): there the residual is concave, so that it converges from above without a safeguard.
        The stress is within 1e-4 of the yield stress when a virgin particle first yields, far closer afterwards.
        """
        x = (stress - self.initial_yield(strain, temperature)) / (3.0 * self.shear_modulus)
        for _ in static_range(6):
            yield_stress, slope = self.flow(strain, x, dt, temperature)
            elastic = 3.0 * self.shear_modulus * x
            residual = stress - elastic - yield_stress
            x = x * exp(min(residual / (elastic + slope), 0.0))
        return x

    def increment_of(self, trial: Trial, strain, temperature, dt):
        """Increment of the plastic strain, 0 while the material is elastic."""
        yields = trial.stress > self.initial_yield(strain, temperature)
        return self.plastic_increment(trial.stress, strain, temperature, dt) if yields else 0.0

    def respond(self, trial: Trial, dt, memory: StrengthMemory):
        """Radial return."""
        increment = self.increment_of(trial, memory.plastic_strain, 0.0, dt)
        stress = trial.stress - 3.0 * self.shear_modulus * increment
        return (stress, trial.pressure, increment, memory.plastic_strain + increment)


class HeatedMetal(Metal):
    """A metal that plastic flow heats. A law has fields `room_temperature`, `heat_capacity` and `taylor_quinney`."""

    columns = (PLASTIC_STRAIN, Column("temperature", "K", "temperature", initial="room_temperature"))

    def respond(self, trial: Trial, dt, memory: StrengthMemory):
        """Radial return, and the heat of the work that the damaged material does."""
        increment = self.increment_of(trial, memory.plastic_strain, memory.temperature, dt)
        stress = trial.stress - 3.0 * self.shear_modulus * increment
        carried = (1.0 - trial.damage) * stress
        heating = self.taylor_quinney * carried * increment / (trial.density * self.heat_capacity)
        strain = memory.plastic_strain + increment
        return (stress, trial.pressure, increment, strain, memory.temperature + heating)
