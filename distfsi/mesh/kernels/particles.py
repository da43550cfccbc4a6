"""Loops over particles for those who bring them to ranks: their blocks, who is near what, mirror images."""

from distfsi.device.markers import driver
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS
from distfsi.mesh.kernels.grid import BlockGrid, BlockTable, block_at, block_coordinate
from distfsi.mesh.kernels.rows import count_marked, extend, list_marked, pack_rows, take_rows

IMAGES = 8  # an id and its images: a key is 8 id + the axes that an image is mirrored along (bit a: axis a)


@driver
def find_moved(begin, end, chunk, position, block, grid: BlockGrid, table: BlockTable, moved):
    """block[i] = number of a particle's block; moved[c] = how many of chunk c were in another one."""
    for c in range(begin, end):
        found = 0
        for i in range(c * chunk, min((c + 1) * chunk, len(block))):
            now = block_at(position, i, grid, table)
            if block[i] != now:
                found += 1
            block[i] = now
        moved[c] = found


@driver
def find_border(
    begin, end, position, reach, axes, lowest, highest, grid: BlockGrid, table: BlockTable, owners, rank, mark
):
    """mark[i] = 1 for particles within `reach` of another rank's blocks, or with an image, else 0.

    axes, lowest, highest (n,): those between the two [m] along an axis have one; owners (all blocks,): of blocks.
    """
    for i in range(begin, end):
        near = 0
        # planes
        for n in range(len(axes)):
            if lowest[n] <= position[i, axes[n]] and position[i, axes[n]] <= highest[n]:
                near = 1
        # blocks of other ranks
        low = tuple(block_coordinate(position[i, d] - reach, d, grid, table) for d in static_range(DIMENSIONS))
        high = tuple(block_coordinate(position[i, d] + reach, d, grid, table) for d in static_range(DIMENSIONS))
        y_first, y_last = (low[1], high[1]) if DIMENSIONS > 1 else (0, 0)
        z_first, z_last = (low[2], high[2]) if DIMENSIONS > 2 else (0, 0)
        for x in range(low[0], high[0] + 1):
            for y in range(y_first, y_last + 1):
                for z in range(z_first, z_last + 1):
                    if owners[table.curve_index[x, y, z]] != rank:
                        near = 1
        mark[i] = near


@driver
def mirror_values(begin, end, first, width, source, mask, parity, values):
    """Rows first … of the flat values = those of the images' sources as seen in the mirrors of the bits of `mask`.

    parity (width,): the axes, as bits, whose reflection changes the sign of each component.
    """
    for m in range(begin, end):
        for k in range(width):
            flips = mask[m] & parity[k]
            value = values[source[m] * width + k]
            odd = ((flips & 1) + (flips >> 1 & 1) + (flips >> 2 & 1)) & 1
            values[(first + m) * width + k] = -value if odd == 1 else value


@driver
def position_images(begin, end, first, width, source, mask, shifted, plane, values):
    """As mirror_values(), of positions: `plane` (images, width) holds the positions of the mirrors or, for the axes in
    the bits of `shifted`, how far images are aside."""
    for m in range(begin, end):
        for k in range(width):
            value = values[source[m] * width + k]
            image = plane[m, k] + value if shifted >> k & 1 == 1 else 2.0 * plane[m, k] - value
            values[(first + m) * width + k] = image if mask[m] >> k & 1 == 1 else value


# What mesh/particles.py needs of these and of mesh/kernels/rows.py.
EXCHANGE = (
    find_moved,
    find_border,
    mirror_values,
    position_images,
    count_marked,
    list_marked,
    take_rows,
    pack_rows,
    extend,
)
