"""The fluid: its state on this rank's blocks, and what one Runge-Kutta stage does to it."""

from __future__ import annotations

from typing import Any

import numpy as np

from distfsi.device.interface import Device, DualArray
from distfsi.errors import Diverged
from distfsi.fluid import fields
from distfsi.fluid.force import GivenByForce
from distfsi.fluid.hydrostatics import WeighedGhosts
from distfsi.fluid.incoming import Incoming
from distfsi.fluid.initial import InitialState
from distfsi.fluid.kernels.records import StageTimes, States
from distfsi.fluid.kernels.signals import fastest_signals
from distfsi.fluid.kernels.stage import advance_tiles
from distfsi.fluid.mapping import Mapping
from distfsi.fluid.metrics import Metrics
from distfsi.fluid.model import FluidModel
from distfsi.fluid.reactions import Reactions
from distfsi.fluid.rest import Rest
from distfsi.fluid.stages import SCHEMES, Stage
from distfsi.fluid.tiles import Tiling
from distfsi.mesh.blocks import Blocks, Snapshot
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.kernels.regions import copy_regions
from distfsi.narrowing import present
from distfsi.scene.description import Scene


def _output(number: int) -> int:
    """Which buffer a stage writes: 1 and 2 in turn, never the one it reads nor the state before the step."""
    return 1 + number % 2


