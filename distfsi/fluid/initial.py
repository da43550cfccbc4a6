"""The fluid's state before the first step: regions painted over each other, cell by cell."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from distfsi.device.emit import plain
from distfsi.fluid.formulas import phases, relaxation, relaxation_many, six_equation, six_equation_many
from distfsi.fluid.kernels.rows import HALVINGS, bisected_changes
from distfsi.fluid.layers import Layers, is_layer
from distfsi.fluid.mapping import Mapping
from distfsi.fluid.model import FluidModel
from distfsi.mesh.blocks import Blocks, Grid
from distfsi.narrowing import of_kind, present
from distfsi.scene.description import Fluid, FluidState, Shape
from distfsi.scene.fractions import Filled, cell_fractions, corrected
from distfsi.scene.shapes import bounding_box, contains, volume_within
from distfsi.scene.thermodynamics import pressure

MANY = (six_equation_many, relaxation_many)
RELAXATION = ("phases_before", "relaxed_fraction_change", "halved_range", "range_of_change")
RELAXATION_MANY = ("phases_before", "relaxed_changes")
WARM = 0.9  # of its pressure may be that of the cold curve where nothing is known of a phase
ALIKE = 1e-9  # part by which pressures differ that are one


def fractions(blocks: Blocks, shape: Shape) -> list[np.ndarray | None]:
    """Collective. How much of each active cell (z, y, x) of the local blocks lies in `shape`, None where nothing does.

    All together they hold the exact volume of what lies in the domain, where that is known; not yet around an axis, but
    for a sphere on it.
    """
    grid, axes = blocks.grid, blocks.grid.dimensions
    lower, upper = bounding_box(shape)
    parts: list[np.ndarray | None] = []
    for block in range(blocks.local_count):
        centers, spacing = blocks.cell_centers(block)[:axes], grid.spacing[:axes]
        ends = zip(centers, spacing, lower, upper, strict=True)
        near = all(x[-1] + 0.5 * h >= low and x[0] - 0.5 * h <= high for x, h, low, high in ends)
        found = cell_fractions(shape, centers, spacing, grid.coordinates) if near else None
        parts.append(None if found is None else found.reshape(blocks.extent[block][::-1]))
    if grid.coordinates.radial:
        return parts
    filled = Filled.together(Filled.by(part) for part in parts if part is not None)
    filled = Filled.together(blocks.communicator.allgather(filled))
    volume = volume_within(shape, grid.lower[:axes], grid.upper[:axes])
    cells = None if volume is None else volume / math.prod(grid.spacing)
    return [None if part is None else corrected(part, filled, cells) for part in parts]


class InitialState:
    """Conserved states of the scene's regions.

    A region is one phase. The others are present in it, too, as a trace of `minimum_volume_fraction` each or, of two
    phases, as much as the region's state says, at the same pressure, on the isentropes through the first states that
    the scene gives for them.

    layers  of those that are at rest under a body force, if that is asked for: regions with the pressure of the first
            one then have that of their layer, on the isentropes through their states
    """

    def __init__(self, fluid: Fluid, model: FluidModel, grid: Grid):
        """Raises InputError where a fluid that is to be at rest under a body force cannot be."""
        self.fluid, self.model = fluid, model
        self._conserved, self._primitives = (model.formula(name) for name in ("conserved", "primitives"))
        self._references, self._omegas = (
            [model.formula(f"{name}_{k + 1}") for k in range(model.phases)] for name in ("reference", "grueneisen")
        )
        if model.phases > 1:
            of_states, of_pressures = (six_equation, relaxation) if model.phases == 2 else MANY
            names = RELAXATION if model.phases == 2 else RELAXATION_MANY
            formulas = [of_states.phase_energies, *(getattr(of_pressures, name) for name in names)]
            formulas += [bisected_changes] * (model.phases > 2)
            self._energies, self._before, self._relaxed, *self._to_the_end = (
                plain(formula, model.constants, model.bindings) for formula in formulas
            )
        if model.phases > 2:
            self._bounded = plain(phases.bounded, model.constants)
        self.layers: Layers | None = None
        if fluid.hydrostatic_level is not None:
            self.layers = self._layers(grid, fluid.hydrostatic_level)

    def of(self, state: FluidState) -> np.ndarray:
        """Conserved state (variables,) of a region or an inflow."""
        return self._at_pressures(state, np.array([state.pressure]))[:, 0]

    def _at_pressures(self, state: FluidState, pressures: np.ndarray) -> np.ndarray:
        """Conserved states (variables, n) on the isentropes through a `state`, at pressures (n,) [Pa]."""
        densities = [
            self._on_isentrope(k, state, pressures) if k == state.phase else self._beside(k, state, pressures)
            for k in range(self.model.phases)
        ]
        fraction = self._fractions(state)
        shares = [1.0 if state.phase == self.model.constants["CARRIER"] else 0.0] * len(self.model.carried)
        conserved = self._conserved((*densities, *state.velocity, pressures, *fraction, *shares))
        return np.array([np.broadcast_to(values, pressures.shape) for values in conserved], dtype=float)

    def paint(self, blocks: Blocks, field: np.ndarray, mapping: Mapping | None = None) -> None:
        """Collective. Fill the active cells of `field` (local blocks, variables, Z, Y, X). A cell that a region covers
        in part holds that part of the region's mass, momentum and energy; two materials have come to one pressure in
        it. What is mapped comes over the first region."""
        ghosts = blocks.grid.ghosts[::-1]
        for number, region in enumerate(self.fluid.regions):
            states = self._states(region.state)
            whole = [np.ones((1, 1, 1))] * blocks.local_count
            parts = whole if region.shape is None else fractions(blocks, region.shape)
            for block, part in enumerate(parts):
                active = (slice(g, g + n) for g, n in zip(ghosts, blocks.extent[block][::-1], strict=True))
                where: tuple[Any, ...] = (block, slice(None), *active)
                if part is not None:
                    new = self._in_block(states, blocks.origin[block], blocks.extent[block])
                    self._lay_over(field[where], new, part)
                if mapping and number == 0:
                    mapping.apply(block, field[where])
        if mapping:
            mapping.sum_up()

    def _states(self, state: FluidState) -> np.ndarray:
        """Conserved states (variables, n) of a region in each layer, or (variables, 1) of one that has no layers."""
        if self.layers is None or state.pressure != self.fluid.regions[0].state.pressure:
            return self.of(state)[:, None]
        return self._at_pressures(state, self.layers.pressures)

    def _in_block(self, states: np.ndarray, origin: np.ndarray, extent: np.ndarray) -> np.ndarray:
        """The states of a region beside the cells (variables, z, y, x) of a block."""
        if self.layers is None or states.shape[1] == 1:
            return states[:, :1, None, None]
        chosen, shape = self.layers.of(int(origin[self.layers.axis]), int(extent[self.layers.axis]))
        return states[:, chosen].reshape(-1, *shape)

    def _lay_over(self, cells: np.ndarray, new: np.ndarray, part: np.ndarray) -> None:
        """Let `new` states, as wide as `cells` (variables, z, y, x) or 1, fill a `part` (z, y, x) of each."""
        mixed = part * new + (1.0 - part) * cells
        if self.model.phases > 1:
            cut = np.argwhere((part > 0.0) & (part < 1.0))
            here = np.broadcast_to(new, cells.shape)
            alike = self._alike(here[:, *cut.T], cells[:, *cut.T])
            for at in map(tuple, cut[~alike]):
                mixed[:, *at] = self._mixed(here[:, *at], cells[:, *at], part[at])
        cells[:] = np.where(part == 1.0, new, np.where(part == 0.0, cells, mixed))

    def _layers(self, grid: Grid, level: float) -> Layers:
        """The pressures of the regions that lie across the domain and have the pressure of the first one."""
        first, forces = self.fluid.regions[0].state, enumerate(self.model.body_force.acceleration)
        ((axis, force),) = [(axis, of_kind(float, force)) for axis, force in forces if force != 0.0]
        middle = [np.array([0.5 * (a + b)]) for a, b in zip(grid.lower, grid.upper, strict=True)][: grid.dimensions]
        middle[axis] = grid.lower[axis] + (np.arange(grid.cells[axis]) + 0.5) * grid.spacing[axis]
        centers, spacing = tuple(middle), grid.spacing[: grid.dimensions]
        across = [
            (region.state, 1.0 if region.shape is None else cell_fractions(region.shape, centers, spacing).ravel())
            for region in self.fluid.regions
            if region.state.pressure == first.pressure and is_layer(region.shape, axis, grid)
        ]

        def densities_of(pressures: np.ndarray) -> np.ndarray:
            found = np.zeros_like(pressures)
            for state, part in across:
                masses = self._at_pressures(state, pressures)[: self.model.phases]
                found = part * masses.sum(axis=0) + (1.0 - part) * found
            return found

        return Layers.at_rest(grid, (axis, force), level, first.pressure, densities_of)

    def _pressure(self, U: np.ndarray) -> np.ndarray:
        return self._primitives(U)[self.model.phases + self.model.dimensions]

    def _alike(self, new: np.ndarray, old: np.ndarray) -> np.ndarray:
        """Where two states have one pressure."""
        pressure, other = self._pressure(new), self._pressure(old)
        return np.abs(pressure - other) <= ALIKE * np.abs(other)

    def _mixed(self, new: np.ndarray, old: np.ndarray, part: float) -> np.ndarray:
        """State (variables,) of a cell of which a `part` holds one state and the rest another. At one pressure and the
        density of its region, a material that came from a high pressure would be colder than cold."""
        states, shares = (new, old), np.array((part, 1.0 - part))
        primitives = [self._primitives(U) for U in states]
        lowest, U = min(float(self._pressure(state)) for state in states), shares @ np.array(states)
        energies = shares @ np.array([self._energies(W) for W in primitives])
        P, at = self.model.phases, self.model.fraction
        fractions = (*U[at : at + P - 1], 1.0 - U[at : at + P - 1].sum())
        densities = [m / a for m, a in zip(U[:P], fractions, strict=True)]
        references = [reference(rho)[0] for reference, rho in zip(self._references, densities, strict=True)]
        omegas = [omega(rho)[0] for omega, rho in zip(self._omegas, densities, strict=True)]
        excess = [
            omega * energy - a * (lowest - reference)
            for omega, energy, a, reference in zip(omegas, energies, fractions, references, strict=True)
        ]
        if P == 2:
            U[at] += self._change_of_two(lowest, U, references, excess)
        else:
            changes = self._changes_of_many(lowest, U[:P], fractions, references, excess)
            U[at : at + P - 1] = self._bounded(tuple(a + change for a, change in zip(fractions, changes, strict=True)))
        return U

    def _change_of_two(self, lowest: float, U: np.ndarray, references: list[float], excess: list[float]) -> float:
        """Change of the volume fraction of a state (variables,) at which two phases have one pressure."""
        halved_range, range_of_change = self._to_the_end
        found = self._before(lowest, U[self.model.fraction], 0.0, U[0], U[1], *references, *excess)
        change, settled = self._relaxed(found)
        if settled < 0.0:
            low, high = range_of_change(found)
            for _ in range(HALVINGS):
                low, high = halved_range(found, low, high)
            change = 0.5 * (low + high)
        return float(change)

    def _changes_of_many(
        self,
        lowest: float,
        masses: np.ndarray,
        fractions: tuple[float, ...],
        references: list[float],
        excess: list[float],
    ) -> tuple[float, ...]:
        """Changes of the volume fractions at which more phases have one pressure."""
        still = (0.0,) * len(fractions)
        found = self._before(lowest, fractions, still, tuple(masses), tuple(references), tuple(excess))
        changes, settled = self._relaxed(found)
        if settled < 0.0:
            (to_the_end,) = self._to_the_end
            changes = to_the_end(found)
        return tuple(changes)

    def at(self, positions: np.ndarray) -> np.ndarray:
        """States (variables, n) at points (n, D) [m]."""
        states = np.empty((self.model.variables, len(positions)))
        for region in self.fluid.regions:
            inside = np.full(len(positions), True) if region.shape is None else contains(region.shape, positions)
            of_region = self._states(region.state)
            if self.layers is not None and of_region.shape[1] > 1:
                of_region = of_region[:, self.layers.index(positions[inside])]
            states[:, inside] = of_region
        return states

    def _fractions(self, state: FluidState) -> tuple[float, ...]:
        """Volume fractions of all phases but the last in a region of `state`."""
        P, given = self.model.phases, state.volume_fraction
        other = self.fluid.minimum_volume_fraction if given is None else 1.0 - given
        whole = 1.0 - (P - 1) * other
        found = tuple(whole if k == state.phase else other for k in range(P - 1))
        return found if P < 3 else tuple(self._bounded(found))

    def _beside(self, other: int, state: FluidState, pressures: np.ndarray) -> np.ndarray:
        """Densities (n,) of another phase in a region of `state`, at pressures (n,)."""
        known = self._products() if self._is_explosive(other) else self._first_state(other)
        if known is None:
            return np.full(pressures.shape, self._warm_density(other, state))
        return self._on_isentrope(other, known, pressures)

    def _warm_density(self, other: int, state: FluidState) -> float:
        """Density of a phase that the scene has nowhere: at the pressure of a state it is not colder than cold."""
        eos = self.model.eos[other]
        density = min(state.density, 0.5 * eos.maximum_density)
        while eos.cold_curve(density)[0] > WARM * max(state.pressure, 0.0) > 0.0:
            density *= 0.5
        return density

    def _first_state(self, phase: int) -> FluidState | None:
        """That the scene gives for a phase."""
        return next((region.state for region in self.fluid.regions if region.state.phase == phase), None)

    def _is_explosive(self, phase: int) -> bool:
        return self.fluid.detonation is not None and self.fluid.detonation.phase == phase

    def _products(self) -> FluidState:
        """Of the explosive, burnt at its own density: what traces of it in other matter come from. As much of the dense
        explosive itself would be heavier than many a charge."""
        detonation = present(self.fluid.detonation)
        burn, eos = detonation.burn, self.fluid.phases[detonation.phase].eos
        p = pressure(eos, burn.density, burn.energy)
        return FluidState(detonation.phase, burn.density, p, (0.0,) * self.model.dimensions)

    def _on_isentrope(self, phase: int, known: FluidState, pressures: np.ndarray) -> np.ndarray:
        """Densities (n,) at which a phase reaches `pressures` (n,) along the isentrope through a known state:
        d rho/dp = 1/c^2."""
        if np.all(pressures == known.pressure):
            return np.full(pressures.shape, known.density)  # without the time that the integrator's import takes
        from scipy.integrate import solve_ivp

        reference_of, omega_of = self._references[phase], self._omegas[phase]

        def slope(p: float, rho: np.ndarray) -> list[float]:
            (reference, gradient), (omega, omega_slope) = reference_of(rho[0]), omega_of(rho[0])
            weight = 1.0 + rho[0] * omega_slope / omega
            return [1.0 / (gradient + (weight * (p - reference) + omega * p) / rho[0])]

        found, wanted = np.full(pressures.shape, known.density), np.unique(pressures)
        for way in (wanted[wanted > known.pressure], wanted[wanted < known.pressure][::-1]):
            if not way.size:
                continue
            path = solve_ivp(
                slope, (known.pressure, way[-1]), [known.density], method="LSODA", t_eval=way, rtol=1e-9, atol=1e-12
            )
            reached = dict(zip(way.tolist(), path.y[0].tolist(), strict=False))
            on_way = pressures > known.pressure if way[-1] > known.pressure else pressures < known.pressure
            found[on_way] = [reached.get(p, np.nan) for p in pressures[on_way].tolist()]
        return found
