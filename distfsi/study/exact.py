"""Exact solutions of one-dimensional wave problems, to compare computations with.

Every fluid EOS of a scene is written here by its isentropes p = p_ref(rho) + K rho^(1 + w), which ideal gas
(p_ref = 0), stiffened gas (p_ref = -p_inf) and JWL (p_ref = A exp(-R1 v) + B exp(-R2 v)) all have; internal energy and
sound speed follow. Nothing is shared with the formulas that the solver runs, so that the two check each other.
Theory: Toro, Riemann Solvers and Numerical Methods for Fluid Dynamics, 3rd ed., chapters 3 and 4; Menikoff and Plohr,
Rev. Mod. Phys. 61 (1989) 75.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.optimize.elementwise import find_root

from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.jwl import Jwl
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.laws.solid.eos.mie_grueneisen import MieGrueneisen

Array = NDArray[np.float64]
ExactEos = IdealGas | StiffenedGas | Jwl  # those whose isentropes are written down here

LEFTWARD, RIGHTWARD = -1, 1
WEAK = 1e-5  # a pressure rise below WEAK rho c^2 is as good as isentropic: entropy rises with its cube
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
_RELATIVE = 4 * np.finfo(float).eps
_TINY = np.finfo(float).tiny


Values = float | np.ndarray  # one number or many


@dataclass(frozen=True)
class PureState:
    """State of one material: density [kg/m3], pressure [Pa], velocity along the line [m/s]."""

    density: float
    pressure: float
    velocity: float = 0.0


@dataclass(frozen=True)
class Wave:
    """A shock (head == tail) or a rarefaction fan with the speeds of its edges [m/s], and the state behind it."""

    kind: Literal["shock", "rarefaction"]
    head: float
    tail: float
    behind: PureState


@dataclass(frozen=True)
class Material:
    """A fluid EOS through its isentropes; densities may be numbers or arrays."""

    eos: ExactEos

    @property
    def omega(self) -> float:
        """Grueneisen coefficient w: p depends on energy as w rho e."""
        match self.eos:
            case IdealGas(gamma=gamma) | StiffenedGas(gamma=gamma):
                return gamma - 1.0
            case Jwl(omega=omega):
                return omega
        raise TypeError(f"no exact solution knows {self.eos}")

    @property
    def lowest_pressure(self) -> float:
        """Pressure that an expansion tends to as the density goes to zero [Pa]."""
        return -self.eos.p_inf if isinstance(self.eos, StiffenedGas) else 0.0

    def reference(self, density: Values) -> tuple[Values, Values, Values]:
        """Pressure [Pa], its slope [m2/s2] and internal energy [J/kg] on the isentrope K = 0."""
        match self.eos:
            case IdealGas():
                return 0.0, 0.0, 0.0
            case StiffenedGas(p_inf=p_inf):
                return -p_inf, 0.0, p_inf / density
            case Jwl(rho0=rho0, A=A, B=B, R1=R1, R2=R2):
                v = rho0 / density
                a, b = A * np.exp(-R1 * v), B * np.exp(-R2 * v)
                return a + b, (R1 * a + R2 * b) * v / density, (a / R1 + b / R2) / rho0
        raise TypeError(f"no exact solution knows {self.eos}")

    def energy(self, density: Values, pressure: Values) -> Values:
        """Specific internal energy [J/kg]."""
        p_ref, _, e_ref = self.reference(density)
        return e_ref + (pressure - p_ref) / (self.omega * density)

    def sound_speed(self, density: Values, pressure: Values) -> Values:
        """Isentropic sound speed [m/s]."""
        p_ref, slope, _ = self.reference(density)
        return np.sqrt(slope + (1.0 + self.omega) * (pressure - p_ref) / density)

    def isentrope(self, start: PureState, density: Values) -> Values:
        """Pressure at `density` on the isentrope through `start` [Pa]."""
        p_ref, p_ref_start = self.reference(density)[0], self.reference(start.density)[0]
        return p_ref + (start.pressure - p_ref_start) * (density / start.density) ** (1.0 + self.omega)

    def expansion_velocity(self, start: PureState, density: Values) -> Values:
        """Integral of c d(rho)/rho along the isentrope from `density` up to `start` [m/s].

        Gauss's rule in rho^(w/2), in which c d(rho)/rho is constant for ideal and stiffened gas and smooth for JWL.
        """
        half = 0.5 * self.omega
        low, high = np.asarray(density)[..., None] ** half, start.density**half
        s = low + 0.5 * (high - low) * (_NODES + 1.0)
        rho = s ** (1.0 / half)
        integrand = self.sound_speed(rho, self.isentrope(start, rho)) / (half * s)
        return np.sum(_WEIGHTS * integrand, axis=-1) * 0.5 * (high - low[..., 0])

    def shocked_density(self, ahead: PureState, pressure: float) -> float:
        """Density behind a shock that raises `ahead` to `pressure`: the root of the Hugoniot [kg/m3]."""
        V0, e0 = 1.0 / ahead.density, self.energy(ahead.density, ahead.pressure)

        def hugoniot(V: float) -> float:
            return float(self.energy(1.0 / V, pressure) - e0) - 0.5 * (pressure + ahead.pressure) * (V0 - V)

        return 1.0 / brentq(hugoniot, V0 * self.omega / (2.0 + self.omega), V0, xtol=_TINY, rtol=_RELATIVE)

    def isentropic_density(self, start: PureState, pressure: float) -> float:
        """Density where the isentrope through `start` has `pressure`, lower or by a trace higher [kg/m3]."""

        def mismatch(rho: float) -> float:
            return float(self.isentrope(start, rho)) - pressure

        return brentq(mismatch, 1e-60 * start.density, 1.001 * start.density, xtol=_TINY, rtol=_RELATIVE)


def wave_into(ahead: PureState, eos: ExactEos, pressure: float, direction: int) -> Wave:
    """The wave running in `direction` into `ahead` that leaves `pressure` [Pa] behind it."""
    material, rho0, p0, u0 = Material(eos), ahead.density, ahead.pressure, ahead.velocity
    c0 = float(material.sound_speed(rho0, p0))
    if pressure - p0 > WEAK * rho0 * c0**2:
        rho = material.shocked_density(ahead, pressure)
        mass_flux = sqrt((pressure - p0) / (1.0 / rho0 - 1.0 / rho))
        speed = u0 + direction * mass_flux / rho0
        return Wave("shock", speed, speed, PureState(rho, pressure, u0 + direction * (pressure - p0) / mass_flux))
    rho = material.isentropic_density(ahead, pressure) if pressure != p0 else rho0
    u = u0 - direction * float(material.expansion_velocity(ahead, rho))
    head, tail = u0 + direction * c0, u + direction * float(material.sound_speed(rho, pressure))
    if pressure > p0:
        head = tail = 0.5 * (head + tail)
    return Wave("shock" if pressure > p0 else "rarefaction", head, tail, PureState(rho, pressure, u))


def escape_velocity(state: PureState, eos: IdealGas | Jwl, direction: int) -> float:
    """Velocity of the front of an expansion of `state` into vacuum [m/s]."""
    return state.velocity + direction * float(Material(eos).expansion_velocity(state, 0.0))


def exact_piston(state: PureState, eos: ExactEos, velocity: float, direction: int = RIGHTWARD) -> Wave:
    """The wave that a wall moving with constant `velocity` [m/s] sends in `direction` into `state`.

    Raises ValueError if the wall leaves the fluid behind.
    """

    def mismatch(pressure: float) -> float:
        return direction * (wave_into(state, eos, pressure, direction).behind.velocity - velocity)

    return wave_into(state, eos, _root_in_pressure(mismatch, Material(eos).lowest_pressure, state.pressure), direction)


def _root_in_pressure(rising: Callable[[float], float], lowest: float, guess: float) -> float:
    """The pressure above `lowest` at which a rising function of it is zero."""
    low, high = lowest + 1e-14 * (guess - lowest), guess
    if rising(low) > 0.0:
        raise ValueError("the fluid expands into vacuum: no pressure balances the velocities")
    while rising(high) < 0.0:
        low, high = high, high + 4.0 * (high - lowest)
    return brentq(rising, low, high, xtol=_TINY, rtol=_RELATIVE, maxiter=500)


@dataclass(frozen=True)
class RiemannSolution:
    """Waves and contact between two half spaces of fluid; each side's material stays on its side of the contact."""

    left: PureState
    right: PureState
    eos_left: ExactEos
    eos_right: ExactEos
    p_star: float
    u_star: float
    left_wave: Wave
    right_wave: Wave

    @property
    def rho_star_left(self) -> float:
        """Density between the left wave and the contact [kg/m3]."""
        return self.left_wave.behind.density

    @property
    def rho_star_right(self) -> float:
        """Density between the contact and the right wave [kg/m3]."""
        return self.right_wave.behind.density

    def sample(self, x_over_t: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Density, velocity, pressure and "is left material" at x/t [m/s], an array of any shape."""
        speed = np.asarray(x_over_t, dtype=float)
        is_left = speed < self.u_star
        left = _sample_side(self.left, self.eos_left, self.left_wave, LEFTWARD, speed)
        right = _sample_side(self.right, self.eos_right, self.right_wave, RIGHTWARD, speed)
        rho, u, p = (np.where(is_left, a, b) for a, b in zip(left, right, strict=True))
        return rho, u, p, is_left


def exact_riemann(left: PureState, right: PureState, eos_left: ExactEos, eos_right: ExactEos) -> RiemannSolution:
    """Solve the Riemann problem of two fluids, each with its own EOS.

    Raises ValueError if the two move apart so fast that a vacuum opens between them.
    """

    def mismatch(pressure: float) -> float:
        from_left = wave_into(left, eos_left, pressure, LEFTWARD).behind.velocity
        return wave_into(right, eos_right, pressure, RIGHTWARD).behind.velocity - from_left

    lowest = max(Material(eos_left).lowest_pressure, Material(eos_right).lowest_pressure)
    p = _root_in_pressure(mismatch, lowest, max(left.pressure, right.pressure))
    left_wave, right_wave = wave_into(left, eos_left, p, LEFTWARD), wave_into(right, eos_right, p, RIGHTWARD)
    u = 0.5 * (left_wave.behind.velocity + right_wave.behind.velocity)
    return RiemannSolution(left, right, eos_left, eos_right, p, u, left_wave, right_wave)


def _sample_side(ahead: PureState, eos: ExactEos, wave: Wave, direction: int, speed: Array) -> tuple[Array, ...]:
    """Density, velocity and pressure that one side's wave gives at x/t = `speed`."""
    beyond = direction * speed >= direction * wave.head
    columns = [
        np.where(beyond, getattr(ahead, name), getattr(wave.behind, name))
        for name in ("density", "velocity", "pressure")
    ]
    fan = ~beyond & (direction * speed > direction * wave.tail)
    if fan.any():
        for column, values in zip(columns, _fan(ahead, eos, wave, direction, speed[fan]), strict=True):
            column[fan] = values
    return tuple(columns)


def _fan(ahead: PureState, eos: ExactEos, wave: Wave, direction: int, speed: Array) -> tuple[Array, Array, Array]:
    """Density, velocity and pressure inside a rarefaction fan, where u + direction c = x/t = `speed`."""
    material = Material(eos)

    def state_at(rho: Array) -> tuple[Array, Array]:
        velocity = ahead.velocity - direction * material.expansion_velocity(ahead, rho)
        return np.asarray(velocity), np.asarray(material.isentrope(ahead, rho))

    def mismatch(rho: Array, speed: Array) -> Array:
        u, p = state_at(rho)
        return direction * (u - speed) + material.sound_speed(rho, p)

    bracket = (wave.behind.density * (1.0 - 1e-9), ahead.density * (1.0 + 1e-9))  # rounding must not hide the root
    rho = find_root(mismatch, bracket, args=(speed,)).x
    return rho, *state_at(rho)


@dataclass(frozen=True)
class SolidShock:
    """State behind a shock in a solid without strength: pressure [Pa], density [kg/m3], specific internal energy
    [J/kg], velocity of the material and of the shock against the solid ahead [m/s]."""

    pressure: float
    density: float
    energy: float
    particle_velocity: float
    shock_velocity: float


def solid_shock(density: float, eos: MieGrueneisen, particle_velocity: float) -> SolidShock:
    """The shock that sets a solid of `density` [kg/m3] at rest in motion: U = c0 + s1 u + s2 u^2/U + s3 u^3/U^2."""
    compression = 0.0
    if particle_velocity > 0.0:

        def mismatch(x: float) -> float:
            return x * eos.c0 - particle_velocity * (1.0 - x * (eos.s1 + x * (eos.s2 + x * eos.s3)))

        compression = brentq(mismatch, 0.0, 1.0, xtol=_TINY, rtol=_RELATIVE)
    U = particle_velocity / compression if compression > 0.0 else eos.c0
    return SolidShock(
        pressure=density * U * particle_velocity,
        density=density / (1.0 - compression),
        energy=0.5 * particle_velocity**2,
        particle_velocity=particle_velocity,
        shock_velocity=U,
    )


def plate_impact(
    flyer_density: float, flyer_eos: MieGrueneisen, target_density: float, target_eos: MieGrueneisen, velocity: float
) -> tuple[SolidShock, SolidShock]:
    """Shocks in a flyer plate and in the target at rest that it hits with `velocity` [m/s], by impedance matching."""

    def mismatch(u: float) -> float:
        return (
            solid_shock(target_density, target_eos, u).pressure
            - solid_shock(flyer_density, flyer_eos, velocity - u).pressure
        )

    u = brentq(mismatch, 0.0, velocity, xtol=_TINY, rtol=_RELATIVE)
    return solid_shock(flyer_density, flyer_eos, velocity - u), solid_shock(target_density, target_eos, u)
