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
    center_of,
    first_value,
    index_of,
    index_of_row,
    is_in_grid,
)


@driver
def look_at_rows(begin, end, center, number, inside, size, grid: BlockGrid, table: BlockTable):
    """center, size and number of the block of each active cell, row by row; inside = 2 if the grid has its index."""
    for r in range(begin, end):
        b = block_of_row(r, grid)
        j, k = index_of_row(r, grid)
        for i in range(cells_of_row(r, b, grid)):
            at = cell_at(b, i, j, k, grid)
            x = center_of(index_of(at, grid), grid)
            for d in static_range(DIMENSIONS):
                center[at, d] = x[d]
            number[at] = block_at(center, at, grid, table)
            size[at] = cell_volume(grid)
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


def test_the_first_value_of_a_cell():
    """Of a field of three variables, in blocks of five cells."""
    first = np.zeros(15, np.int64)
    cpu.build([first_values], {}).first_values(0, 15, first, 3, 5)
    field = np.arange(45).reshape(3, 3, 5)
    assert np.array_equal(first, field[:, 0].ravel())
