"""A scene: everything a run needs to know, checked, frozen, in SI units.

Vectors have one entry per dimension of the domain. Sides are (axis, 0 = low end | 1 = high end).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from distfsi.coordinates import Coordinates
from distfsi.coordinates.planar import PLANAR
from distfsi.gauges import Gauge
from distfsi.laws.law import Afterburn as AfterburnLaw
from distfsi.laws.law import Burn, Failure, FluidEos, PressureHistory, SolidEos, Source, Strength
from distfsi.scene.bars import Bars
from distfsi.scene.motion import Free, Motion

Hdf5 = Literal["mpi-io", "mpio", "gather"]
SolidForm = Literal["total_lagrangian", "updated_lagrangian"]
RiemannSolver = Literal["hllc", "hll", "rusanov", "adaptive"]
Reconstruction = Literal["first_order", "minmod", "van_leer", "weno5"]
TwoPhaseModel = Literal["six_equation", "five_equation"]
Scheme = Literal["rk2", "rk3"]
Packing = Literal["lattice", "rings", "relaxed"]
ObjectiveRate = Literal["jaumann", "green_naghdi"]
DetonationPath = Literal["straight", "around"]
CouplingScheme = Literal["cut_cells", "staircase", "immersed_boundary"]
BoundaryKind = Literal["wall", "symmetry", "outflow", "inflow", "periodic", "axis"]


# ---- shapes (scene/shapes.py gives each its geometry) ----------------------------------------------------------------


@dataclass(frozen=True)
class Box:
    """Axis-parallel box from `lower` to `upper` [m]."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]


@dataclass(frozen=True)
class Ball:
    """Interval, disc or sphere with `center` and `radius` [m]."""

    center: tuple[float, ...]
    radius: float


@dataclass(frozen=True)
class HalfSpace:
    """All points x with (x - point) . normal < 0 [m]."""

    point: tuple[float, ...]
    normal: tuple[float, ...]


@dataclass(frozen=True)
class Tube:
    """Ring (2D) or spherical shell (3D) between two radii about `center` [m]."""

    center: tuple[float, ...]
    inner_radius: float
    outer_radius: float


@dataclass(frozen=True)
class Cylinder:
    """Cylinder (3D) about the line from `start` to `end` [m], hollow when inner_radius > 0 [m]."""

    start: tuple[float, ...]
    end: tuple[float, ...]
    radius: float
    inner_radius: float


class Composed(ABC):
    """A shape made of others, or read from a file. It brings its own geometry; that of the five above, of which it is
    made, is in scene/shapes.py. Frozen and hashable."""

    @property
    @abstractmethod
    def dimensions(self) -> int:
        """Number of its coordinates."""

    @property
    @abstractmethod
    def exact(self) -> bool:
        """Whether `distance` is the true one, and not only a bound of it from below."""

    @abstractmethod
    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance [m] of `points` (n, D) to the surface, negative inside -> (n,): true, or nearer to zero."""

    @abstractmethod
    def support(self, normal: np.ndarray) -> float:
        """How far the shape reaches along `normal` (D,) of length 1 [m]; for some a bound from above."""

    @abstractmethod
    def volume(self) -> float:
        """Length, area or volume [m, m2, m3]."""


Shape = Box | Ball | HalfSpace | Tube | Cylinder | Composed


# ---- fluid -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Phase:
    """One of the fluid's materials."""

    name: str
    eos: FluidEos


@dataclass(frozen=True)
class FluidState:
    """State of a phase: density [kg/m3], pressure [Pa], velocity [m/s]; `phase` indexes Fluid.phases.

    volume_fraction: of the phase in a mixture with the other one; None: pure, but for the least trace of the other
    history: of an inflow, the overpressure [Pa] that comes in; None: always the same
    """

    phase: int
    density: float
    pressure: float
    velocity: tuple[float, ...]
    volume_fraction: float | None = None
    history: PressureHistory | None = None


@dataclass(frozen=True)
class Region:
    """Initial state inside `shape` (None: everywhere). Later regions paint over earlier ones."""

    state: FluidState
    shape: Shape | None


@dataclass(frozen=True)
class PointDetonator:
    """Lights the explosive from `position` [m] after `delay` [s]."""

    position: tuple[float, ...]
    delay: float = 0.0


@dataclass(frozen=True)
class LineDetonator:
    """Lights it from all points of the line from `start` to `end` [m] at once, after `delay` [s]."""

    start: tuple[float, ...]
    end: tuple[float, ...]
    delay: float = 0.0


