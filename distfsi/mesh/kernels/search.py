"""Particles sorted into the cells of a search grid, in one order on any number of ranks and threads; and what is near
a point."""

from math import floor
from typing import Any, NamedTuple

from distfsi.device.markers import ByHand, driver, helper
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS


class Bins(NamedTuple):
    """Particles by the cells of a search grid that they are in: a window of the grid, with an empty cell on each side.

    start    (cells + 1,): where the particles of each cell of the window begin in `order`
    order    (n,): the particles, cell by cell, in the order of their keys
    lower    (D,) corner of the grid [m]
    size     of its cells [m]
    low      (D,) first search cell of the window with particles, counted from the corner
    window   (D,) cells of the window, the empty ones included
    strides  (3,) steps in `start` along each axis
    """

    start: Any
    order: Any
    lower: Any
    size: float
    low: Any
    window: Any
    strides: Any


# ---- what is near ---------------------------------------------------------------------------------------------------


@helper
def bins_between(minimum, maximum, axis, bins: Bins):
    """First and past-the-end search cell, along an axis of the window, of points from `minimum` to `maximum` [m]."""
    first = int(floor((minimum - bins.lower[axis]) / bins.size) - bins.low[axis]) + 1
    last = int(floor((maximum - bins.lower[axis]) / bins.size) - bins.low[axis]) + 1
    return (min(max(first, 0), bins.window[axis]), min(max(last + 1, 0), bins.window[axis]))


@helper
def bins_around(x, reach, bins: Bins):
    """The search cells, along three axes, of the points within `reach` (D,) of x."""
    by, bz = (0, 1), (0, 1)
    bx = bins_between(x[0] - reach[0], x[0] + reach[0], 0, bins)
    if DIMENSIONS > 1:
        by = bins_between(x[1] - reach[1], x[1] + reach[1], 1, bins)
    if DIMENSIONS > 2:
        bz = bins_between(x[2] - reach[2], x[2] + reach[2], 2, bins)
    return (bx, by, bz)


@helper
def bins_around_box(box, reach, bins: Bins):
    """The search cells, along three axes, of the points within `reach` [m] of a box, as (2 D,): least and largest
    coordinate along each axis."""
    by, bz = (0, 1), (0, 1)
    bx = bins_between(box[0] - reach, box[1] + reach, 0, bins)
    if DIMENSIONS > 1:
        by = bins_between(box[2] - reach, box[3] + reach, 1, bins)
    if DIMENSIONS > 2:
        bz = bins_between(box[4] - reach, box[5] + reach, 2, bins)
    return (bx, by, bz)


@helper
def particles_of_row(bx, j, k, bins: Bins):
    """Where in the order the particles begin and end of a row of search cells along x, from bx[0] to before bx[1]."""
    row = k * bins.strides[2] + j * bins.strides[1]
    return (bins.start[row + bx[0]], bins.start[row + bx[1]])


@helper
def any_particle(center, reach, bins: Bins):
    """Whether a search cell that a box of half width `reach` (D,) touches holds particles."""
    bx, by, bz = bins_around(center, reach, bins)
    for k in range(bz[0], bz[1]):
        for j in range(by[0], by[1]):
            first, last = particles_of_row(bx, j, k, bins)
            if first < last:
                return True
    return False


# ---- sorting --------------------------------------------------------------------------------------------------------


@driver
def find_cells(begin, end, position, lower, size, low, high, strides, cell):
    """cell[i] = search cell of each particle within the window low … high; those beyond go to its outermost cells."""
    for i in range(begin, end):
        index = 0
        for d in static_range(DIMENSIONS):
            along = floor((position[i, d] - lower[d]) / size)
            index += (1 + int(max(min(along, high[d]), low[d]) - low[d])) * strides[d]
        cell[i] = index


def search_block(constants, arguments):
    """One block of threads sorts all."""
    return {"THREADS": 256, "SHARED": 0}


@ByHand("search.cu", (), search_block)
@driver
def fill_cells(begin, end, cell, start, order):
    """Counting sort: order[start[c] … start[c + 1]] = the particles of search cell c. There is one item: all."""
    # count the particles of each cell
    for c in range(len(start)):
        start[c] = 0
    for i in range(len(cell)):
        start[cell[i]] += 1
    # where each cell ends
    for c in range(1, len(start)):
        start[c] += start[c - 1]
    # fill from the ends; then `start` says where cells begin
    for i in range(len(cell) - 1, -1, -1):
        start[cell[i]] -= 1
        order[start[cell[i]]] = i


@driver
def order_cells(begin, end, start, order, key):
    """Sort the particles of each search cell by their key; they are almost sorted, so insertion is fast."""
    for c in range(begin, end):
        for n in range(start[c] + 1, start[c + 1]):
            particle, m = order[n], n
            while m > start[c] and key[order[m - 1]] > key[particle]:
                order[m] = order[m - 1]
                m -= 1
            order[m] = particle
