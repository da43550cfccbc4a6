"""Copies of box-shaped regions of cells between flat arrays: ghost cells, message buffers, constants."""

from distfsi.device.markers import ByHand, driver


def region_block(constants, arguments):
    """The block's threads share the values of a region."""
    return {"THREADS": 128, "SHARED": 0}


@ByHand("regions.cu", (), region_block)
@driver
def copy_regions(first, last, table, destination, source, mirror):
    """Copy the regions of rows `first` to `last` (excluded) of `table` from flat array `source` to `destination`.

    table   (regions, 14) int64: cells along x, y, z; flips (bit a: mirrored along axis a); then for the destination and
            for the source the place of the first value and the steps from variable to variable and along x, y, z
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