@dataclass(frozen=True)
class PlaneDetonator:
    """Lights it from all of the plane through `point` [m] at once, after `delay` [s]."""

    point: tuple[float, ...]
    normal: tuple[float, ...]
    delay: float = 0.0


Detonator = PointDetonator | LineDetonator | PlaneDetonator


@dataclass(frozen=True)
class Detonation:
    """How the explosive, a phase, burns, all numbers of its law known; what lights it, and whether fronts run straight
    or around what is no explosive at the start."""

    phase: int
    burn: Burn
    detonators: tuple[Detonator, ...]
    path: DetonationPath = "straight"


@dataclass(frozen=True)
class Afterburn:
    """How the products, a phase, burn with air."""

    phase: int
    law: AfterburnLaw


@dataclass(frozen=True)
class Map:
    """What the fluid starts from beside its regions: the end of a `run` (its output directory, or a restart file) in
    radial coordinates, about `center` [m], with its axis along `axis` of three dimensions."""

    run: str
    center: tuple[float, ...]
    axis: int = 2


@dataclass(frozen=True)
class Fluid:
    """The compressible flow. One phase: Euler; several: `model`.

    hydrostatic_level: coordinate along gravity [m] where the pressure is as the first region says; there, and in all
    regions with that pressure, the fluid is at rest. None: regions have their pressures everywhere.
    """

    phases: tuple[Phase, ...]
    regions: tuple[Region, ...]
    reconstruction: Reconstruction
    minimum_volume_fraction: float
    inflow: tuple[tuple[FluidState | None, FluidState | None], ...]  # per axis, per side
    precision: Literal["float64", "float32"]
    riemann: RiemannSolver = "hllc"
    model: TwoPhaseModel = "six_equation"
    sharpening: bool = False
    detonation: Detonation | None = None
    afterburn: Afterburn | None = None
    map: Map | None = None
    hydrostatic_level: float | None = None


# ---- solid -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Body:
    """A solid body packed with particles `spacing` [m] apart.

    Particles inside `fixed` (if any) keep fixed_velocity [m/s]. To `velocity` comes radial_velocity [m/s], outward at
    the surface, of hollow bodies at the inner one: it grows with r in a full body and keeps volumes in a hollow one.
    `packing` (None: what suits the shape): rings along the surface, a lattice, turned by lattice_angle [rad] about a
    cylinder's axis or the z axis, or particles that pushed each other apart. `form` (None: that of the solid).
    A body with a `motion` is rigid: an obstacle, which stands or goes as told, or free; its law tells how
    it meets others. `bars` that lie in it.
    """

    name: str
    shape: Shape
    spacing: float
    density: float
    velocity: tuple[float, ...]
    eos: SolidEos
    strength: Strength
    fixed: Shape | None
    failure: Failure | None = None
    fixed_velocity: tuple[float, ...] | None = None
    radial_velocity: float = 0.0
    packing: Packing | None = None
    lattice_angle: float = 0.0
    form: SolidForm | None = None
    motion: Motion | Free | None = None
    bars: Bars | None = None

    @property
    def path(self) -> tuple[str, str, str]:
        """Where the input has it."""
        kind = {Motion: "obstacles", Free: "rigid"}.get(type(self.motion), "bodies")
        return ("solid", kind, self.name)


@dataclass(frozen=True)
class Solid:
    """All bodies and how they are computed. h = smoothing * spacing; artificial viscosity alpha, beta (Eq. 6).

    `zero_energy`: the stiffness of bonds against what the deformation gradient does not see, in shear moduli;
    `artificial_stress`: the share of the tension with which particles without bonds resist clumping, 0: none.
    `friction`: Coulomb's coefficient between bodies; `wall_friction`: at walls of the domain. `tied`: names of bodies
    that hold together where they touch.
    """

    bodies: tuple[Body, ...]
    smoothing: float
    viscosity_alpha: float
    viscosity_beta: float
    objective_rate: ObjectiveRate = "jaumann"
    form: SolidForm = "total_lagrangian"
    zero_energy: float = 4.0 / 3.0
    artificial_stress: float = 0.0
    friction: float = 0.0
    tied: tuple[tuple[str, ...], ...] = ()
    wall_friction: float = 0.0

    def form_of(self, body: Body) -> SolidForm | Literal["rigid"]:
        """The form of a body: its own or that of the solid."""
        return "rigid" if body.motion else body.form or self.form

    @property
    def obstacles(self) -> bool:
        """Whether no force moves any of them: they stand, or go as told."""
        return all(isinstance(body.motion, Motion) for body in self.bodies)

    @property
    def first_tied(self) -> tuple[int, ...]:
        """For each body the number of the first one among those that it holds together with, through any of them."""
        first, numbers = list(range(len(self.bodies))), {body.name: n for n, body in enumerate(self.bodies)}
        for names in self.tied:
            joined = {first[numbers[name]] for name in names}
            first = [min(joined) if n in joined else n for n in first]
        return tuple(first)


