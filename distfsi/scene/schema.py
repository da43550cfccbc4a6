"""The sections of a TOML input as pydantic models: every key with its unit, range, default and meaning."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from distfsi.scene import description
from distfsi.scene.bar_tables import BarsInput
from distfsi.scene.charges import ChargeInput
from distfsi.scene.detonation_tables import AfterburnSectionInput, DetonationInput
from distfsi.scene.law_tables import (
    FailureInput,
    GaugeInput,
    HistoryInput,
    SolidEosInput,
    SourceInput,
    StrengthInput,
    SymmetryWord,
)
from distfsi.scene.load_tables import LoadInput
from distfsi.scene.material_tables import NamedPhaseInput, from_material
from distfsi.scene.mirrors import Shape
from distfsi.scene.rigid_tables import ObstacleInput, RigidInput
from distfsi.scene.values import (
    Acceleration,
    Count,
    Density,
    Length,
    PhaseName,
    Position,
    PositivePressure,
    Pressure,
    Table,
    Velocity,
    counts,
    quantity,
)

# ---- domain and time -------------------------------------------------------------------------------------------------

Ends = Annotated[
    tuple[description.BoundaryKind, description.BoundaryKind],
    Field(description="kind of the low and of the high end"),
]
OUTFLOW: tuple[description.BoundaryKind, description.BoundaryKind] = ("outflow", "outflow")


class DomainInput(Table):
    """The box in which everything happens; the number of entries in `cells` is the number of dimensions."""

    lower: Position = Field(description="low corner")
    upper: Position = Field(description="high corner")
    cells: counts(1) = Field(description="number of cells along each axis")
    x: Ends = OUTFLOW
    y: Ends = OUTFLOW
    z: Ends = OUTFLOW
    symmetry: SymmetryWord = Field(
        "planar",
        description='what turns about an axis or a point: "axisymmetric" (2D): x is the distance r from an axis, y the '
        'place z along it; "cylindrical", "spherical" (1D): x is the distance r from an axis or a point. Totals are of '
        'the whole turn, in "cylindrical" per metre along the axis. The end at r = 0 has the kind "axis"',
    )
    gravity: Acceleration | None = Field(None, description="acceleration of everything; default none")


class TimeInput(Table):
    """How long to run."""

    end: quantity("s", gt=0.0) = Field(description="end time")
    front: quantity("m", gt=0.0) | Literal["contact"] | None = Field(
        None,
        description="spherical, cylindrical: the run ends before that when a wave has come so far from r = 0; "
        '"contact", of a stage: when it is near what the next run has beside the fluid around the centre of its map',
    )
    cfl: quantity("1", gt=0.0, le=1.0) = Field(0.5, description="dt as a fraction of the largest stable one")
    scheme: description.Scheme = Field("rk3", description="strong-stability-preserving Runge-Kutta method")
    maximum_steps: Count | None = Field(None, description="stop after so many steps")
    wall_clock_limit: quantity("s", gt=0.0) | None = Field(
        None, description="computing time after which the run stops early with a restart file, exit code 75"
    )
    smallest_step: quantity("1", gt=0.0, lt=1.0) = Field(
        1e-3, description="the run ends, exit code 3, where the stable step is below this part of the first one"
    )


# ---- fluid -----------------------------------------------------------------------------------------------------------


class StateInput(Table):
    """State of a phase, and how much of the other there is in it; give its pressure or its energy. What a state of a
    phase with a `material` leaves out is the material's at rest, of an explosive with all its energy released."""

    model_config = from_material("density")

    phase: PhaseName = Field(description="name of the phase")
    density: Density = Field(description="density of the phase")
    pressure: Pressure | None = Field(None, description="pressure")
    energy: quantity("J/kg") | None = Field(None, description="specific internal energy, instead of the pressure")
    velocity: Velocity | None = Field(None, description="velocity; default at rest")
    volume_fraction: quantity("1", gt=0.0, lt=1.0) | None = Field(
        None,
        description="of the phase in a mixture of two; default all but `minimum_volume_fraction` of each other one",
    )

    @model_validator(mode="after")
    def _one_of_two(self) -> StateInput:
        if (self.pressure is None) == (self.energy is None):
            raise ValueError("give either pressure or energy" + (", not both" if self.pressure is not None else ""))
        return self


