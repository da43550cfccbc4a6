"""Loops of cell merging: which small cells share the content of a neighbour, their merge target; and of small-cell
absorption: what becomes of those that find none.

An item is a row of cells along x.
"""

from math import sqrt

from distfsi.coupling.cut_cells.kernels.records import Merging, Walls, aperture_at, step_to_target
from distfsi.coupling.kernels.cells import COVERED, FLUID, ISOLATED
from distfsi.device.markers import driver, helper, load, row, store
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, MINIMUM_ISOLATED
from distfsi.formulas.tensors import dot
from distfsi.mesh.kernels.grid import (
    BlockGrid,
    block_of_row,
    block_size,
    cell_at,
    cells_of_row,
    first_value,
    index_of,
    index_of_row,
    is_along,
    is_in_grid,
    step_to,
)

SMALL = 0.5  # usable volume fraction: a cell with less is merged


# ---- usable volume --------------------------------------------------------------------------------------------------


@helper
def usable_fraction(walls: Walls, volume, at, first):
    """The least of what is open of a cell before and after the step, and of what its fluid fills, at `first`."""
    open_fraction = min(load(walls.old_fraction, at), load(walls.new_fraction, at))
    return min(open_fraction, load(volume, first))


@row
def begin_row(walls: Walls, volume, at, first, n):
    """The n cells from `at` on hold FLUID; returns how many of them are small."""
    count = 0
    for i in range(n):
        store(walls.kind, at + i, FLUID)
        count += 1 if usable_fraction(walls, volume, at + i, first + i) < SMALL else 0
    return count


@row
def clear_row(target, first, cells, n):
    """The n cells whose first component in `target` is at `first` have no target."""
    for d in static_range(DIMENSIONS):
        for i in range(n):
            store(target, first + d * cells + i, 0)


# ---- merge targets --------------------------------------------------------------------------------------------------


@helper
def slope_of_fraction(walls: Walls, at, step):
    """How the volume fractions, of before and after the step, grow along an axis."""
    high = load(walls.old_fraction, at + step) + load(walls.new_fraction, at + step)
    return high - (load(walls.old_fraction, at - step) + load(walls.new_fraction, at - step))


@helper
def path_is_open(walls: Walls, at, offset, sequence, grid: BlockGrid):
    """Whether one gets from a cell to the one at `offset`, along the axes in `sequence`, through open faces only."""
    here, minimum = at, 1.0
    for m in range(DIMENSIONS):
        axis = sequence[m]
        if offset[axis] != 0:
            face = here + grid.steps[axis] if offset[axis] > 0 else here
            minimum = min(minimum, aperture_at(walls, face, axis, block_size(grid)))
            here += offset[axis] * grid.steps[axis]
    return minimum > 0.0


@helper
def is_reached(walls: Walls, at, offset, sequences, grid: BlockGrid):
    """Whether one of the ways through the axes, `sequences` (n, D), from a cell to the one at `offset` is open."""
    is_open = False
    for s in range(len(sequences)):
        is_open = is_open or path_is_open(walls, at, offset, sequences[s], grid)
    return is_open


@helper
def best_target(walls: Walls, volume, at, first, offsets, sequences, grid: BlockGrid):
    """The number of the neighbour that a small cell shares its content with, -1 if there is none.

    It is not small, one gets there, and it lies along the slope of the volume fractions, away from the wall. Of equal
    ones the first of the `offsets` counts.
    """
    # away from the wall
    index = index_of(at, grid)
    slope = tuple(slope_of_fraction(walls, at, grid.steps[d]) for d in static_range(DIMENSIONS))
    steepness = sqrt(dot(slope, slope)) + 1e-12
    best, chosen = 0.0, -1
    for m in range(len(offsets)):
        # neighbours with enough fluid
        if not is_in_grid(index, offsets[m], grid):
            continue
        step = step_to(offsets, m, grid)
        if usable_fraction(walls, volume, at + step, first + step) < SMALL:
            continue
        # the more open and the more along the slope the better
        away = tuple(1.0 * offsets[m, d] for d in static_range(DIMENSIONS))
        length = sqrt(dot(away, away))
        cosine = dot(away, slope) / (length * steepness)
        score = load(walls.new_fraction, at + step) * (2.0 + cosine) - 0.01 * length
        if score > best + 1e-12:
            if is_reached(walls, at, offsets[m], sequences, grid):
                best, chosen = score, m
    return chosen


