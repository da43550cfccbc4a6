"""Loops that find nodal signed distances: those of the nodes, the corners of cells, from the wall.

Particles are smoothed with a kernel; inverting its plane profile turns the sum at a node into a distance that is linear
in the positions of the particles. Nodes outside the domain are seen in the mirror of its sides. A node is named by its
flat index in a field of nodes, which has one more of them along every used axis than a field of cells.
"""

from distfsi.coupling.cut_cells.kernels.inflation import nearest_spheres
from distfsi.coupling.kernels.interpolation import Cloud, are_near, put_point, sum_around_points
from distfsi.device.markers import driver, helper, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, LANES
from distfsi.mesh.kernels.grid import BlockGrid, ghosts, middle_of
from distfsi.mesh.kernels.search import Bins, any_particle

STRETCH = 8  # nodes of a row that are left out together where no particle is near
SMALLEST = 1e-7  # of a cell: distances from the wall are not less, so that it passes no node

# What a block is: far from all particles and whole; near particles or else; with cells that are not whole.
NEAR, CUT = 1, 2


# ---- nodes ----------------------------------------------------------------------------------------------------------


@helper
def more_nodes():
    """How many more nodes than cells there are along x, y, z."""
    return (1, 1 if DIMENSIONS > 1 else 0, 1 if DIMENSIONS > 2 else 0)


@helper
def node_steps(grid: BlockGrid):
    """Steps in memory to the next node along x, y, z; 0 along an unused axis."""
    sy = grid.shape[2] + more_nodes()[0]
    return (1, sy if DIMENSIONS > 1 else 0, sy * (grid.shape[1] + more_nodes()[1]) if DIMENSIONS > 2 else 0)


@helper
def node_at(block, i, j, k, grid: BlockGrid):
    """Flat index of the low node of a cell, counted from the first active cell of its block."""
    gx, gy, gz = ghosts()
    mx, my, mz = more_nodes()
    return ((block * (grid.shape[0] + mz) + k + gz) * (grid.shape[1] + my) + j + gy) * (grid.shape[2] + mx) + i + gx


