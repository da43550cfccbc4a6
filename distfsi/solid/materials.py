"""The materials of a scene's bodies: constants for the formulas in physics/, and what each particle remembers.

A form of the solid (updated or total Lagrangian) allocates, moves, keeps and writes the columns that `columns` names,
and calls `kernels.deform(begin, end, dt, gradient, body, *tables, *state(columns))` with the velocity gradient at
mid-step. Stresses are then those that a particle carries, damage included: forces need no further factor. Damage 1
means failed: no tension and no shear are left (closed cracks in concrete carry friction), and bonds are to be cut.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from distfsi.device.emit import plain
from distfsi.device.interface import Columns
from distfsi.laws.law import Failure, SolidEos, Strength
from distfsi.laws.solid.eos.compaction import Compaction
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.eos.mie_grueneisen import MieGrueneisen
from distfsi.laws.solid.failure.johnson_cook import JohnsonCookFailure
from distfsi.laws.solid.failure.principal_stress import PrincipalStress
from distfsi.laws.solid.scatter import Scatter
from distfsi.laws.solid.strength.concrete import Concrete
from distfsi.laws.solid.strength.elastic import Elastic
from distfsi.laws.solid.strength.johnson_cook import JohnsonCook
from distfsi.laws.solid.strength.linear_hardening import LinearHardening
from distfsi.laws.solid.strength.none import NoStrength
from distfsi.laws.solid.strength.perfectly_plastic import PerfectlyPlastic
from distfsi.scene.description import Body, Solid
from distfsi.solid.formulas.concrete import dense_pressure
from distfsi.solid.formulas.smoothing import smoothing_slope

ROOM_TEMPERATURE = 293.15  # K, of materials that do not know their own
NOT_CONCRETE = (0.0,) * 20
NO_FAILURE = (math.inf, 0.0, 0.0, 0.0, 0.0, 1.0, math.inf, 0.0)


@dataclass(frozen=True)
class Column:
    """What each particle remembers under `name`: so many numbers (0: one, as a flat array), `unit` for the output
    (None: not written), and how it turns when it is mirrored: "scalar" or "tensor"."""

    name: str
    width: int
    unit: str | None
    kind: str = "scalar"


class Materials:
    """The materials of a solid.

    constants  what the kernels are specialised with
    tables     eos, strength, failure, concrete: one row of constants per body
    columns    what each particle remembers beside density, h and energy
    """

    def __init__(self, solid: Solid, dimensions: int):
        self.bodies, self.dimensions = solid.bodies, dimensions
        self._crack_width = crack_width(solid.smoothing, dimensions)
        self.tables = tuple(
            np.array([row(body) for body in solid.bodies])
            for row in (_eos_row, lambda body: strength_constants(body.strength), self._failure_row, _concrete_row)
        )
        self.constants = {
            "POLAR_ROTATION": solid.objective_rate == "green_naghdi",
            "FAILS": any(body.failure for body in solid.bodies),
            "CONCRETE": any(isinstance(body.strength, Concrete) for body in solid.bodies),
        }
        self.columns = self._columns()

    def _failure_row(self, body: Body) -> tuple[float, ...]:
        return failure_constants(body.failure, self._crack_width * body.spacing)

    def _columns(self) -> tuple[Column, ...]:
        components = self.dimensions * (self.dimensions + 1) // 2
        columns = [
            Column("deviator", components, None, "tensor"),
            Column("plastic_strain", 0, "1"),
            Column("temperature", 0, "K"),
            Column("pressure", 0, "Pa"),
            Column("sound_speed", 0, None),
        ]
        if self.constants["FAILS"] or self.constants["CONCRETE"]:
            columns += [Column("damage", 0, "1"), Column("wear", 0, "1")]
        if self.constants["FAILS"]:
            columns.append(Column("toughness", 0, None))
        if self.constants["CONCRETE"]:
            columns.append(Column("compression", 0, "1"))
        if self.constants["POLAR_ROTATION"]:
            columns.append(Column("stretch", components, None, "tensor"))
        return tuple(columns)

    def initial(self, body: np.ndarray, id: np.ndarray, volume: np.ndarray) -> dict[str, np.ndarray]:
        """The columns of particles at rest: their bodies, global ids and volumes [m^D], all (n,)."""
        n = len(body)
        found = {c.name: np.zeros((n, c.width) if c.width else n) for c in self.columns}
        found["temperature"] = self.tables[1][body, 7]
        if "toughness" in found:
            found["toughness"] = self._toughness(body, id, volume)
        if "stretch" in found:
            found["stretch"][:, : self.dimensions] = 1.0
        return found

    def _toughness(self, body: np.ndarray, id: np.ndarray, volume: np.ndarray) -> np.ndarray:
        """Failure strain or stress over that of the input: by the weakest link, a larger particle fails earlier."""
        toughness = np.ones(len(body))
        for number, each in enumerate(self.bodies):
            if each.failure and each.failure.scatter:
                own = body == number
                toughness[own] = weibull(each.failure.scatter, id[own], volume[own], self.dimensions)
        return toughness

    def state(self, columns: Columns) -> list[Any]:
        """The arrays that `deform` reads and writes, in its order; empty ones for what no material needs."""
        names = ("energy", "density", "h", "deviator", "plastic_strain", "temperature", "pressure", "sound_speed")
        rare = {"damage": 0, "wear": 0, "toughness": 0, "compression": 0, "stretch": (0, 0)}
        found = columns.write(*names)
        for name, shape in rare.items():
            found += columns.write(name) if name in columns else [columns.device.empty(shape)]
        return found


# ---- rows of constants -----------------------------------------------------------------------------------------------


def eos_constants(eos: SolidEos, density: float) -> tuple[float, ...]:
    """rho0, c0, s1, s2, s3, gamma0, a, b1, b2 of solid/formulas/solid_eos.py; of concrete, those of its elastic
    part."""
    match eos:
        case MieGrueneisen(c0, s1, s2, s3, gamma0, a):
            return density, c0, s1, s2, s3, gamma0, a, 1.0 - 0.5 * gamma0, -0.5 * a
        case LinearEos(bulk_modulus):
            return density, math.sqrt(bulk_modulus / density), 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        case Compaction(crush_pressure, crush_strain):
            return eos_constants(LinearEos(crush_pressure / crush_strain), density)


def strength_constants(strength: Strength) -> tuple[float, ...]:
    """Shear modulus, A, B, n, C, m, reference rate, room and melt temperature, heat capacity, Taylor-Quinney factor."""
    match strength:
        case NoStrength():
            return _rate_independent(0.0, 0.0)
        case Elastic(shear_modulus) | Concrete(shear_modulus):
            return _rate_independent(shear_modulus, math.inf)
        case PerfectlyPlastic(shear_modulus, yield_stress):
            return _rate_independent(shear_modulus, yield_stress)
        case LinearHardening(shear_modulus, yield_stress, hardening_modulus):
            return _rate_independent(shear_modulus, yield_stress, hardening_modulus)
        case JohnsonCook(G, A, B, n, C, m, reference_rate, room, melt, heat_capacity, taylor_quinney):
            return G, A, B, n, C, m, reference_rate, room, melt, heat_capacity, taylor_quinney


def _rate_independent(shear_modulus: float, yield_stress: float, hardening: float = 0.0) -> tuple[float, ...]:
    return shear_modulus, yield_stress, hardening, 1.0, 0.0, 1.0, 1.0, ROOM_TEMPERATURE, math.inf, math.inf, 0.0


def failure_constants(failure: Failure | None, size: float) -> tuple[float, ...]:
    """D1 … D5, reference rate, tensile strength, fracture energy, width of a crack [m]: see
    solid/formulas/damage.py."""
    match failure:
        case None:
            return *NO_FAILURE, size
        case JohnsonCookFailure(D1, D2, D3, D4, D5, reference_rate, spall_strength, fracture_energy):
            spall = math.inf if spall_strength is None else spall_strength
            return D1, D2, D3, D4, D5, reference_rate, spall, fracture_energy, size
        case PrincipalStress(tensile_strength, fracture_energy):
            return *NO_FAILURE[:6], tensile_strength, fracture_energy, size


def crack_width(smoothing: float, dimensions: int) -> float:
    """The width [spacings] in which particles beside a crack take its energy, `smoothing` spacings being h.

    A crack that opens by d between two rows of a square lattice strains the rows at it by d over this width, and those
    beyond by less, as fewer of their bonds cross it: with linear softening all rows together take, as their strains
    sum up to d, what this width would take evenly.
    """
    reach = np.arange(-math.ceil(2.0 * smoothing), math.ceil(2.0 * smoothing) + 1.0)
    X = np.stack(np.meshgrid(*[reach] * dimensions, indexing="ij"))
    distance2 = np.sum(X**2, axis=0)
    slope = plain(smoothing_slope, {"DIMENSIONS": dimensions})(distance2, smoothing)
    weight = np.where(distance2 < 4.0 * smoothing**2, -slope, 0.0)
    return float(np.sum(weight * X[0] ** 2) / np.sum(weight * np.maximum(X[0], 0.0)))


def concrete_constants(eos: Compaction, strength: Concrete, cracks: bool) -> tuple[float, ...]:
    """The tuple `concrete` of solid/formulas/concrete.py; `cracks`: a failure model limits the tension."""
    dense = (0.0, 0.0, 0.0, eos.lock_strain, 0.0, eos.K1, eos.K2, eos.K3)
    full = brentq(
        lambda mu: dense_pressure(mu, dense) - eos.lock_pressure,
        eos.lock_strain,
        eos.lock_strain + 2.0 * eos.lock_pressure / eos.K1,
        xtol=1e-15,
    )
    s = strength
    return (
        *(eos.crush_pressure, eos.crush_strain, eos.lock_pressure, eos.lock_strain, full, eos.K1, eos.K2, eos.K3),
        *(s.compressive_strength, s.tensile_strength, s.A, s.B, s.N, s.C, s.cap),
        *(s.D1, s.D2, s.least_failure_strain, s.reference_rate, math.inf if cracks else s.tensile_strength),
    )


def _eos_row(body: Body) -> tuple[float, ...]:
    return eos_constants(body.eos, body.density)


def _concrete_row(body: Body) -> tuple[float, ...]:
    if not isinstance(body.strength, Concrete):
        return NOT_CONCRETE
    return concrete_constants(body.eos, body.strength, body.failure is not None)


# ---- scatter ---------------------------------------------------------------------------------------------------------


def weibull(scatter: Scatter, id: np.ndarray, volume: np.ndarray, dimensions: int) -> np.ndarray:
    """(n,) factors of a Weibull distribution whose mean is 1 for a volume size^D, lower for larger volumes.

    A particle's factor depends on the seed and its global id alone.
    """
    m = scatter.modulus
    mean = math.gamma(1.0 + 1.0 / m)
    return (-np.log(_uniform(scatter.seed, id)) * scatter.size**dimensions / volume) ** (1.0 / m) / mean


def _uniform(seed: int, id: np.ndarray) -> np.ndarray:
    """Numbers in (0, 1) that depend on nothing but the seed and each id (splitmix64)."""
    step = np.uint64(0x9E3779B97F4A7C15)
    with np.errstate(over="ignore"):
        z = np.uint64(seed) * np.uint64(0xD1342543DE82EF95) + (id.astype(np.uint64) + np.uint64(1)) * step
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            z = (z ^ (z >> np.uint64(shift))) * np.uint64(factor)
        z ^= z >> np.uint64(31)
    return ((z >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
