"""What the body force gives to the fluid."""

from distfsi.device.markers import driver, load
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import BODY_FORCE, DIMENSIONS, FRACTIONAL, PHASES, VARIABLES


@driver
def account_force(begin, end, U, volumes, given, start, extent, rows, time):
    """given[r] (D + 1,) grows by the momentum and the work that the body force gives in `time` [s] to the cells of row
    r in the states U, per volume of a cell.

    start: index of a block's first active cell within one variable; rows: of a block, along y; all of a block follow
    each other.
    """
    sy = U.shape[4]
    sz = sy * U.shape[3]
    su = sz * U.shape[2]
    planes = len(given) // (len(extent) * rows)
    for r in range(begin, end):
        block, j, k = r // (rows * planes), r % rows, r // rows % planes
        if j < extent[block, 1] and k < extent[block, 2]:
            within = start + k * sz + j * sy
            row, volume = block * VARIABLES * su + within, block * volumes.shape[1] * su + within
            mass, power = 0.0, 0.0
            for i in range(extent[block, 0]):
                part = load(volumes, volume + i) if FRACTIONAL else 1.0
                if part > 0.0:
                    mass += part * sum(load(U, row + v * su + i) for v in static_range(PHASES))
                    power += part * sum(
                        BODY_FORCE[d] * load(U, row + (PHASES + d) * su + i) for d in static_range(DIMENSIONS)
                    )
            for d in static_range(DIMENSIONS):
                given[r, d] += time * (BODY_FORCE[d] * mass)
            given[r, DIMENSIONS] += time * power
