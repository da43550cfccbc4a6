"""Copies between flat arrays: box-shaped regions of cells (ghosts, buffers, constants), and lists of ghost cells.

A cell of a list is named by its flat index in a field of one variable; `cells` are those of a block in memory.
"""

from distfsi.device.markers import ByHand, driver
from distfsi.mesh.kernels.grid import first_value


def region_block(constants, arguments):
    """The block's threads share the values of a region."""
    return {"THREADS": 128, "SHARED": 0}


@ByHand("regions.cu", (), region_block)
@driver
def copy_regions(first, last, table, destination, source, mirror):
    """Copy the regions of rows `first` to `last` (excluded) of `table` from flat array `source` to `destination`.

    table   (regions, 14) int64: cells along x, y, z; flips (bit a: mirrored along axis a); then for the destination and
            for the source the index of the first value and the steps from variable to variable and along x, y, z
            (a destination's step along x is always 1)
    mirror  (variables,) int64: axis whose reflection changes the variable's sign, -1 for none
    """
    for r in range(first, last):
        nx, ny, nz, flips = table[r, 0], table[r, 1], table[r, 2], table[r, 3]
        d_first, d_variable, d_y, d_z = table[r, 4], table[r, 5], table[r, 7], table[r, 8]
        s_first, s_variable, s_x, s_y, s_z = table[r, 9], table[r, 10], table[r, 11], table[r, 12], table[r, 13]
        for variable in range(mirror.size):
            axis = mirror[variable]
            negate = axis >= 0 and (flips >> max(axis, 0)) & 1 == 1
            for z in range(nz):
                for y in range(ny):
                    d = d_first + variable * d_variable + y * d_y + z * d_z
                    s = s_first + variable * s_variable + y * s_y + z * s_z
                    if negate:
                        for x in range(nx):
                            destination[d + x] = -source[s + s_x * x]
                    else:
                        for x in range(nx):
                            destination[d + x] = source[s + s_x * x]


@driver
def copy_cells(begin, end, to, of, flips, parity, cells, field):
    """The cells `to` of a flat field get the values of the cells `of`, as seen in the mirrors of the bits of `flips`.

    parity (variables,): the axes, as bits, whose reflection changes the sign of each variable.
    """
    for n in range(begin, end):
        ghost, source = first_value(to[n], len(parity), cells), first_value(of[n], len(parity), cells)
        for v in range(len(parity)):
            value = field[source + v * cells]
            field[ghost + v * cells] = value if flips[n] & parity[v] == 0 else -value


@driver
def pack_cells(begin, end, of, flips, parity, cells, field, stride, column, packed):
    """Row n of `packed`, `stride` values long, gets the values of the cell of[n], from its `column` on, so mirrored."""
    for n in range(begin, end):
        source = first_value(of[n], len(parity), cells)
        for v in range(len(parity)):
            value = field[source + v * cells]
            packed[n * stride + column + v] = value if flips[n] & parity[v] == 0 else -value


@driver
def unpack_cells(begin, end, to, variables, cells, packed, stride, column, field):
    """The cells `to` of a flat field get what pack_cells() has packed."""
    for n in range(begin, end):
        ghost = first_value(to[n], variables, cells)
        for v in range(variables):
            field[ghost + v * cells] = packed[n * stride + column + v]
