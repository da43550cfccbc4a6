"""The fluid: its state on this rank's blocks, and what one Runge-Kutta stage does to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from distfsi.device import cpu
from distfsi.errors import Diverged
from distfsi.kernels import fluid as kernels
from distfsi.kernels.regions import copy_regions
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.exchange import GhostExchange
from distfsi.parts.initial import InitialState
from distfsi.scene.description import Scene


@dataclass(frozen=True)
class Stage:
    """One stage of a Runge-Kutta method: U_new = U_n + b (U - dt D(U) - U_n); `weight`: its share in the whole step."""

    number: int
    b: float
    weight: float


SSP_RK3 = (Stage(0, 1.0, 1.0 / 6.0), Stage(1, 0.25, 1.0 / 6.0), Stage(2, 2.0 / 3.0, 2.0 / 3.0))  # paper, Eq. 16
LAST = len(SSP_RK3) - 1


class Fluid:
    """Compressible flow on the blocks of this rank.

    state: (local blocks, variables, Z, Y, X) at the present time, ghosts included; replaced by another buffer in every
    step.
    """

    def __init__(self, scene: Scene, model, blocks: Blocks, team: cpu.Team):
        self.model, self.blocks, self.team = model, blocks, team
        self.exchange = GhostExchange(blocks, cpu.build([copy_regions], {}).copy_regions)
        real = scene.fluid.precision
        self.kernels = cpu.build(
            [kernels.advance_tiles, kernels.fastest_signals], model.constants, model.bindings, real
        )
        self._buffers = [blocks.allocate(model.variables, np.dtype(real).type) for _ in range(3)]
        initial = InitialState(scene.fluid, model)
        self.inflow = self._inflow_states(scene, initial)
        for buffer in self._buffers:
            buffer[:] = initial.of(scene.fluid.regions[0].state)[:, None, None, None]
        initial.paint(blocks, self.state)
        self._lay_tiles(scene.performance.tile_cells)
        self._fastest = np.zeros(blocks.local_count)

    def _inflow_states(self, scene: Scene, initial: InitialState) -> np.ndarray:
        states = np.zeros((3, 2, self.model.variables))
        for axis, sides in enumerate(scene.fluid.inflow):
            for side, state in enumerate(sides):
                if state is not None:
                    states[axis, side] = initial.of(state)
        return states

    def _lay_tiles(self, tile_cells: tuple[int, ...]) -> None:
        """Cut the blocks into tiles; those whose ghosts come from other ranks are computed last."""
        blocks, grid = self.blocks, self.blocks.grid
        size = [min(t, n) for t, n in zip((*tile_cells, 1, 1)[:3], blocks.block_cells, strict=True)]
        rows = []
        for block in range(blocks.local_count):
            extent, origin = blocks.extent[block], blocks.origin[block]
            starts = [range(0, extent[axis], size[axis]) for axis in range(3)]
            for z in starts[2]:
                for y in starts[1]:
                    for x in starts[0]:
                        first = np.array([x, y, z])
                        cells = np.minimum(size, extent - first)
                        rows.append([block, *(first + grid.ghosts), *cells, self._sides(origin + first, cells)])
        self.tiles = np.array(rows, dtype=np.int64).reshape(-1, 8)
        waiting = np.isin(self.tiles[:, kernels.BLOCK], self.exchange.waiting)
        self._ready_tiles, self._waiting_tiles = np.flatnonzero(~waiting), np.flatnonzero(waiting)
        self._tile_box = tuple(n + 2 * g for n, g in zip(size, grid.ghosts, strict=True))
        self._through = np.zeros((len(self.tiles), 6, self.model.conserved))

    def _sides(self, first: np.ndarray, cells: np.ndarray) -> int:
        """Bits of the domain's sides that a tile touches; a periodic side is no side."""
        grid, bits = self.blocks.grid, 0
        for axis in range(grid.dimensions):
            for side, touches in enumerate((first[axis] == 0, first[axis] + cells[axis] == grid.cells[axis])):
                if touches and grid.boundaries[axis][side] != "periodic":
                    bits |= 1 << (2 * axis + side)
        return bits

    # ---- one step ----------------------------------------------------------------------------------------------------

    @property
    def state(self) -> np.ndarray:
        return self._buffers[0]

    def input_of(self, stage: Stage) -> np.ndarray:
        """The state that a stage starts from."""
        return self._buffers[stage.number]

    def exchange_ghosts(self, stage: Stage) -> None:
        """Fill the ghost cells of the stage's input."""
        self.exchange.start(self.input_of(stage), self.model.mirror, self.inflow)
        self.exchange.finish()

    def advance_stage(self, stage: Stage, dt: float) -> None:
        """Exchange ghosts and advance one stage; tiles that need no other rank are computed while messages travel."""
        self.exchange.start(self.input_of(stage), self.model.mirror, self.inflow)
        self.advance_tiles(self._ready_tiles, stage, dt)
        self.exchange.finish()
        self.advance_tiles(self._waiting_tiles, stage, dt)
        if stage.number == LAST:
            a, b, c = self._buffers
            self._buffers = [b, a, c]

    def advance_tiles(self, tiles: np.ndarray, stage: Stage, dt: float) -> None:
        """Advance the tiles of the given numbers by one stage."""
        output = self._buffers[1 if stage.number == LAST else stage.number + 1]
        real = output.dtype.type
        rates = (real(dt / h) for h in self.blocks.grid.spacing)
        self.team.run(
            self.kernels.advance_tiles, len(tiles), tiles, self.tiles, self.state, self.input_of(stage), output,
            self._through, real(stage.b), real(dt), stage.weight, *rates, *self._tile_box,
        )  # fmt: skip

    def fastest_signal(self) -> float:
        """Largest sum over axes of (|u| + c)/h [1/s] on this rank: CFL number per time step. NaN when a cell has no
        finite state."""
        if not self.blocks.local_count:
            return 0.0
        real = self.state.dtype.type
        inverse = (real(1.0 / h) for h in self.blocks.grid.spacing)
        self.team.run(
            self.kernels.fastest_signals, self.blocks.local_count, self.state, self._first_active(),
            self.blocks.extent, *inverse, self._fastest,
        )  # fmt: skip
        return float(np.max(self._fastest))

    def _first_active(self) -> int:
        gx, gy, gz = self.blocks.grid.ghosts
        _, size_y, size_x = self.blocks.shape
        return (gz * size_y + gy) * size_x + gx

    # ---- looking at it -----------------------------------------------------------------------------------------------

    def cells(self, block: int) -> np.ndarray:
        """View (variables, z, y, x) of the active cells of a local block."""
        n, g = self.blocks.extent[block][::-1], self.blocks.grid.ghosts[::-1]
        return self.state[(block, slice(None), *(slice(a, a + b) for a, b in zip(g, n, strict=True)))]

    def state_to_save(self) -> dict[str, dict[str, np.ndarray]]:
        """What a restart file holds of the fluid; views, not copies."""
        g, n = self.blocks.grid.ghosts[::-1], self.blocks.block_cells[::-1]
        whole_blocks = tuple(slice(a, a + b) for a, b in zip(g, n, strict=True))
        return {"cells": {"state": self.state[(..., *whole_blocks)]}, "sums": {"through": self._through}}

    def restore(self, saved: Mapping[str, Mapping[str, np.ndarray]]) -> None:
        """Continue from what `state_to_save` gave, on this rank's blocks."""
        for block in range(self.blocks.local_count):
            z, y, x = self.blocks.extent[block][::-1]
            self.cells(block)[:] = saved["cells"]["state"][block, :, :z, :y, :x]
        self._through[:] = saved["sums"]["through"]

    def memory(self) -> int:
        """Bytes of this rank's fields."""
        return sum(buffer.nbytes for buffer in self._buffers)

    def totals(self, covered: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Masses, momentum and energy (conserved,) of all ranks' cells, and the sums of their absolute values.

        Cells that are `covered` (local blocks, Z, Y, X) are left out.
        """
        sums = np.zeros((self.blocks.local_count, 2, self.model.conserved))
        for block in range(self.blocks.local_count):
            cells = self.cells(block)[: self.model.conserved].astype(np.float64)
            if covered is not None:
                cells = np.where(self._active(covered, block), 0.0, cells)
            sums[block] = cells.sum(axis=(1, 2, 3)), np.abs(cells).sum(axis=(1, 2, 3))
        sums *= self._cell_volume()
        totals = self.blocks.sum(sums.reshape(len(sums), -1))
        return totals[: self.model.conserved], totals[self.model.conserved :]

    def left_domain(self) -> np.ndarray:
        """What has left through the domain's sides so far (conserved,); a wall's impulse is momentum that left."""
        signed = self._through[:, 1::2].sum(axis=1) - self._through[:, 0::2].sum(axis=1)
        sums = np.zeros((self.blocks.local_count, self.model.conserved))
        np.add.at(sums, self.tiles[:, kernels.BLOCK], signed)
        return self.blocks.sum(sums * self._cell_volume())

    def outputs(self, covered: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """Fields for the output files: (local blocks, bz, by, bx[, 3]), padded to whole blocks, NaN where covered."""
        names = ["density", "velocity", "pressure"] + (["volume_fraction"] if self.model.phases == 2 else [])
        shape = (self.blocks.local_count, *self.blocks.block_cells[::-1])
        fields = {name: np.zeros((*shape, 3) if name == "velocity" else shape) for name in names}
        primitives, P, D = self.model.formula("primitives"), self.model.phases, self.model.dimensions
        for block in range(self.blocks.local_count):
            U = self.cells(block).astype(np.float64)
            W = primitives(U)
            z, y, x = U.shape[1:]
            values = {"density": U[:P].sum(axis=0), "pressure": W[P + D], "volume_fraction": U[-1]}
            for name in names:
                part = fields[name][block, :z, :y, :x]
                if name == "velocity":
                    part[..., :D] = np.stack(W[P : P + D], axis=-1)
                else:
                    part[:] = values[name]
                if covered is not None:
                    part[self._active(covered, block)] = np.nan
        return fields

    def check(self, time: float) -> None:
        """Raise Diverged with place, time and state when a cell of this rank has no valid state."""
        if not self.blocks.local_count:
            return
        block = int(np.argmax(~np.isfinite(self._fastest)))
        with np.errstate(all="ignore"):
            W = np.stack(self.model.formula("primitives")(self.cells(block).astype(np.float64)))
            c = np.asarray(self.model.formula("sound_speed")(tuple(W)))
        bad = np.argwhere(~np.isfinite(c) | ~np.isfinite(W).all(axis=0))
        if not len(bad):
            return
        z, y, x = bad[0]
        position = [centers[i] for centers, i in zip(self.blocks.cell_centers(block), (x, y, z), strict=True)][
            : self.model.dimensions
        ]
        values = ", ".join(f"{value:.6g}" for value in W[:, z, y, x])
        place = ", ".join(f"{value:.6g}" for value in position)
        raise Diverged(
            f"the fluid has no valid state at t = {time:.6g} s in the cell at ({place}) m: primitives ({values})"
        )

    def _active(self, field: np.ndarray, block: int) -> np.ndarray:
        n, g = self.blocks.extent[block][::-1], self.blocks.grid.ghosts[::-1]
        return field[(block, *(slice(a, a + b) for a, b in zip(g, n, strict=True)))].astype(bool)

    def _cell_volume(self) -> float:
        return float(np.prod(self.blocks.grid.spacing[: self.model.dimensions]))
