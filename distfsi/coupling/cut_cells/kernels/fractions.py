"""Loops that turn nodal signed distances into the volume fractions of cells and the apertures of faces that are open.

An item is a row of cells along x. Cells around a block are looked at in its ghosts.
"""

from distfsi.coupling.cut_cells.kernels.nodal_distance import CUT, node_at, node_steps
from distfsi.coupling.formulas.apertures import aperture_of, volume_fraction_of
from distfsi.device.markers import driver, helper, load, row, store
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.mesh.kernels.grid import (
    BlockGrid,
    block_of_row,
    block_size,
    cell_at,
    first_value,
    ghosts,
    index_of_row,
)

SMALLEST = 1e-9  # volume fraction: less is none


@row
def count_covered(distance, first, n):
    """How many of the n nodes from the `first` on are not in the fluid."""
    count = 0
    for i in range(n):
        count += 1 if load(distance, first + i) <= 0.0 else 0
    return count


@row
def open_row(before, fraction, aperture, at, face, cells, n):
    """The n cells from `at` on, and their low faces, are open; returns how many were not `before`."""
    count = 0
    for i in range(n):
        store(fraction, at + i, 1.0)
        count += 1 if load(before, at + i) < 1.0 else 0
    for d in static_range(DIMENSIONS):
        for i in range(n):
            store(aperture, face + d * cells + i, 1.0)
    return count


@helper
def covered_nodes(distance, node, n, grid: BlockGrid):
    """How many nodes of the n cells of a row, whose first low one is `node`, are not in the fluid."""
    _, sy, sz = node_steps(grid)
    count = count_covered(distance, node, n + 1)
    if DIMENSIONS > 1:
        count += count_covered(distance, node + sy, n + 1)
    if DIMENSIONS > 2:
        count += count_covered(distance, node + sz, n + 1) + count_covered(distance, node + sz + sy, n + 1)
    return count


@helper
def distances_of(distance, node, grid: BlockGrid):
    """Distances of the eight nodes of a cell, x fastest; along an unused axis they repeat."""
    _, sy, sz = node_steps(grid)
    return (
        distance[node],
        distance[node + 1],
        distance[node + sy],
        distance[node + sy + 1],
        distance[node + sz],
        distance[node + sz + 1],
        distance[node + sz + sy],
        distance[node + sz + sy + 1],
    )


@helper
def put_fractions(d, before, fraction, aperture, at, cells):
    """Store volume fraction and apertures of a cell whose nodes are at the distances d; returns 1 if it is not open as
    a whole, now or `before`, else 0."""
    face = first_value(at, DIMENSIONS, cells)
    minimum, maximum = d[0], d[0]
    for c in static_range(1, 8):
        minimum, maximum = min(minimum, d[c]), max(maximum, d[c])
    # a cell on one side of the wall
    if minimum > 0.0 or maximum <= 0.0:
        part = 1.0 if minimum > 0.0 else 0.0
        fraction[at] = part
        for axis in static_range(DIMENSIONS):
            aperture[face + axis * cells] = part
        return 1 if min(part, before[at]) < 1.0 else 0
    # a cell that is cut
    part = volume_fraction_of(d)
    fraction[at] = part if part > SMALLEST else 0.0
    aperture[face] = aperture_of((d[0], d[2], d[4], d[6]))
    if DIMENSIONS > 1:
        aperture[face + cells] = aperture_of((d[0], d[1], d[4], d[5]))
    if DIMENSIONS > 2:
        aperture[face + 2 * cells] = aperture_of((d[0], d[1], d[2], d[3]))
    return 1


@driver
def find_fractions(begin, end, near, distance, before, fraction, aperture, is_cut, grid: BlockGrid):
    """Volume fraction of each cell, and aperture (blocks, D, Z, Y, X) of its low faces, in `near` blocks.

    is_cut[r] = 1 where a cell of a row is not open as a whole, now or `before`, else 0.
    """
    cells = block_size(grid)
    gx, gy, gz = ghosts()
    for r in range(begin, end):
        b = block_of_row(r, grid)
        j, k = index_of_row(r, grid)
        is_cut[r] = 0
        if near[b] == 0 or j >= grid.extent[b, 1] + gy or k >= grid.extent[b, 2] + gz:
            continue
        # rows without a wall
        at, node, n = cell_at(b, -gx, j, k, grid), node_at(b, -gx, j, k, grid), grid.extent[b, 0] + 2 * gx
        if covered_nodes(distance, node, n, grid) == 0:
            if open_row(before, fraction, aperture, at, first_value(at, DIMENSIONS, cells), cells, n) > 0:
                is_cut[r] = 1
            continue
        # the others, cell by cell
        for i in range(n):
            d = distances_of(distance, node + i, grid)
            if put_fractions(d, before, fraction, aperture, at + i, cells) > 0:
                is_cut[r] = 1


# ---- staircase ------------------------------------------------------------------------------------------------------


@driver
def round_fractions(begin, end, near, fraction, grid: BlockGrid):
    """Volume fraction of a staircase in `near` blocks: a cell is open as a whole or not at all. Ghosts included."""
    for r in range(begin, end):
        first = r * grid.shape[2]
        for at in range(first, first + grid.shape[2] if near[block_of_row(r, grid)] > 0 else first):
            fraction[at] = 1.0 if fraction[at] >= 0.5 else 0.0


@driver
def round_apertures(begin, end, near, fraction, aperture, grid: BlockGrid):
    """Apertures of a staircase in `near` blocks: a face is open between open cells only."""
    cells = block_size(grid)
    for r in range(begin, end):
        b, first = block_of_row(r, grid), r * grid.shape[2]
        for at in range(first, first + grid.shape[2] if near[b] > 0 else first):
            for axis in range(DIMENSIONS):
                before = max(at - grid.steps[axis], b * cells)
                face = first_value(at, DIMENSIONS, cells) + axis * cells
                aperture[face] = min(load(fraction, at), load(fraction, before))


@driver
def mark_cut_blocks(begin, end, near, is_cut, rows):
    """near (blocks,) = CUT where one of a block's `rows` is."""
    for b in range(begin, end):
        for r in range(b * rows, (b + 1) * rows):
            if is_cut[r] > 0:
                near[b] = CUT