@driver
def find_targets(begin, end, near, walls: Walls, volume, target, offsets, sequences, grid: BlockGrid):
    """target (blocks, D, Z, Y, X) = the offset to a small cell's merge target, 0 if it has none or is not small.

    Kind becomes FLUID if a cell has a target or enough fluid to stand alone, ISOLATED if it has less and none, else
    COVERED. volume (blocks, fields, Z, Y, X): first that of the fluid. offsets (n, D): the neighbours in the order in
    which they are asked; sequences (n, D): ways through the axes.
    """
    cells = block_size(grid)
    for r in range(begin, end):
        # a row of cells that are not small
        b = block_of_row(r, grid)
        j, k = index_of_row(r, grid)
        n, row_at = (cells_of_row(r, b, grid) if near[b] > 0 else 0), cell_at(b, 0, j, k, grid)
        shift = b * (volume.shape[1] - 1) * cells
        clear_row(target, first_value(row_at, DIMENSIONS, cells), cells, n)
        # a target for each small one
        for i in range(n if begin_row(walls, volume, row_at, row_at + shift, n) > 0 else 0):
            at = row_at + i
            own = usable_fraction(walls, volume, at, at + shift)
            if own >= SMALL:
                continue
            chosen = best_target(walls, volume, at, at + shift, offsets, sequences, grid)
            if chosen >= 0:
                for d in static_range(DIMENSIONS):
                    target[first_value(at, DIMENSIONS, cells) + d * cells] = offsets[chosen, d]
            elif load(volume, at + shift) <= 0.0:
                walls.kind[at] = COVERED
            elif own < MINIMUM_ISOLATED:
                walls.kind[at] = ISOLATED


@driver
def find_merging(begin, end, band, merging: Merging, above, grid: BlockGrid):
    """joined (n, offsets) of `merging` is found, and above (n, D) = the place in the band of the next cell along each
    axis, -1 for none."""
    cells = block_size(grid)
    for n in range(begin, end):
        at = band[n]
        # the cells that share the content of this one's target
        center = at + step_to_target(merging.target, at, cells, grid)
        index, first = index_of(center, grid), first_value(center, DIMENSIONS, cells)
        for m in range(len(merging.offsets)):
            there, same = first + step_to(merging.offsets, m, grid), True
            for d in static_range(DIMENSIONS):
                same = same and merging.target[there + d * cells] == -merging.offsets[m, d]
            merging.joined[n, m] = 1 if same and is_in_grid(index, merging.offsets[m], grid) else 0
        # the next cells, by bisection
        for axis in range(DIMENSIONS):
            wanted = at + grid.steps[axis]
            start, stop = n, min(n + grid.steps[axis] + 1, len(band))
            while stop - start > 1:
                middle = (start + stop) // 2
                if band[middle] <= wanted:
                    start = middle
                else:
                    stop = middle
            above[n, axis] = start if band[start] == wanted else -1


# ---- absorption of isolated cells -----------------------------------------------------------------------------------


@driver
def find_receivers(begin, end, near, walls: Walls, target, grid: BlockGrid):
    """target of ISOLATED cells = the most open of the FLUID cells behind open faces, the receiver cell that takes their
    fluid; 0 if there is none."""
    cells = block_size(grid)
    for r in range(begin, end):
        b = block_of_row(r, grid)
        j, k = index_of_row(r, grid)
        for i in range(cells_of_row(r, b, grid) if near[b] > 0 else 0):
            at = cell_at(b, i, j, k, grid)
            if walls.kind[at] != ISOLATED:
                continue
            # the most open neighbour across an open face
            first, index, largest = first_value(at, DIMENSIONS, cells), index_of(at, grid), 0.0
            for axis in range(DIMENSIONS):
                for side in range(2):
                    way = 2 * side - 1
                    other = at + way * grid.steps[axis]
                    inside = is_along(index, axis, way, grid)
                    part = load(walls.new_fraction, other)
                    if inside and walls.kind[other] == FLUID and part > largest:
                        if aperture_at(walls, at + side * grid.steps[axis], axis, cells) > 0.0:
                            largest = part
                            for d in range(DIMENSIONS):
                                target[first + d * cells] = way if d == axis else 0


@driver
def cover_absorbed(begin, end, kind, target, grid: BlockGrid):
    """Isolated cells that have a receiver are covered, and have none. Ghosts included."""
    cells = block_size(grid)
    for r in range(begin, end):
        for at in range(r * grid.shape[2], (r + 1) * grid.shape[2]):
            if kind[at] == ISOLATED:
                first, absorbed = first_value(at, DIMENSIONS, cells), 0
                for d in range(DIMENSIONS):
                    if target[first + d * cells] != 0:
                        absorbed = 1
                        target[first + d * cells] = 0
                if absorbed == 1:
                    kind[at] = COVERED