@helper
def node_row(r, grid: BlockGrid):
    """Block, and index along y and z in it, of a row of nodes along x."""
    gy, gz, my, mz = ghosts()[1], ghosts()[2], more_nodes()[1], more_nodes()[2]
    b = r // ((grid.shape[0] + mz) * (grid.shape[1] + my))
    return (b, r % (grid.shape[1] + my) - gy, r // (grid.shape[1] + my) % (grid.shape[0] + mz) - gz)


@helper
def nodes_of_row(near, b, j, k, grid: BlockGrid):
    """How many nodes of a row there are to look at: none in a block that is not `near`, or beyond its cells."""
    gx, gy, gz = ghosts()
    mx, my, mz = more_nodes()
    far = near[b] == 0 or j >= grid.extent[b, 1] + gy + my or k >= grid.extent[b, 2] + gz + mz
    return 0 if far else grid.extent[b, 0] + 2 * gx + mx


@helper
def mirrored(index, cells):
    """The plane between cells of which `index` is the image in the sides of the domain."""
    if index < 0:
        return -index
    if index > cells:
        return 2 * cells - index
    return index


@helper
def position_of(b, i, j, k, grid: BlockGrid):
    """Where the low node of a cell of a block is [m], in the mirror of the domain's sides."""
    index = (
        mirrored(grid.origin[b, 0] + i, grid.cells[0]),
        mirrored(grid.origin[b, 1] + j, grid.cells[1]),
        mirrored(grid.origin[b, 2] + k, grid.cells[2]),
    )
    return tuple(grid.lower[d] + index[d] * grid.spacing[b, d] for d in static_range(DIMENSIONS))


@helper
def position_of_node(at, grid: BlockGrid):
    """Where a node is [m], in the mirror of the domain's sides."""
    gx, mx = ghosts()[0], more_nodes()[0]
    row = at // (grid.shape[2] + mx)
    b, j, k = node_row(row, grid)
    return position_of(b, at % (grid.shape[2] + mx) - gx, j, k, grid)


# ---- which of them are near the wall --------------------------------------------------------------------------------


@driver
def find_near(begin, end, near, search, bins: Bins, grid: BlockGrid):
    """near (blocks,) = NEAR where there are particles nearby, or cells that were not whole, else 0. search [m]: how far
    particles change distances."""
    layers = ghosts()[0]
    for b in range(begin, end):
        reach = tuple(
            (0.5 * grid.extent[b, d] + 1.0 * layers) * grid.spacing[b, d] + search for d in static_range(DIMENSIONS)
        )
        if near[b] > 0 or any_particle(middle_of(b, grid), reach, bins):
            near[b] = NEAR


@helper
def any_near(b, first, last, j, k, reach, bins: Bins, grid: BlockGrid):
    """Whether there may be particles within `reach` of the nodes from `first` to before `last` of a row."""
    gx = ghosts()[0]
    x = position_of(b, first - gx, j, k, grid)
    minimum, maximum = x[0], x[0]
    for n in range(first + 1, last):
        other = position_of(b, n - gx, j, k, grid)
        minimum, maximum = min(minimum, other[0]), max(maximum, other[0])
    half, wide = 0.5 * (maximum - minimum), 1.001 * reach
    around = tuple(wide + half if d == 0 else wide for d in static_range(DIMENSIONS))
    middle = tuple(minimum + half if d == 0 else x[d] for d in static_range(DIMENSIONS))
    return any_particle(middle, around, bins)


@driver
def mark_nodes(begin, end, near, distance, mark, radius, reach, bins: Bins, grid: BlockGrid):
    """mark = 1 at nodes of the cells of `near` blocks that may have particles within `reach`, else 0 and distance =
    `radius` [m]. An item is a row of nodes along x."""
    gx = ghosts()[0]
    for r in range(begin, end):
        b, j, k = node_row(r, grid)
        last = nodes_of_row(near, b, j, k, grid)
        row_seen = last > 0 and any_near(b, 0, last, j, k, reach, bins, grid)
        for first in range(0, last, STRETCH):
            end_of_stretch = min(first + STRETCH, last)
            seen = row_seen and any_near(b, first, end_of_stretch, j, k, reach, bins, grid)
            for n in range(first, end_of_stretch):
                at = node_at(b, n - gx, j, k, grid)
                mark[at] = 1 if seen else 0
                distance[at] = radius


# ---- their distances ------------------------------------------------------------------------------------------------


@helper
def distance_of(filled, profile, radius):
    """Distance [m] of a plane wall that fills this share of the kernel; profile: shares on one side of planes."""
    free = 1.0 - filled
    if free >= 1.0 or free <= 0.0:
        return radius if free > 0.0 else -radius
    # by bisection, linear between the planes
    first, last = 0, len(profile) - 1
    while last - first > 1:
        middle = (first + last) // 2
        if profile[middle] <= free:
            first = middle
        else:
            last = middle
    part = min(max((free - profile[first]) / (profile[last] - profile[first]), 0.0), 1.0)
    return radius * (2.0 * (first + part) / (len(profile) - 1) - 1.0)


@helper
def off_node(distance, at, grid: BlockGrid):
    """A distance [m] that does not put the wall onto a node `at`."""
    minimum = SMALLEST * grid.spacing[node_row(at // (grid.shape[2] + more_nodes()[0]), grid)[0], 0]
    return minimum if abs(distance) < minimum else distance


@helper
def nodes_near(points, chosen, first, last, radius, grid: BlockGrid):
    """How many of the nodes `chosen`, from the `first` on, before the `last`, are computed side by side: they are put
    to `points` (D, LANES), whose remaining ones repeat one of them."""
    x, n = position_of_node(chosen[first], grid), 1
    while first + n < last and are_near(x, position_of_node(chosen[first + n], grid), radius):
        n += 1
    for i in range(LANES):
        put_point(points, i, position_of_node(chosen[first + min(i, n - 1)], grid))
    return n


@driver
def find_distances(begin, end, chosen, distance, radius, profile, particles: Cloud, grid: BlockGrid):
    """distance [m] to the wall, at most `radius`, at the nodes `chosen`, by how much of the kernel the particles'
    volume, their first value, fills. An item is a box of LANES of them."""
    points, around = workspace(DIMENSIONS * LANES), workspace(2 * DIMENSIONS)
    filled, weight = workspace(LANES), workspace(LANES)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            count = nodes_near(points, chosen, first, last, radius, grid)
            sum_around_points(filled, weight, around, points, radius, 1, particles)
            for i in range(count):
                at = chosen[first + i]
                distance[at] = off_node(distance_of(filled[i], profile, radius), at, grid)
            first += count


@driver
def node_positions(begin, end, chosen, position, grid: BlockGrid):
    """position (n, D) [m] of the nodes `chosen`, in the mirror of the domain's sides."""
    for n in range(begin, end):
        x = position_of_node(chosen[n], grid)
        for d in static_range(DIMENSIONS):
            position[n, d] = x[d]


@driver
def put_distances(begin, end, chosen, found, distance, radius, grid: BlockGrid):
    """distance [m] at the nodes `chosen` = what is `found` (n,) of them, at most `radius`."""
    for n in range(begin, end):
        distance[chosen[n]] = off_node(min(max(found[n], -radius), radius), chosen[n], grid)


@driver
def add_spheres(begin, end, chosen, distance, largest, reach, particles: Cloud, grid: BlockGrid):
    """distance becomes that to the spheres of inflated particles, their values, where they are nearer, at the nodes
    `chosen`; none is larger than the `largest` [m]. An item is a box of LANES nodes."""
    points, around, nearest = workspace(DIMENSIONS * LANES), workspace(2 * DIMENSIONS), workspace(LANES)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(chosen))
        while first < last:
            # how far spheres may be that are nearer than the wall known so far
            count, wide = nodes_near(points, chosen, first, last, reach, grid), 0.0
            for i in range(LANES):
                nearest[i] = distance[chosen[first + min(i, count - 1)]]
                if nearest[i] > -largest:
                    wide = max(wide, min(reach, nearest[i] + 1.001 * largest))
            if wide > 0.0:
                nearest_spheres(nearest, around, points, wide, reach, particles)
            for i in range(count):
                at = chosen[first + i]
                distance[at] = min(distance[at], off_node(nearest[i], at, grid))
            first += count