class Fluid:
    """Compressible flow on the blocks of this rank.

    state: (local blocks, variables, Z, Y, X) at the present time, ghosts included; replaced by another buffer in every
    step. stages: those that make a step. force: what the body force has given, if there is one. ready_tiles,
    waiting_tiles: numbers of the tiles that need no other rank's cells; of the others. mapping: what another run has
    left here, if this one goes on from it.
    """

    def __init__(self, scene: Scene, model: FluidModel, blocks: Blocks, device: Device, resumed: bool = False):
        """`resumed`: its state will be that of a snapshot, so nothing is mapped."""
        self.model, self.blocks, self.device = model, blocks, device
        self.stages = SCHEMES[scene.time.scheme]
        self.exchange = GhostExchange(blocks, device, device.build([copy_regions], {}).copy_regions)
        given = present(scene.fluid)
        real = given.precision
        self.kernels = device.build([advance_tiles, fastest_signals], model.constants, model.bindings, real)
        buffers = [blocks.allocate(model.variables, np.dtype(real).type) for _ in range(3)]
        initial = InitialState(given, model, blocks.grid)
        self._incoming = Incoming(given, initial, model.variables)
        for buffer in buffers:
            buffer[:] = initial.of(given.regions[0].state)[:, None, None, None]
        self.mapping = Mapping(given.map, scene, blocks) if given.map and not resumed else None
        initial.paint(blocks, buffers[0], self.mapping)
        self._buffers = [DualArray(device, buffer) for buffer in buffers]
        self.metrics = Metrics(blocks, real)
        sizes = device.tile_cells(scene.performance.tile_cells)
        self.tiling = Tiling(blocks, device, sizes, model.conserved, self.metrics)
        self.rest = Rest(blocks, self.tiling.first, self.tiling.size)
        waiting = np.isin(self.tiling.block, self.exchange.waiting)  # for ghosts from other ranks
        self.ready_tiles, self.waiting_tiles = np.flatnonzero(~waiting), np.flatnonzero(waiting)
        self._stages, self._calm = device.array(self.rest.stages), device.array(self.rest.calm)
        self._grid = blocks.grid_on(device)
        self._fastest = DualArray(device, np.zeros(blocks.local_count))
        forced = bool(model.constants["HYDROSTATIC"])
        self.force = GivenByForce(blocks, device, model, self.metrics, real) if forced else None
        self._weighed = WeighedGhosts(blocks, self.exchange, device, model, real) if forced else None
        self._before = [pair.host().copy() for pair in self._accounts]
        self._signal: float | None = None
        self._volumes = DualArray(device, np.ones((1, 1, 1, 1, 1), real))
        self.rejected_steps = 0
        self.reactions = Reactions(scene, model, blocks, device) if model.carried else None

    # ---- one step ----------------------------------------------------------------------------------------------------

    @property
    def inflow(self) -> np.ndarray:
        """States (3, 2, variables) that come in through the ends."""
        return self._incoming.states

    @property
    def state(self) -> np.ndarray:
        return self._buffers[0].host()

    @property
    def device_state(self) -> Any:
        """The state at the present time on the device."""
        return self._buffers[0].device

    def changed(self) -> None:
        """The state on the host has been changed."""
        self._buffers[0].changed()

    @property
    def previous(self) -> Any:
        """The state before the last step on the device, until the next one begins."""
        return self._buffers[1].read

    def input_of(self, stage: Stage) -> Any:
        """The state that a stage starts from, on the device."""
        return self._buffers[0 if stage.number == 0 else _output(stage.number - 1)].device

    def output_of(self, stage: Stage) -> Any:
        """Where a stage leaves its state; asked before the stage."""
        return self._buffers[_output(stage.number)].device

    def average_sources(self, start: float, dt: float) -> None:
        """From now on the body force is its mean over a step of `dt` [s] from `start` [s] on, and what comes in has the
        state of its middle."""
        self._incoming.set_time(start + 0.5 * dt)
        if self.model.body_force.average_over(start, dt):
            self.rest.wake()

    def set_volumes(self, volumes: DualArray) -> None:
        """From now on fluid fills cells in part: by the first of the fields (local blocks, fields, Z, Y, X), which who
        gives them changes between stages. By default all cells are whole."""
        self._volumes = volumes

    def begin_step(self) -> None:
        """Remember what `reject` must bring back besides the state."""
        self._before = [pair.host().copy() for pair in self._accounts]
        self._signal = None

    def reject(self) -> None:
        """Go back to the state before the last step."""
        self._buffers[:2] = self._buffers[1::-1]
        for pair, before in zip(self._accounts, self._before, strict=True):
            pair.host()[:] = before
            pair.changed()
        self.rejected_steps += 1
        self._signal = None
        self.rest.wake()

    def is_valid(self) -> bool:
        """Collective. Whether all cells of all ranks have a valid state."""
        self._signal = self.fastest_signal()
        return bool(np.isfinite(self.blocks.communicator.maximum(np.array([self._signal]))[0]))

    @property
    def _accounts(self) -> list[DualArray]:
        """What has left through the domain's sides, how many faces were limited, and what the body force has given."""
        force = [self.force.sums] if self.force else []
        return [self.tiling.through, self.tiling.limited, *force]

    def start_exchange(self, stage: Stage) -> None:
        """Start to fill the ghost cells of the stage's input; `finish_exchange` ends it."""
        self._filled = self.input_of(stage)
        self.exchange.start(self._filled, self.model.mirror, self.inflow)
        if self._weighed:
            self._weighed.weigh(self._filled, waiting=False)

    def finish_exchange(self) -> None:
        """Fill the ghost cells that wait for other ranks."""
        self.exchange.finish()
        if self._weighed:
            self._weighed.weigh(self._filled, waiting=True)

    def exchange_ghosts(self, stage: Stage) -> None:
        """Fill the ghost cells of the stage's input."""
        self.start_exchange(stage)
        self.finish_exchange()

    def account_force(self, stage: Stage, dt: float) -> None:
        """Account for what the body force gives in a stage of a step of `dt` [s]; before the stage."""
        if self.force:
            self.force.account(self.input_of(stage), self._volumes.read, self._grid, stage.weight * dt)

    def begin_stage(self) -> None:
        """Find out which tiles are at rest."""
        self.rest.begin_stage()
        self._stages, self._calm = self.device.array(self.rest.stages), self.device.array(self.rest.calm)

    def end_stage(self, stage: Stage) -> None:
        """After all tiles were advanced; after the last stage the state is that of the new time."""
        self.rest.stages = self.device.download(self._stages)
        self.rest.end_stage()
        if stage is self.stages[-1]:
            new = self._buffers.pop(_output(stage.number))
            self._buffers.insert(0, new)

    def advance_tiles(self, tiles: np.ndarray, stage: Stage, dt: float) -> None:
        """Advance the tiles of the given numbers by one stage; those that are calm only if their fluxes are accounted
        for."""
        tiles = tiles[~self.rest.calm[tiles] | self.tiling.touches_side[tiles]]
        output = self._buffers[_output(stage.number)]
        states = States(self._buffers[0].device, self.input_of(stage), output.device, self._volumes.device)
        times = StageTimes(output.dtype.type(stage.b), dt, stage.weight)
        given = self.tiling.arguments(self._calm, self._stages)
        chosen = self.device.array(tiles)
        self.device.run(self.kernels.advance_tiles, len(tiles), chosen, given, states, times, self.tiling.box)

    def wake(self, blocks: np.ndarray) -> None:
        """Something else than a stage has written into cells of the local blocks where `blocks` (local blocks,) is
        true; to be called before the next stage."""
        self.rest.wake(blocks[self.tiling.block])
        self._signal = None

    def fastest_signal(self) -> float:
        """Largest sum over axes of (|u| + c)/h [1/s] on this rank: CFL number per time step. NaN when a cell has no
        valid state."""
        if self._signal is not None:
            return self._signal
        if not self.blocks.local_count:
            return 0.0
        changed = np.unique(self.tiling.block[~self.rest.settled])
        given = self.device.array(changed), self._buffers[0].device, self._fastest.device, self._grid
        self.device.run(self.kernels.fastest_signals, len(changed), *given)
        return float(np.max(self._fastest.host()))

    @property
    def signals(self) -> np.ndarray:
        """(local blocks,) the last fastest signal [1/s] of each block."""
        return self._fastest.host()

    def fastest_cell(self, signals: np.ndarray) -> tuple[float, tuple[int, ...], str]:
        """The fastest of `signals`, those of this rank's blocks before the last step, where its block begins in the
        grid, and its cell in words. Of equal ones that whose block comes last along z, y, x."""
        if not self.blocks.local_count:
            return 0.0, (), ""
        block = int(np.lexsort((*self.blocks.origin.T, signals))[-1])
        before = self.device.download(self.previous[block : block + 1])[(0, *self._inside(block))]
        speeds = fields.speeds(self.model, before.astype(np.float64))
        signal = sum(speed / h for speed, h in zip(speeds, self.blocks.spacing[block], strict=False))
        cell = np.unravel_index(np.nanargmax(signal), signal.shape)
        position = self._position(block, cell)
        text = f"{max(speed[cell] for speed in speeds):.4g} m/s at ({position}) m"
        return float(signals[block]), tuple(self.blocks.origin[block, ::-1].tolist()), text

    def _position(self, block: int, cell: tuple[Any, ...]) -> str:
        """The center of the cell (z, y, x) of a local block, in words."""
        centers = zip(self.blocks.cell_centers(block), cell[::-1], strict=True)
        return ", ".join(f"{along[i]:.6g}" for along, i in list(centers)[: self.model.dimensions])

    # ---- looking at it -----------------------------------------------------------------------------------------------

    def cells(self, block: int) -> np.ndarray:
        """View (variables, z, y, x) of the active cells of a local block."""
        return self.active(self.state, block)

    def snapshot(self) -> Snapshot:
        """What a restart needs."""
        return {
            "cells": {"state": self.blocks.without_ghosts(self.state)},
            "sums": {
                "through": self.tiling.through.host(),
                "limited": self.tiling.limited.host().astype(np.float64),
                "rested": self.rest.counts[None],
                **({"force": self.force.sums.host()} if self.force else {}),
            },
            "values": {"rejected_steps": np.array(self.rejected_steps)},
        }

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot."""
        self.blocks.without_ghosts(self.state)[:] = snapshot["cells"]["state"]
        self.tiling.through.host()[:] = snapshot["sums"]["through"]
        self.tiling.limited.host()[:] = snapshot["sums"]["limited"]
        if self.force:
            self.force.sums.host()[:] = snapshot["sums"]["force"]
        for pair in (self._buffers[0], *self._accounts):
            pair.changed()
        self.rest.counts[:] = snapshot["sums"]["rested"].sum(axis=0)
        self.rejected_steps, self._signal = int(snapshot["values"]["rejected_steps"]), None
        self.rest.wake()

    def workload(self) -> np.ndarray:
        """(local blocks,) cells that a stage computes."""
        cells = self.tiling.cells * ~self.rest.settled
        return np.bincount(self.tiling.block, cells, self.blocks.local_count).astype(float)  # of no tiles: integers

    def memory(self) -> int:
        """Bytes of this rank's fields."""
        return sum(buffer.nbytes for buffer in self._buffers)

    def limited_faces(self) -> int:
        """Collective. How many faces had their flux limited so far, over all stages; those at the high sides of the
        domain are not counted."""
        return int(self.blocks.communicator.concatenate(self.tiling.limited.host()).sum())

    def share_at_rest(self) -> float:
        """Collective. The part of all tile stages in which the tile was at rest."""
        rested, everything = self.blocks.communicator.concatenate(self.rest.counts[None]).sum(axis=0)
        return rested / max(everything, 1)

    def totals(self, volume: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Masses, momentum and energy (conserved,) of all ranks' cells, and the sums of their absolute values.

        volume (local blocks, Z, Y, X): the part of each cell that fluid fills, by default all.
        """
        sums = self._contents(volume)
        totals = self.blocks.sum(sums.reshape(len(sums), 2 * self.model.conserved))
        return totals[: self.model.conserved], totals[self.model.conserved :]

    def _contents(self, volume: np.ndarray | None) -> np.ndarray:
        """Of each block (local blocks, 2, conserved) what totals() are of all."""
        sums = np.zeros((self.blocks.local_count, 2, self.model.conserved))
        for block in range(self.blocks.local_count):
            cells = self.cells(block)[: self.model.conserved].astype(np.float64)
            if volume is not None:
                part = self.active(volume, block).astype(np.float64)
                cells = np.where(part > 0.0, part * cells, 0.0)
            cells = self.metrics.weighted(cells, block)
            sums[block] = cells.sum(axis=(1, 2, 3)), np.abs(cells).sum(axis=(1, 2, 3))
        return sums * self._cell_volume()

    def held_energies(self) -> np.ndarray:
        """Collective. What each of the carried shares holds back in all ranks' cells (carried,) [J]."""
        first = self.model.variables - len(self.model.carried)
        shares = [
            self.metrics.weighted(self.cells(b)[first:].astype(np.float64), b).sum(axis=(1, 2, 3))
            for b in range(self.blocks.local_count)
        ]
        sums = np.reshape(shares, (self.blocks.local_count, len(self.model.carried)))
        return self.blocks.sum(sums * self._cell_volume()) * self.model.constants["HELD_ENERGY"]

    def leave(self, volume: np.ndarray) -> None:
        """All that the cells hold in this `volume` (local blocks, Z, Y, X) counts as having left the domain."""
        _, first = np.unique(self.tiling.block, return_index=True)
        self.tiling.through.host()[first, 1] += self._contents(volume)[:, 0] / self._cell_volume()
        self.tiling.through.changed()

    def left_domain(self) -> np.ndarray:
        """What has left through the domain's sides so far (conserved,); a wall's impulse is momentum that left."""
        through = self.tiling.through.host()
        signed = through[:, 1::2].sum(axis=1) - through[:, 0::2].sum(axis=1)
        sums = np.zeros((self.blocks.local_count, self.model.conserved))
        np.add.at(sums, self.tiling.block, signed)
        return self.blocks.sum(sums * self._cell_volume())

    def outputs(self, covered: np.ndarray | None = None, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """Fields for the output files: (local blocks, bz, by, bx[, 3]), padded to whole blocks, NaN where covered.

        `chosen`: the local blocks wanted, by default all.
        """
        chosen = np.arange(self.blocks.local_count) if chosen is None else chosen
        shape = (len(chosen), *self.blocks.block_cells[::-1])
        found = {name: np.zeros((*shape, 3) if name == "velocity" else shape) for name in fields.names(self.model)}
        for row, block in enumerate(chosen):
            U = self.cells(block).astype(np.float64)
            z, y, x = U.shape[1:]
            for name, values in fields.written(self.model, U).items():
                part = found[name][row, :z, :y, :x]
                part[:] = values
                if covered is not None:
                    part[self.active(covered, block)] = np.nan
        return found

    def check(self, time: float, covered: np.ndarray | None = None) -> None:
        """Raise Diverged with position, time and state when a cell of this rank, not `covered`, has no valid state."""
        for block in range(self.blocks.local_count):
            ignored = covered is not None and self.active(covered, block)
            invalid = fields.first_invalid(self.model, self.cells(block).astype(np.float64), ignored)
            if invalid is not None:
                where = f"at t = {time:.6g} s in the cell at ({self._position(block, invalid[0])}) m"
                raise Diverged(f"the fluid has no valid state {where}: {invalid[1]}")

    def active(self, field: np.ndarray, block: int) -> np.ndarray:
        """View (…, z, y, x) of the active cells of a local block in a field (local blocks, …, Z, Y, X)."""
        return field[(block, *self._inside(block))]

    def _inside(self, block: int) -> tuple[Any, ...]:
        """Where the active cells of a local block are in what is stored of it."""
        n, g = self.blocks.extent[block][::-1], self.blocks.grid.ghosts[::-1]
        return (..., *(slice(a, a + b) for a, b in zip(g, n, strict=True)))

    def _cell_volume(self) -> float:
        return float(np.prod(self.blocks.grid.spacing[: self.model.dimensions]))