# ---- the whole -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Domain:
    """Box of equal cells. `boundaries[axis][side]` is the kind of each end, "axis" where a distance r begins at 0."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    cells: tuple[int, ...]
    boundaries: tuple[tuple[BoundaryKind, BoundaryKind], ...]
    coordinates: Coordinates = PLANAR

    @property
    def dimensions(self) -> int:
        return len(self.cells)

    @property
    def spacing(self) -> tuple[float, ...]:
        return tuple((b - a) / n for a, b, n in zip(self.lower, self.upper, self.cells, strict=True))


@dataclass(frozen=True)
class Time:
    """The run ends at `end` [s] or after `maximum_steps`, or when a wave has come as far as `front` [m], or to the
    first contact in the run that follows. CFL = dt max sum_d (|u_d| + c)/h_d.

    `scheme`: a strong-stability-preserving Runge-Kutta method. It stops early, with a restart file, after
    `wall_clock_limit` [s] of computing; and where the stable step is below `smallest_step` of the first one.
    """

    end: float
    cfl: float
    maximum_steps: int | None
    wall_clock_limit: float | None = None
    scheme: Scheme = "rk3"
    smallest_step: float = 1e-3
    front: float | Literal["contact"] | None = None


@dataclass(frozen=True)
class BlastLoad:
    """The blast of a `mass` [kg] of TNT about a `center` [m] that detonates at `start` [s]."""

    mass: float
    center: tuple[float, ...]
    burst: str
    start: float


@dataclass(frozen=True)
class Peaks:
    """What the cells remember of a blast: overpressure is above `ambient_pressure` [Pa]; a wave has arrived when it
    reaches `arrival_overpressure` [Pa]."""

    ambient_pressure: float
    arrival_overpressure: float


@dataclass(frozen=True)
class Output:
    """Where and how often: fields every `fields_every` [s] (0: first and last only), history every so many steps.

    `peaks` (None: not kept) and `schlieren` are written with the cells. `hdf5`: who writes field and restart files.
    Restart files follow each other after `restart_every` [s] of wall-clock time, 0: only at the end (`restart_at_end`)
    and when the run is stopped, as it is by a file called `stop_file` in the directory.
    """

    directory: str
    fields_every: float
    history_every: int
    peaks: Peaks | None = None
    schlieren: bool = False
    hdf5: Hdf5 = "mpi-io"
    restart_every: float = 0.0
    stop_file: str = "stop"
    restart_at_end: bool = True


@dataclass(frozen=True)
class Coupling:
    """How fluid and solid meet; the solid makes up to so many `sub_steps` in a step of the fluid.

    drop_below: the fluid is dropped when its pressure on the solid has nowhere reached this [Pa] any more; None: never.
    """

    scheme: CouplingScheme = "cut_cells"
    sub_steps: int = 8
    drop_below: float | None = None


@dataclass(frozen=True)
class Performance:
    """Block and tile sizes in cells per axis; they change speed only, never a bit of the result."""

    block_cells: tuple[int, ...]
    tile_cells: tuple[int, ...]
    imbalance: float = 1.25  # computing time of the busiest rank over the mean from which on blocks change hands


@dataclass(frozen=True)
class Origin:
    """Where a scene comes from: the input file, its text, and the settings that were laid over it."""

    file: str
    text: str
    settings: tuple[str, ...]


@dataclass(frozen=True)
class Scene:
    """A checked scene. `notes`: what its input should be told in other words; `stages`: runs that come before it;
    `origin`: None for a scene that was made in Python, and for a stage."""

    title: str
    domain: Domain
    time: Time
    fluid: Fluid | None
    solid: Solid | None
    output: Output
    performance: Performance
    gauges: Mapping[str, Gauge] = field(default_factory=dict)
    coupling: Coupling = Coupling()
    sources: tuple[Source, ...] = ()
    loads: tuple[BlastLoad, ...] = ()
    notes: tuple[str, ...] = field(default=(), compare=False)
    stages: tuple[Scene, ...] = ()
    origin: Origin | None = field(default=None, compare=False)

    @property
    def ambient_pressure(self) -> float | None:
        """[Pa] that overpressure counts from; None where it is another at each place, or without a fluid."""
        if self.fluid is None or self.fluid.hydrostatic_level is not None:
            return None
        peaks = self.output.peaks
        return peaks.ambient_pressure if peaks else self.fluid.regions[0].state.pressure
