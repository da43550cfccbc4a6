"""From validated tables to the frozen description."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace

from distfsi.coordinates import coordinates_of
from distfsi.laws.law import Source
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.none import NoStrength
from distfsi.laws.sources.gravity import Gravity
from distfsi.narrowing import present
from distfsi.scene.description import (
    Afterburn,
    Ball,
    Body,
    Coupling,
    Detonation,
    Domain,
    Fluid,
    FluidState,
    Map,
    Output,
    Packing,
    Peaks,
    Performance,
    Phase,
    Region,
    Solid,
    SolidForm,
    Time,
)
from distfsi.scene.detonation_tables import DetonationInput
from distfsi.scene.law_tables import SourceInput
from distfsi.scene.motion import Free, Motion, Support
from distfsi.scene.rigid_tables import ObstacleInput, RigidInput, SupportInput
from distfsi.scene.schema import (
    BodyInput,
    CouplingInput,
    DomainInput,
    FluidInput,
    InflowStateInput,
    MapInput,
    OutputInput,
    PerformanceInput,
    SolidInput,
    StateInput,
    TimeInput,
)
from distfsi.scene.shapes import volume
from distfsi.scene.shocks import chapman_jouguet
from distfsi.scene.thermodynamics import pressure

BLOCK_CELLS = ((512,), (128, 64), (64, 32, 32))
TILE_CELLS = ((512,), (128, 32), (64, 8, 8))
AXES = ("x", "y", "z")
SIDES = ("low", "high")
ARRIVAL = 0.01  # of the ambient pressure
STIFF = 100.0  # times the highest pressure of a fluid: a modulus with which rigid bodies meet


def build_domain(given: DomainInput) -> Domain:
    """The box of cells."""
    boundaries = tuple(getattr(given, axis) for axis in AXES[: len(given.cells)])
    return Domain(given.lower, given.upper, given.cells, boundaries, coordinates_of(given.symmetry))


def build_time(given: TimeInput) -> Time:
    """End and step size."""
    limits = given.maximum_steps, given.wall_clock_limit
    return Time(given.end, given.cfl, *limits, given.scheme, given.smallest_step, given.front)


def build_fluid(given: FluidInput, dimensions: int) -> Fluid:
    """Phases, initial state and method of the flow."""
    phases = tuple(Phase(name, eos.build()) for name, eos in given.phases.items())
    regions = tuple(
        Region(_state(region, phases, dimensions), region.shape.build() if region.shape else None)
        for region in given.regions
    )

    def at(axis: str, side: str) -> FluidState | None:
        state = getattr(given.inflow, f"{axis}_{side}")
        return _state(state, phases, dimensions) if state else None

    low, high = SIDES
    inflow = tuple((at(axis, low), at(axis, high)) for axis in AXES[:dimensions])
    return Fluid(
        phases,
        regions,
        given.reconstruction,
        given.minimum_volume_fraction,
        inflow,
        given.precision,
        given.riemann,
        given.model,
        given.sharpening,
        _detonation(given.detonation, phases) if given.detonation else None,
        Afterburn(_index(phases, given.afterburn.phase), given.afterburn.law.build()) if given.afterburn else None,
        _map(given.map, dimensions) if given.map else None,
        given.hydrostatic_level,
    )


def _index(phases: tuple[Phase, ...], name: str) -> int:
    return [phase.name for phase in phases].index(name)


def _detonation(given: DetonationInput, phases: tuple[Phase, ...]) -> Detonation:
    """What the law leaves out follows from the equation of state."""
    index, burn = _index(phases, given.phase), given.burn.build()
    found = chapman_jouguet(phases[index].eos, burn.density, burn.energy)
    burn = replace(burn, speed=burn.speed or found.front, pressure=burn.pressure or found.pressure)
    return Detonation(index, burn, tuple(detonator.build() for detonator in given.detonators), given.path)


def _map(given: MapInput, dimensions: int) -> Map:
    return Map(given.run, given.center or (0.0,) * dimensions, AXES.index(given.axis))


def _state(given: StateInput, phases: tuple[Phase, ...], dimensions: int) -> FluidState:
    index = _index(phases, given.phase)
    p = given.pressure
    if p is None:
        p = pressure(phases[index].eos, given.density, present(given.energy))
    state = FluidState(index, given.density, p, given.velocity or (0.0,) * dimensions, given.volume_fraction)
    history = given.history if isinstance(given, InflowStateInput) else None
    return state if history is None else replace(state, history=history.build())


def build_solid(given: SolidInput, dimensions: int, highest_pressure: float) -> Solid:
    """Bodies and method of the solid; highest_pressure [Pa] of the fluid at the start, 0: there is none."""
    bodies = tuple(
        Body(
            name,
            body.shape.build(),
            body.spacing,
            body.density,
            body.velocity or (0.0,) * dimensions,
            body.eos.build(),
            body.strength.build(),
            body.fixed.build() if body.fixed else None,
            body.failure.build() if body.failure else None,
            body.fixed_velocity,
            body.radial_velocity,
            body.packing or _fitted_packing(body, body.form or given.form, dimensions),
            body.lattice_angle,
            body.form,
            bars=body.bars.build(body.spacing) if body.bars else None,
        )
        for name, body in given.bodies.items()
    )
    stiffest = max(bodies, key=_modulus, default=None)
    met = (_modulus(stiffest), stiffest.density) if stiffest else (STIFF * highest_pressure or 1.0, 1.0)
    rigid = tuple(_rigid(name, body, dimensions, met[0]) for name, body in given.rigid.items())
    obstacles = tuple(_obstacle(name, body, dimensions, *met) for name, body in given.obstacles.items())
    viscosity = (given.viscosity_alpha, given.viscosity_beta)
    form = (given.objective_rate, given.form)
    rest = (given.zero_energy, given.artificial_stress, given.friction)
    return Solid(bodies + rigid + obstacles, given.smoothing, *viscosity, *form, *rest, given.tied, given.wall_friction)


def _fitted_packing(given: BodyInput, form: SolidForm, dimensions: int) -> Packing | None:
    """What a body gets that asks for none; None: what suits its shape. A disc that bonds hold gets rings: as a lattice
    it would be a staircase, which turns what bounces off it."""
    is_disc = dimensions == 2 and isinstance(given.shape.build(), Ball) and not given.lattice_angle
    return "rings" if is_disc and form == "total_lagrangian" else None


def _modulus(body: Body) -> float:
    """[Pa] of waves at rest."""
    return float(body.density * body.eos.reference_sound_speed(body.density) ** 2)


def _obstacle(name: str, given: ObstacleInput, dimensions: int, modulus: float, density: float) -> Body:
    """A body whose law tells only how it meets others: with a `modulus` [Pa] and a `density` [kg/m3] of its surface."""
    rest = (0.0,) * dimensions
    motion = Motion((0.0,), (rest,), (0.0,), rest)
    if given.motion is not None:
        rows = len(given.motion.times)
        motion = Motion(
            given.motion.times,
            given.motion.displacements or (rest,) * rows,
            given.motion.angles or (0.0,) * rows,
            given.motion.about or rest,
            given.motion.axis or (),
        )
    laws = (LinearEos(modulus), NoStrength())
    shape = given.shape.build()
    return Body(name, shape, given.spacing, density, rest, *laws, None, packing=given.packing, motion=motion)


def _rigid(name: str, given: RigidInput, dimensions: int, modulus: float) -> Body:
    """A rigid body that moves freely; `modulus` [Pa]: how it meets others where it does not tell itself."""
    shape, rest = given.shape.build(), (0.0,) * dimensions
    supports = tuple(_support(support, rest) for support in given.supports)
    motion = Free(given.spin or (), given.mass, given.inertia or (), supports)
    density = given.density or present(given.mass) / volume(shape)
    laws = (LinearEos(given.modulus or modulus), NoStrength())
    velocity = given.velocity or rest
    return Body(name, shape, given.spacing, density, velocity, *laws, None, packing=given.packing, motion=motion)


def _support(given: SupportInput, none: tuple[float, ...]) -> Support:
    return Support(given.at, given.stiffness or none, given.damping or none, given.strength)


def build_output(given: OutputInput, stem: str, fluid: Fluid | None) -> Output:
    """Where results go: out/`stem` unless the input names a directory."""
    peaks = None
    if given.peaks and fluid:
        ambient, arrival = given.peaks.ambient_pressure, given.peaks.arrival_overpressure
        ambient = fluid.regions[0].state.pressure if ambient is None else ambient
        peaks = Peaks(ambient, ARRIVAL * abs(ambient) if arrival is None else arrival)
    directory = given.directory or f"out/{stem}"
    return Output(
        directory,
        given.fields_every,
        given.history_every,
        peaks,
        given.schlieren,
        given.hdf5,
        given.restart_every,
        stop_file_in(directory, given.stop_file),
        given.restart_at_end,
    )


def stop_file_in(directory: str, stop_file: str) -> str:
    """The stop file's name in the output directory, also where it is given as a path there; any other as given."""
    folder, name = os.path.split(stop_file)
    return name if folder and os.path.abspath(folder) == os.path.abspath(directory) else stop_file


def build_sources(gravity: tuple[float, ...] | None, given: Mapping[str, SourceInput]) -> tuple[Source, ...]:
    """What accelerates everything: gravity, and the sources by name."""
    everywhere = (Gravity(gravity),) if gravity and any(gravity) else ()
    return (*everywhere, *(source.build() for source in given.values()))


def build_coupling(given: CouplingInput) -> Coupling:
    """The scheme between fluid and solid."""
    return Coupling(given.scheme, given.sub_steps, given.drop_below)


def build_performance(given: PerformanceInput, dimensions: int) -> Performance:
    """Block and tile sizes; a default tile is no larger than the block."""
    block = given.block_cells or BLOCK_CELLS[dimensions - 1]
    tile = given.tile_cells or tuple(map(min, TILE_CELLS[dimensions - 1], block))
    return Performance(block, tile, given.imbalance)