class RegionInput(StateInput):
    """Initial state; later regions paint over earlier ones, and the first covers the whole domain."""

    shape: Shape | None = Field(None, description="where; the first region has none and covers everything")


class InflowStateInput(StateInput):
    """State that comes in through an end."""

    history: HistoryInput | None = Field(
        None,
        description="overpressure in time; density and velocity are those behind a wave of it that runs into fluid of "
        "this state; default none",
    )


class InflowInput(Table):
    """State that comes in through each end whose kind is `inflow`."""

    x_low: InflowStateInput | None = None
    x_high: InflowStateInput | None = None
    y_low: InflowStateInput | None = None
    y_high: InflowStateInput | None = None
    z_low: InflowStateInput | None = None
    z_high: InflowStateInput | None = None


class MapInput(Table):
    """The end of another run, in radial coordinates, as the start of this one: over the first region, under the others.
    Time goes on from there."""

    run: str = Field(description="output directory of a finished run, or a restart file")
    center: Position | None = Field(None, description="where its r = 0 (and z = 0) lies; default the origin")
    axis: Literal["x", "y", "z"] = Field("z", description="3D: along which axis its own lies")


class FluidInput(Table):
    """The compressible flow of one to five phases, numbered in order of appearance."""

    phases: dict[str, NamedPhaseInput] = Field(
        min_length=1, max_length=5, description="`[fluid.phases.NAME]`: one to five materials, each with its EOS"
    )
    regions: tuple[RegionInput, ...] = Field(description="`[[fluid.regions]]`: the initial state")
    hydrostatic_level: quantity("m") | None = Field(
        None,
        description="coordinate along gravity where the pressure of the first region holds: regions with that pressure "
        "then are at rest, their pressures growing along gravity, their densities along isentropes; default: as given",
    )
    map: MapInput | None = Field(None, description="`[fluid.map]`: goes on from another run")
    inflow: InflowInput = Field(InflowInput(), description="`[fluid.inflow.x_low]` and so on")
    reconstruction: description.Reconstruction = Field(
        "minmod", description="slopes of MUSCL, or curves through five cells; volume fractions then by van_leer"
    )
    sharpening: bool = Field(False, description="of several phases: keep their interfaces within some three cells")
    riemann: description.RiemannSolver = Field(
        "hllc", description='flux; "adaptive": "hllc" with shear along strong shocks, against carbuncles'
    )
    model: description.TwoPhaseModel = Field(
        "six_equation",
        description="of several phases: with pressures that relax in each stage, or with one from the start",
    )
    detonation: DetonationInput | None = Field(
        None, description="how the explosive burns and what lights it; default: its regions are given burnt"
    )
    afterburn: AfterburnSectionInput | None = Field(None, description="how its products burn with air; default not")
    minimum_volume_fraction: quantity("1", gt=0.0, lt=0.5) = Field(
        1e-6, description="share of each absent phase in a pure region, and the least of each phase in any cell"
    )
    precision: Literal["float64", "float32"] = Field("float64", description="arithmetic")


# ---- solid -----------------------------------------------------------------------------------------------------------


def _none_as_absent(value: Any) -> Any:
    return None if value == "none" else value


class BodyInput(Table):
    """A solid body packed with particles."""

    model_config = from_material("density", "eos", "strength")

    material: str | None = Field(
        None, description="name of a solid material (`distfsi materials`); the next keys change it"
    )
    shape: Shape = Field(description="what it fills; a half_space is cut to the domain")
    spacing: Length = Field(description="distance between particles; at most 0.75 of a fluid cell, better 0.5")
    density: Density = Field(description="density at rest")
    velocity: Velocity | None = Field(None, description="initial velocity; default at rest")
    eos: SolidEosInput = Field(description="pressure law")
    strength: StrengthInput = Field(description='strength model, or "none"')
    failure: Annotated[
        FailureInput | None,
        BeforeValidator(_none_as_absent, json_schema_input_type=FailureInput | Literal["none"] | None),
    ] = Field(None, description='what breaks it, or "none"; default that of the material, if it has a name and one')
    fixed: Shape | None = Field(None, description="particles that start in here keep fixed_velocity")
    fixed_velocity: Velocity | None = Field(None, description="velocity of the fixed particles; default at rest")
    radial_velocity: quantity("m/s") = Field(
        0.0, description="initial speed away from center or axis at the surface; hollow bodies: the inner one"
    )
    packing: description.Packing | None = Field(
        None,
        description="lattice; rings along the surface of a tube, ball or cylinder, those of a ball in 3D in shells; or "
        "relaxed: particles that pushed each other apart; default rings in a cylinder, in 2D in a tube and, if bonds "
        "hold it, in a ball; relaxed in what no lattice fits, else lattice",
    )
    lattice_angle: quantity("rad") = Field(
        0.0, description="turns the lattice about the axis of a cylinder, else about z; 2D and 3D"
    )
    form: description.SolidForm | None = Field(None, description="as `form` of the solid, of this body alone")
    bars: BarsInput | None = Field(None, description="bars that lie in it; default none")


