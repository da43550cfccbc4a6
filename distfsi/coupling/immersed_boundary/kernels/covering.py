"""Loops of the immersed boundary: which cells the solid covers, and how fast the wall in them moves."""

from distfsi.coupling.kernels.cells import COVERED, DEEP, FLUID, FRESH, UNKNOWN
from distfsi.coupling.kernels.interpolation import Cloud, sum_around
from distfsi.device.markers import driver, helper, load, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES, VARIABLES
from distfsi.mesh.kernels.grid import BlockGrid, block_size, cell_at, center_of_cell, first_value, middle_of
from distfsi.mesh.kernels.search import Bins, any_particle
from distfsi.solid.kernels.records import DENSITY, MASS, VELOCITY

# Columns of the numbers of cells of each kind that find_depth() counts.
COVERED_CELLS, DEEP_CELLS, FRESH_CELLS = range(3)


@driver
def find_amounts(begin, end, state, volume, momentum):
    """volume (n, 1); momentum (n, 1 + D): mass and momentum of particles of a `state` as in solid/kernels/pairs.py."""
    for i in range(begin, end):
        volume[i, 0] = state[i, MASS] / state[i, DENSITY]
        momentum[i, 0] = state[i, MASS]
        for d in static_range(DIMENSIONS):
            momentum[i, 1 + d] = state[i, MASS] * state[i, VELOCITY + d]


@helper
def any_near(block, radius, bins: Bins, grid: BlockGrid):
    """Whether there may be particles within `radius` of a block."""
    reach = tuple(0.5 * grid.extent[block, d] * grid.spacing[block, d] + radius for d in static_range(DIMENSIONS))
    return any_particle(middle_of(block, grid), reach, bins)


@driver
def cover(begin, end, kind, occupied, U, lost, radius, particles: Cloud, grid: BlockGrid):
    """kind = COVERED where the particles' volume fills half of the kernel of `radius`, FRESH where it did.

    occupied (blocks,): whether a block has cells that are not FLUID; without those and particles it is skipped.
    lost (blocks, conserved): grows by what the cells that become covered hold per volume.
    """
    sums = workspace(1)
    cells = block_size(grid)
    for b in range(begin, end):
        if occupied[b] == 0 and not any_near(b, radius, particles.bins, grid):
            continue
        occupied[b] = 0
        for k in range(grid.extent[b, 2]):
            for j in range(grid.extent[b, 1]):
                for i in range(grid.extent[b, 0]):
                    # how much of the kernel is filled
                    at = cell_at(b, i, j, k, grid)
                    sum_around(sums, center_of_cell(at, grid), radius, particles)
                    # what the cell becomes, and what it loses
                    before = kind[at]
                    if sums[0] >= 0.5:
                        kind[at] = COVERED
                        if before < UNKNOWN:
                            for v in range(PHASES + DIMENSIONS + 1):
                                lost[b, v] += load(U, first_value(at, VARIABLES, cells) + v * cells)
                    else:
                        kind[at] = FRESH if before >= COVERED else FLUID
                    if kind[at] != FLUID:
                        occupied[b] = 1


@helper
def depth_of(kind, at, offsets):
    """The column of find_depth() that a covered cell counts in: DEEP_CELLS if no cell at the `offsets` holds fluid."""
    deep = DEEP_CELLS
    for m in range(len(offsets)):
        if kind[at + offsets[m]] < COVERED:
            deep = COVERED_CELLS
            break
    return deep


@driver
def find_depth(begin, end, kind, occupied, offsets, counts, grid: BlockGrid):
    """Covered cells without fluid at `offsets` become DEEP; counts (blocks, 3) = the COVERED, DEEP and FRESH cells."""
    for b in range(begin, end):
        for c in range(3):
            counts[b, c] = 0
        # blocks of fluid alone have none
        if occupied[b] == 0:
            continue
        # count cells; those that no flux sees are deep
        for k in range(grid.extent[b, 2]):
            for j in range(grid.extent[b, 1]):
                for i in range(grid.extent[b, 0]):
                    at = cell_at(b, i, j, k, grid)
                    if kind[at] == FRESH:
                        counts[b, FRESH_CELLS] += 1
                    elif kind[at] >= COVERED:
                        depth = depth_of(kind, at, offsets)
                        counts[b, depth] += 1
                        if depth == DEEP_CELLS:
                            kind[at] = DEEP


@driver
def list_cells(begin, end, kind, occupied, first, covered, deep, fresh, grid: BlockGrid):
    """Write the cells of each kind, block by block, from the indices first (blocks, 3) on."""
    for b in range(begin, end):
        if occupied[b] == 0:
            continue
        # where the block's part of each list begins, then cell by cell
        c, d, f = first[b, COVERED_CELLS], first[b, DEEP_CELLS], first[b, FRESH_CELLS]
        for k in range(grid.extent[b, 2]):
            for j in range(grid.extent[b, 1]):
                for i in range(grid.extent[b, 0]):
                    at = cell_at(b, i, j, k, grid)
                    if kind[at] == COVERED:
                        covered[c] = at
                        c += 1
                    elif kind[at] == DEEP:
                        deep[d] = at
                        d += 1
                    elif kind[at] == FRESH:
                        fresh[f] = at
                        f += 1


@driver
def find_wall_velocity(begin, end, covered, velocity, inertia, radius, particles: Cloud, grid: BlockGrid):
    """velocity (n, D) of the wall in covered cells: the particles' mean by mass and kernel (Eq. 31 with weights).

    The particles' values: mass and momentum; inertia (n,) = sum of mass times kernel.
    """
    sums = workspace(1 + DIMENSIONS)
    for n in range(begin, end):
        sum_around(sums, center_of_cell(covered[n], grid), radius, particles)
        inertia[n] = sums[0]
        for d in static_range(DIMENSIONS):
            velocity[n, d] = sums[1 + d] / sums[0]
