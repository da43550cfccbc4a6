"""Loops that sort particles into the cells of a search grid, in one order on any number of ranks and threads."""

from math import floor

from distfsi.device.markers import ByHand, driver
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS


@driver
def find_cells(begin, end, position, lower, size, low, high, strides, cell):
    """cell[i] = search cell of each particle within the window low … high; those beyond go to its outermost cells."""
    for i in range(begin, end):
        index = 0
        for d in static_range(DIMENSIONS):
            place = floor((position[i, d] - lower[d]) / size)
            index += (1 + int(max(min(place, high[d]), low[d]) - low[d])) * strides[d]
        cell[i] = index


def search_block(constants, arguments):
    """One block of threads sorts all."""
    return {"THREADS": 256, "SHARED": 0}


@ByHand("search.cu", (), search_block)
@driver
def fill_cells(begin, end, cell, start, order):
    """Counting sort: order[start[c] … start[c + 1]] = the particles of search cell c. There is one item: all."""
    for c in range(len(start)):
        start[c] = 0
    for i in range(len(cell)):
        start[cell[i]] += 1
    for c in range(1, len(start)):
        start[c] += start[c - 1]
    for i in range(len(cell) - 1, -1, -1):
        start[cell[i]] -= 1
        order[start[cell[i]]] = i


@driver
def order_cells(begin, end, start, order, key):
    """Sort the particles of each search cell by their key; they are almost sorted."""
    for c in range(begin, end):
        for n in range(start[c] + 1, start[c + 1]):
            particle, m = order[n], n
            while m > start[c] and key[order[m - 1]] > key[particle]:
                order[m] = order[m - 1]
                m -= 1
            order[m] = particle