class SolidInput(Table):
    """Solid bodies: such that deform, computed with smoothed particles, rigid ones, and obstacles."""

    bodies: dict[str, BodyInput] = Field({}, description="`[solid.bodies.NAME]`: the bodies")
    rigid: dict[str, RigidInput] = Field({}, description="`[solid.rigid.NAME]`: rigid bodies that forces move")
    obstacles: dict[str, ObstacleInput] = Field(
        {}, description="`[solid.obstacles.NAME]`: rigid parts that stand or go as told"
    )
    tied: tuple[tuple[str, ...], ...] = Field(
        (), description="lists of names of bodies that hold together where they touch, by bonds or as one material"
    )
    form: description.SolidForm = Field(
        "total_lagrangian",
        description="particles hold on to the neighbours they start with, by bonds that damage cuts, or act on those "
        'that are near ("updated_lagrangian")',
    )
    smoothing: quantity("1", ge=1.0, le=3.0) = Field(1.3, description="smoothing length over particle spacing")
    viscosity_alpha: quantity("1", ge=0.0) = Field(1.0, description="linear artificial viscosity")
    viscosity_beta: quantity("1", ge=0.0) = Field(2.0, description="quadratic artificial viscosity")
    zero_energy: quantity("1", ge=0.0, le=5.0) = Field(
        4.0 / 3.0, description="stiffness of bonds against zero-energy modes, in shear moduli"
    )
    artificial_stress: quantity("1", ge=0.0, le=1.0) = Field(
        0.0,
        description="of the updated Lagrangian form: share of the tension with which close particles push each other "
        "away, against clumping; 0.3 is usual, 0 is none",
    )
    friction: quantity("1", ge=0.0, le=2.0) = Field(0.0, description="Coulomb's coefficient between bodies that meet")
    wall_friction: quantity("1", ge=0.0, le=2.0) = Field(
        0.0, description="Coulomb's coefficient between bodies and walls of the domain"
    )
    objective_rate: description.ObjectiveRate = Field(
        "jaumann", description="axes in which stresses are kept turn with the vorticity, or with the polar rotation"
    )


# ---- the whole -------------------------------------------------------------------------------------------------------


class PeaksInput(Table):
    """What the cells remember: peak overpressure and dynamic pressure, positive impulse, time of arrival."""

    ambient_pressure: Pressure | None = Field(
        None, description="pressure that overpressure counts from; default that of the first region"
    )
    arrival_overpressure: PositivePressure | None = Field(
        None, description="a wave has arrived at this overpressure; default 1 % of the ambient pressure"
    )


def _truth_as_table(value: Any) -> Any:
    return {True: {}, False: None}[value] if isinstance(value, bool) else value


class OutputInput(Table):
    """What is written, where and when."""

    directory: str | None = Field(None, description="default: out/ and the input file's name")
    fields_every: quantity("s", ge=0.0) = Field(0.0, description="time between field outputs; 0: first and last only")
    history_every: Count = Field(10, description="steps between lines of the history")
    peaks: Annotated[PeaksInput | None, BeforeValidator(_truth_as_table, json_schema_input_type=PeaksInput | bool)] = (
        Field(None, description="true or a table: also write what the cells remember of a blast")
    )
    schlieren: bool = Field(
        False, strict=True, description="also write the slope of the density over its largest value; 2D and 3D"
    )
    hdf5: description.Hdf5 = Field(
        "mpi-io",
        description='who writes: all ranks by MPI-IO, all ranks by an h5py with MPI ("mpio"), or rank 0 ("gather")',
    )
    restart_every: quantity("s", ge=0.0) = Field(
        1800.0, description="computing time between restart files, of which two are kept; 0: only at the end"
    )
    restart_at_end: bool = Field(
        True, strict=True, description="write a restart file at the end, from which the run can be extended"
    )
    stop_file: str = Field(
        "stop", description="a file in the output directory that, when it appears, stops the run early"
    )


