"""Loops of the neighbour search, over the cells of a search grid (mesh/search.py)."""

from distfsi.device.markers import driver
from distfsi.formulas.tensors import dot
from distfsi.solid.kernels.matrices import difference
from distfsi.solid.kernels.records import SMOOTHING, Neighbours, Particles


@driver
def find_neighbours(begin, end, particles: Particles, cell, start, order, rows, neighbours: Neighbours):
    """The neighbours of particle i are all closer than 2 h_ij, cell by cell in the order of their keys.

    `rows` are the offsets of the rows of three cells around a cell. The count may exceed the table's width; then the
    table is not complete.
    """
    for i in range(begin, end):
        found = 0
        for r in range(len(rows)):
            c = cell[i] + rows[r]
            # Three cells that follow each other along x hold one run of particles.
            for n in range(start[c - 1], start[c + 2]):
                j = order[n]
                reach = particles.state[i, SMOOTHING] + particles.state[j, SMOOTHING]
                dx = difference(particles.position, 0, i, j)
                if dot(dx, dx) < reach * reach and j != i:
                    if found < neighbours.table.shape[1]:
                        neighbours.table[i, found] = j
                    found += 1
        neighbours.count[i] = found


@driver
def scatter_neighbours(begin, end, rows, among: Neighbours, neighbours: Neighbours):
    """The neighbours of the particles `rows`, counted `among` these, become those of all."""
    for r in range(begin, end):
        neighbours.count[rows[r]] = among.count[r]
        for n in range(among.count[r]):
            neighbours.table[rows[r], n] = rows[among.table[r, n]]
