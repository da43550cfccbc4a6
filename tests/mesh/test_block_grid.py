"""What kernels know of cells and blocks is what the host knows of them, with any depth of ghosts."""

import numpy as np
import pytest

from distfsi.device import cpu
from distfsi.device.markers import driver
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.mesh.blocks import Blocks, Grid
from distfsi.mesh.communicator import Communicator
from distfsi.mesh.kernels.grid import (
    BlockGrid,
    BlockTable,
    block_at,
    block_of_row,
    cell_at,
    cell_volume,
    cells_of_row,
    center_of_cell,
    first_value,
    index_of,
    index_of_row,
    is_in_grid,
)
from distfsi.scene.description import Box, FluidState, Performance, Region
from fluids import AIR
from tubes import scene_of, start


@driver
def look_at_rows(begin, end, center, number, inside, size, grid: BlockGrid, table: BlockTable):
    """center, size and number of the block of each active cell, row by row; inside = 2 if the grid has its index."""
    for r in range(begin, end):
        b = block_of_row(r, grid)
        j, k = index_of_row(r, grid)
        for i in range(cells_of_row(r, b, grid)):
            at = cell_at(b, i, j, k, grid)
            x = center_of_cell(at, grid)
            for d in static_range(DIMENSIONS):
                center[at, d] = x[d]
            number[at] = block_at(center, at, grid, table)
            size[at] = cell_volume(b, grid)
            inside[at] = 2 if is_in_grid(index_of(at, grid), (0, 0, 0), grid) else 1


@driver
def first_values(begin, end, first, variables, cells):
    """first[n] = index of the first value of the cell n."""
    for n in range(begin, end):
        first[n] = first_value(n, variables, cells)


@pytest.mark.parametrize("dimensions", [1, 2, 3])
@pytest.mark.parametrize("layers", [2, 3])
def test_cells_of_kernels_are_those_of_the_blocks(dimensions, layers):
    """Blocks are cut off at the grid's ends, and the last one has fewer cells."""
    D, cells = dimensions, (7, 5, 4)[:dimensions]
    lower, upper = (-1.0, 0.5, 2.0)[:D], (0.4, 3.0, 2.7)[:D]
    grid = Grid.of(lower, upper, cells, (("wall", "wall"),) * D, layers)
    blocks, device = Blocks(grid, (3, 2, 2)[:D], Communicator()), cpu.Cpu(1)
    shape, rows = (blocks.local_count, *blocks.shape), blocks.local_count * blocks.shape[0] * blocks.shape[1]
    count = int(np.prod(shape))
    center, number, inside, size = np.full((count, D), np.nan), np.full(count, -1), np.zeros(count), np.zeros(count)
    built = cpu.build([look_at_rows], {"DIMENSIONS": D, "GHOSTS": layers})
    device.run(built.look_at_rows, rows, center, number, inside, size, blocks.grid_on(device), blocks.table_on(device))
    active = np.zeros(shape, bool)
    for b in range(blocks.local_count):
        z, y, x = (slice(g, g + n) for g, n in zip(grid.ghosts[::-1], blocks.extent[b][::-1], strict=True))
        active[b, z, y, x] = True
        centers = np.stack(np.meshgrid(*blocks.cell_centers(b)[::-1], indexing="ij")[::-1], axis=-1)[..., :D]
        assert np.array_equal(center.reshape(*shape, D)[b, z, y, x], centers)
        assert (number.reshape(shape)[b, z, y, x] == b).all()
    assert np.array_equal(inside, np.where(active.ravel(), 2, 0))
    assert size.max() == pytest.approx(np.prod((np.array(upper) - lower) / cells))


def test_the_size_of_cells_is_that_of_their_block():
    """In a grid whose second block has cells of half the size, counted on a level of their own."""
    grid = Grid.of((0.0,), (1.0,), (8,), (("wall", "wall"),))
    blocks, device = Blocks(grid, (4,), Communicator()), cpu.Cpu(1)
    count = blocks.local_count * blocks.shape[2]
    center, number, inside, size = np.full((count, 1), np.nan), np.full(count, -1), np.zeros(count), np.zeros(count)
    built = cpu.build([look_at_rows], {"DIMENSIONS": 1, "GHOSTS": 2})
    known = blocks.grid_on(device)._replace(spacing=np.array([[0.125, 1.0, 1.0], [0.0625, 1.0, 1.0]]))
    device.run(built.look_at_rows, 2, center, number, inside, size, known, blocks.table_on(device))
    assert size[2:6].tolist() == [0.125] * 4 and size[10:14].tolist() == [0.0625] * 4
    assert center[10:14, 0].tolist() == [(4 + i + 0.5) * 0.0625 for i in range(4)]


def test_a_stage_takes_the_size_of_cells_from_their_block():
    """A block whose cells are half as wide changes as in a grid of such cells, the other one as before."""
    dense = Region(FluidState(0, 2.0, 4.0, (0.1,)), Box((0.3,), (0.7,)))
    scene = scene_of(
        (AIR,),
        (Region(FluidState(0, 1.0, 1.0, (0.5,)), None), dense),
        (0.0,),
        (1.0,),
        (8,),
        1.0,
        performance=Performance((4,), (2,)),
    )
    changes = []
    for factors in ((1.0, 1.0), (1.0, 0.5), (0.5, 0.5)):
        simulation = start(scene)
        fluid, stage = simulation.fluid, simulation.fluid.stages[0]
        simulation.blocks.spacing *= np.array(factors)[:, None]  # on the CPU the kernels' own
        before = [fluid.cells(block).copy() for block in range(2)]
        fluid.exchange_ghosts(stage)
        fluid.begin_stage()
        fluid.advance_tiles(np.arange(4), stage, 1e-3)
        changes.append([fluid.active(fluid.output_of(stage), block) - before[block] for block in range(2)])
    planar, mixed, fine = changes
    assert np.array_equal(mixed[0], planar[0]) and np.array_equal(mixed[1], fine[1])
    assert np.abs(fine[1] - planar[1]).max() > 1e-3


def test_the_first_value_of_a_cell():
    """Of a field of three variables, in blocks of five cells."""
    first = np.zeros(15, np.int64)
    cpu.build([first_values], {}).first_values(0, 15, first, 3, 5)
    field = np.arange(45).reshape(3, 3, 5)
    assert np.array_equal(first, field[:, 0].ravel())