# ---- how parts meet, and what only changes speed ---------------------------------------------------------------------


class CouplingInput(Table):
    """How fluid and solid meet."""

    scheme: description.CouplingScheme = Field(
        "cut_cells",
        description='"cut_cells": conservative, and walls do not leak; "staircase": the same with whole cells only, to '
        'compare with: its forces on oblique walls are rough; "immersed_boundary": covered cells copy the fluid',
    )
    sub_steps: Annotated[int, Field(strict=True, ge=1)] = Field(
        8,
        description="most steps that the solid makes within one of the fluid, where its own must be shorter; "
        '1 with "immersed_boundary"',
    )
    drop_below: quantity("Pa", gt=0.0) | None = Field(
        None,
        description="when the fluid's (absolute) pressure on the solid, once it has been higher, is below this "
        "everywhere, the fluid is dropped and the solid goes on alone; default: never",
    )


class PerformanceInput(Table):
    """Sizes that change speed, never the result."""

    block_cells: counts(4) | None = Field(None, description="cells of a block: [512], [128, 64], [64, 32, 32]")
    tile_cells: counts(1) | None = Field(None, description="cells of a tile: [512], [128, 32], [64, 8, 8]")
    imbalance: float = Field(
        1.25,
        ge=1.0,
        description="computing time of the busiest rank over the mean of all, from which on blocks change hands",
    )


class StageInput(Table):
    """A run in radial coordinates that comes before the scene's own, which goes on from it, as `[fluid.map]` says. Its
    results go to a directory of its own. It has the phases, the method and the times of the scene but for what stands
    here."""

    domain: dict[str, Any] = Field(description="as `[domain]`: another one")
    regions: tuple[dict[str, Any], ...] = Field((), description="as `[[fluid.regions]]`: those of this domain")
    time: dict[str, Any] = Field({}, description="as `[time]`: what is another, `end` as a rule")
    detonators: tuple[dict[str, Any], ...] = Field((), description="as those of `[fluid.detonation]`, in this domain")
    map: dict[str, Any] = Field({}, description="as `[fluid.map]` without `run`, of a stage after the first")
    gauges: dict[str, Any] = Field({}, description="as `[gauges.NAME]`: those of this stage")


class Sections(Table):
    """The sections of an input, any of which may be absent."""

    title: str = Field("", description="what this run is")
    domain: DomainInput | None = None
    time: TimeInput | None = None
    fluid: FluidInput | None = None
    charges: tuple[ChargeInput, ...] = Field((), description="`[[charges]]`: explosives by mass and place")
    solid: SolidInput | None = None
    sources: dict[str, SourceInput] = Field({}, description="`[sources.NAME]`: what accelerates everything, besides")
    loads: dict[str, LoadInput] = Field({}, description="`[loads.NAME]`: what presses on bodies where no fluid is")
    output: OutputInput = OutputInput()
    gauges: dict[str, GaugeInput] = Field({}, description="`[gauges.NAME]`: what is sampled, and how often")
    coupling: CouplingInput = CouplingInput()
    performance: PerformanceInput = PerformanceInput()
    stages: tuple[StageInput, ...] = Field((), description="`[[stages]]`: runs before this one, one after the other")


class Input(Sections):
    """A whole input: [domain], [time], and at least one of [fluid] and [solid]."""

    domain: DomainInput
    time: TimeInput


def context_of(data: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """What validation must know of the whole input `data`: its dimensions (None: not clear), its phase names, and the
    folder from which the names of files count."""
    domain, fluid = data.get("domain"), data.get("fluid")
    cells = domain.get("cells") if isinstance(domain, dict) else None
    phases = fluid.get("phases") if isinstance(fluid, dict) else None
    dimensions = len(cells) if isinstance(cells, list) else 1 if isinstance(cells, int) else None
    names = tuple(phases) if isinstance(phases, dict) else ()
    return {"dimensions": dimensions, "phases": names, "folder": folder}
