"""The fluid's state before the first step: regions painted over each other, cell by cell."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from distfsi.device.emit import plain
from distfsi.fluid.formulas import relaxation, six_equation
from distfsi.fluid.kernels.rows import HALVINGS
from distfsi.fluid.mapping import Mapping
from distfsi.fluid.model import FluidModel
from distfsi.mesh.blocks import Blocks
from distfsi.narrowing import present
from distfsi.scene.description import Fluid, FluidState, Shape
from distfsi.scene.fractions import Filled, cell_fractions, corrected
from distfsi.scene.shapes import bounding_box, contains, volume_within
from distfsi.scene.thermodynamics import pressure

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
    """Conserved states of the scene's regions, for one or two phases.

    A region is one phase. With two phases the other one is present in it, too, as much as the region's state says or as
    a trace of `minimum_volume_fraction`, at the same pressure, on the isentrope through the first state the scene gives
    for it.
    """

    def __init__(self, fluid: Fluid, model: FluidModel):
        self.fluid, self.model = fluid, model
        self._conserved, self._primitives = (model.formula(name) for name in ("conserved", "primitives"))
        self._references, self._omegas = (
            [model.formula(f"{name}_{k + 1}") for k in range(model.phases)] for name in ("reference", "grueneisen")
        )
        if model.phases == 2:
            formulas = (six_equation.phase_energies, relaxation.phases_before, relaxation.relaxed_fraction_change)
            self._energies, self._before, self._change, self._range, self._halved = (
                plain(formula, model.constants, model.bindings)
                for formula in (*formulas, relaxation.range_of_change, relaxation.halved_range)
            )

    def of(self, state: FluidState) -> np.ndarray:
        """Conserved state (variables,) of a region or an inflow."""
        densities = [state.density] if self.model.phases == 1 else self._densities(state)
        fraction = [] if self.model.phases == 1 else [self._fraction(state)]
        shares = [1.0 if state.phase == self.model.constants["CARRIER"] else 0.0] * len(self.model.carried)
        return np.array(self._conserved((*densities, *state.velocity, state.pressure, *fraction, *shares)), dtype=float)

    def paint(self, blocks: Blocks, field: np.ndarray, mapping: Mapping | None = None) -> None:
        """Collective. Fill the active cells of `field` (local blocks, variables, Z, Y, X). A cell that a region covers
        in part holds that part of the region's mass, momentum and energy; two materials have come to one pressure in
        it. What is mapped comes over the first region."""
        ghosts = blocks.grid.ghosts[::-1]
        for number, region in enumerate(self.fluid.regions):
            state = self.of(region.state)
            parts = (
                [np.ones((1, 1, 1))] * blocks.local_count if region.shape is None else fractions(blocks, region.shape)
            )
            for block, part in enumerate(parts):
                active = (slice(g, g + n) for g, n in zip(ghosts, blocks.extent[block][::-1], strict=True))
                where: tuple[Any, ...] = (block, slice(None), *active)
                if part is not None:
                    self._lay_over(field[where], state, part)
                if mapping and number == 0:
                    mapping.apply(block, field[where])
        if mapping:
            mapping.sum_up()

    def _lay_over(self, cells: np.ndarray, state: np.ndarray, part: np.ndarray) -> None:
        """Let a region of `state` (variables,) fill a `part` (z, y, x) of each of `cells` (variables, z, y, x)."""
        new = state[:, None, None, None]
        mixed = part * new + (1.0 - part) * cells
        if self.model.phases == 2:
            cut = np.argwhere((part > 0.0) & (part < 1.0))
            alike = self._alike(state[:, None], cells[:, *cut.T])
            for at in map(tuple, cut[~alike]):
                mixed[:, *at] = self._mixed(state, cells[:, *at], part[at])
        cells[:] = np.where(part == 1.0, new, np.where(part == 0.0, cells, mixed))

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
        lowest, U = min(self._pressure(state) for state in states), shares @ np.array(states)
        energies = shares @ np.array([self._energies(W) for W in primitives])
        at = self.model.fraction
        fractions = (U[at], 1.0 - U[at])
        densities = [m / a for m, a in zip(U[:2], fractions, strict=True)]
        references = [reference(rho)[0] for reference, rho in zip(self._references, densities, strict=True)]
        omegas = [omega(rho)[0] for omega, rho in zip(self._omegas, densities, strict=True)]
        excess = [
            omega * energy - a * (lowest - reference)
            for omega, energy, a, reference in zip(omegas, energies, fractions, references, strict=True)
        ]
        phases = self._before(lowest, U[at], 0.0, U[0], U[1], *references, *excess)
        change, settled = self._change(phases)
        if settled < 0.0:
            low, high = self._range(phases)
            for _ in range(HALVINGS):
                low, high = self._halved(phases, low, high)
            change = 0.5 * (low + high)
        U[at] += change
        return U

    def at(self, positions: np.ndarray) -> np.ndarray:
        """States (variables, n) at points (n, D) [m]."""
        states = np.empty((self.model.variables, len(positions)))
        for region in self.fluid.regions:
            inside = np.s_[:] if region.shape is None else contains(region.shape, positions)
            states[:, inside] = self.of(region.state)[:, None]
        return states

    def _fraction(self, state: FluidState) -> float:
        given = state.volume_fraction
        other = self.fluid.minimum_volume_fraction if given is None else 1.0 - given
        return 1.0 - other if state.phase == 0 else other

    def _densities(self, state: FluidState) -> list[float]:
        other = 1 - state.phase
        known = self._products() if self._is_explosive(other) else self._first_state(other)
        alone = min(state.density, 0.5 * self.model.eos[other].maximum_density)
        trace = alone if known is None else self._on_isentrope(other, known, state.pressure)
        return [state.density, trace] if state.phase == 0 else [trace, state.density]

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

    def _on_isentrope(self, phase: int, known: FluidState, pressure: float) -> float:
        """Density at which a phase reaches `pressure` along the isentrope through a known state: d rho/dp = 1/c^2."""
        from scipy.integrate import solve_ivp

        reference_of, omega_of = self._references[phase], self._omegas[phase]

        def slope(p: float, rho: np.ndarray) -> list[float]:
            (reference, gradient), (omega, omega_slope) = reference_of(rho[0]), omega_of(rho[0])
            weight = 1.0 + rho[0] * omega_slope / omega
            return [1.0 / (gradient + (weight * (p - reference) + omega * p) / rho[0])]

        if pressure == known.pressure:
            return known.density
        path = solve_ivp(slope, (known.pressure, pressure), [known.density], method="LSODA", rtol=1e-9, atol=1e-12)
        return float(path.y[0, -1])
