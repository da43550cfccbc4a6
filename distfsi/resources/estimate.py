"""What a run takes before it has begun: blocks, memory and bytes on disk of each rank, time by a kept bench."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from scipy import ndimage, optimize

from distfsi.fluid.model import fluid_model
from distfsi.fluid.stages import SSP_RK3
from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.laws.fluid.stiffened_gas import StiffenedGas
from distfsi.mesh.blocks import Blocks
from distfsi.mesh.communicator import Communicator
from distfsi.narrowing import present
from distfsi.resources.works import SMOOTHING
from distfsi.scene.description import Scene
from distfsi.scene.packing import pack
from distfsi.scene.signals import Layout, end_time, moving_share, steps, sub_steps
from distfsi.simulation import deal_blocks

PROCESS_BYTES = 140e6  # of a rank that has no blocks: Python and its libraries
KERNEL_BYTES = 102e6  # of numba and compiled kernels: of a fluid where there are blocks, of solids on all ranks
DRAWING_BYTES = 45e6  # of matplotlib, on the first rank
MAP_BYTES, CELLS_OF_MAPS = 65e6, 1e5  # of the maps of a fluid in the summary, and of how many cells they take as much
CUT_BYTES = 60e6  # of those in three dimensions
COUPLING_BYTES = 20e6  # of the compiled kernels of a coupling, per dimension
PARTICLE_BYTES = {  # at the peak, of the start or within a step, by dimensions
    "total_lagrangian": {1: 900.0, 2: 1060.0, 3: 4300.0},
    "updated_lagrangian": {1: 900.0, 2: 1250.0, 3: 2800.0},
}
FLOAT, VECTOR = 8, 24  # bytes of a value in a field file
PARTICLE_FILE_BYTES = 2 * VECTOR + 6 * FLOAT + 10 * FLOAT  # two vectors, stress, scalars, topology
SECONDS_TO_LOAD = 0.25  # what a process needs once, whatever it runs
SECONDS_PER_FILE, BYTES_PER_SECOND = 0.01, 5e8  # of writing


@dataclass(frozen=True)
class OneOfMany:
    """Stands for one rank of a run that does not take place."""

    rank: int
    size: int


class Resources:
    """What `scene` takes on so many `ranks`. Sizes in bytes."""

    def __init__(self, scene: Scene, ranks: int):
        self.scene, self.ranks = scene, ranks
        self.dimensions = scene.domain.dimensions
        bodies = scene.solid.bodies if scene.solid else ()
        self.positions = {body.name: pack(body, scene.domain.lower, scene.domain.upper)[0] for body in bodies}

    @cached_property
    def layout(self) -> Layout | None:
        """Of the fluid at the start."""
        return Layout(self.scene) if self.scene.fluid else None

    @cached_property
    def steps(self) -> int:
        """Time steps of the run."""
        return steps(self.scene, self.layout)

    @cached_property
    def blocks(self) -> list[Blocks]:
        """The blocks of each rank."""
        ranks = (cast(Communicator, OneOfMany(rank, self.ranks)) for rank in range(self.ranks))  # all that is asked
        return [deal_blocks(self.scene, rank) for rank in ranks]

    @property
    def cells(self) -> int:
        """Cells of the fluid, 0 without one."""
        return math.prod(self.scene.domain.cells) if self.scene.fluid else 0

    @property
    def particles(self) -> int:
        return sum(map(len, self.positions.values()))

    @cached_property
    def particles_of_ranks(self) -> np.ndarray:
        """(ranks,) particles of each rank at the start."""
        counts = np.zeros(self.ranks, dtype=np.int64)
        for positions in self.positions.values():
            owners = self.blocks[0].owners[self.blocks[0].block_of(positions)]
            counts += np.bincount(owners, minlength=self.ranks)
        return counts

    @cached_property
    def band_cells(self) -> int:
        """Cells of the fluid around the wall at the start, about: at most two away from one with particles, except
        those that have particles all around."""
        if not (self.cells and self.particles):
            return 0
        D, domain = self.dimensions, self.scene.domain
        spacing = (np.array(domain.upper) - domain.lower)[:D] / domain.cells[:D]
        cell = np.floor((np.concatenate(list(self.positions.values())) - domain.lower[:D]) / spacing).astype(int)
        first = cell.min(axis=0) - 2
        occupied = np.zeros(cell.max(axis=0) - first + 3, dtype=bool)
        occupied[tuple((cell - first).T)] = True
        around = np.ones((3,) * D, dtype=bool)
        band = ndimage.binary_dilation(occupied, around, 2) & ~ndimage.binary_erosion(occupied, around)
        inside = tuple(slice(max(-low, 0), n - low) for low, n in zip(first, domain.cells, strict=False))
        return int(np.count_nonzero(band[inside]))

    # ---- memory ------------------------------------------------------------------------------------------------------

    def memory(self) -> float:
        """Of the rank that takes most, at its peak."""
        drawing = DRAWING_BYTES
        if self.scene.fluid and self.dimensions > 1:
            drawing += CUT_BYTES if self.dimensions == 3 else MAP_BYTES * min(self.cells / CELLS_OF_MAPS, 1.0)
        kernels = KERNEL_BYTES
        if self.scene.fluid and self.scene.solid:
            kernels += COUPLING_BYTES * self.dimensions
        first, *others = (
            PROCESS_BYTES + arrays + (kernels if blocks.local_count or self.scene.solid else 0.0)
            for blocks, arrays in zip(self.blocks, self._arrays(), strict=True)
        )
        return max([first + drawing, *others])

    def arrays(self) -> float:
        """Cells and particles of the rank that takes most."""
        return max(self._arrays())

    def _arrays(self) -> list[float]:
        """Cells and particles of each rank."""
        solid = self.scene.solid
        particles = (PARTICLE_BYTES[solid.form][self.dimensions] if solid else 0.0) * self.particles_of_ranks
        return [self.field_bytes(blocks) + float(p) for blocks, p in zip(self.blocks, particles, strict=True)]

    def field_bytes(self, blocks: Blocks) -> float:
        """Fields of a rank's cells with their ghosts and padding, and those made for a field file."""
        if not self.scene.fluid:
            return 0.0
        variables = fluid_model(self.scene).variables
        value = np.dtype(self.scene.fluid.precision).itemsize
        in_memory = len(SSP_RK3) * variables * value
        if self.scene.solid:
            in_memory += self._coupling_bytes(value)
        if self.scene.output.peaks:
            in_memory += 4 * FLOAT
        padded = math.prod(blocks.block_cells) * self.cell_file_bytes()
        return blocks.local_count * (math.prod(blocks.shape) * in_memory + padded)

    def _coupling_bytes(self, value: int) -> int:
        """Per cell, of values of so many bytes: what it is and the impulse on it; and what cuts it."""
        D, every = self.dimensions, 1 + FLOAT * self.dimensions
        if self.scene.coupling.scheme == "immersed_boundary":
            return every
        swept = 3 if len(present(self.scene.fluid).phases) == 2 else 1
        return every + 2 + D + 2 * FLOAT + (swept + 2 + 2 * D) * value  # corners are counted as cells

    # ---- files -------------------------------------------------------------------------------------------------------

    def cell_file_bytes(self) -> int:
        """Bytes per cell of a field file: density, pressure, velocity and what else the scene has or asks for."""
        phases = len(present(self.scene.fluid).phases)
        scalars = 2 + (phases if phases > 2 else phases - 1)  # pressure, density, volume fractions
        scalars += 4 * bool(self.scene.output.peaks) + self.scene.output.schlieren
        return VECTOR + FLOAT * scalars

    def output_times(self) -> int:
        """How many times fields are written."""
        every, end = self.scene.output.fields_every, end_time(self.scene, self.layout)
        times = end / every - 1e-9 if every else 1.0
        return 1 + (math.ceil(times) if times < self.steps else self.steps)  # at most one per step

    def output_bytes(self) -> float:
        """Field files of one time."""
        blocks = self.blocks[0]
        cells = blocks.count * math.prod(blocks.block_cells) * self.cell_file_bytes() if self.cells else 0
        return cells + self.particles * PARTICLE_FILE_BYTES

    # ---- time --------------------------------------------------------------------------------------------------------

    def seconds(self, threads: int, bench: Mapping[str, Any]) -> float:
        """Of the run with so many threads per rank, by a bench of the same machine.

        Work per step grows with the cells that are not at rest and with the particles, and is shared by all threads;
        the remainder of a step is not.
        """
        moving = moving_share(self.scene, self.layout) if self.layout else 0.0
        threads_of_bench = bench["ranks"] * bench["threads_per_rank"]
        share = threads_of_bench / min(self.ranks * threads, max(1, self._pieces()))
        smallest = "coupled" if self.cells and self.particles else "fluid" if self.cells else "solid"
        fixed = bench[f"smallest_{smallest}"]
        work = moving * self.cells * self._seconds_per_cell(bench) + self._seconds_at_wall(bench)
        work += sub_steps(self.scene, self.layout) * self.particles * self._seconds_per_particle(bench)
        files = self.output_times() * (SECONDS_PER_FILE + self.output_bytes() / BYTES_PER_SECOND)
        bubble = bench["shock_bubble_2d"]
        row = fixed["history_row_seconds"] + share * self.cells * bubble["history_row_seconds"] / bubble["cells"]
        step = fixed["seconds_per_step"] + share * work + row / self.scene.output.history_every
        return SECONDS_TO_LOAD + fixed["start_seconds"] + self.steps * step + files

    def _pieces(self) -> int:
        """Into how many pieces the work can be cut: tiles and, by the hundred, particles."""
        tiles = math.prod(
            math.ceil(n / t) for n, t in zip(self.scene.domain.cells, self.scene.performance.tile_cells, strict=True)
        )
        return max(tiles if self.cells else 1, self.particles // 100)

    def _seconds_per_cell(self, bench: Mapping[str, Any]) -> float:
        """Of a time step, with the nearest of the benchmarks in two dimensions and the step to other ones."""
        if not self.cells:
            return 0.0
        fluid, D = present(self.scene.fluid), self.dimensions
        eos = {type(phase.eos) for phase in fluid.phases}
        two = "shock_bubble" if eos == {IdealGas} else "water_air" if eos <= {IdealGas, StiffenedGas} else "tnt_air"
        phases = len(fluid.phases)
        rate = bench[f"{two if phases > 1 else 'euler'}_2d"]["cell_stages_per_second"] * min(2.0 / phases, 1.0)
        bubble = bench["shock_bubble_2d"]["cell_stages_per_second"]
        rate *= bench[f"shock_bubble_{D}d"]["cell_stages_per_second"] / bubble
        if fluid.precision == "float32":
            rate *= bench["shock_bubble_2d_float32"]["cell_stages_per_second"] / bubble
        return len(SSP_RK3) / rate

    def _seconds_per_particle(self, bench: Mapping[str, Any]) -> float:
        """Of a time step, by the form of the solid and the number of neighbours."""
        if not self.particles:
            return 0.0
        solid, D = present(self.scene.solid), self.dimensions
        neighbours = (solid.smoothing / SMOOTHING) ** D
        bonded = f"bonded_copper_block_{D}d"
        block = bonded if solid.form == "total_lagrangian" and bonded in bench else f"copper_block_{D}d"
        return neighbours / bench[block]["particle_steps_per_second"]

    def _seconds_at_wall(self, bench: Mapping[str, Any]) -> float:
        """Of a time step: what cells around the wall and particles cost in two benchmarks, a block and a plate."""
        if not self.band_cells:
            return 0.0
        works = [bench[f"blast_on_{body}_{max(self.dimensions, 2)}d"] for body in ("copper", "plate")]
        amounts = np.array([[work["band_cells"], work["particles"]] for work in works], dtype=float)
        prices, _ = optimize.nnls(amounts, np.array([work["wall_seconds_per_step"] for work in works]))
        return float(prices @ (self.band_cells, self.particles))
