"""What the body force gives to the fluid."""

from distfsi.device.markers import driver, load
from distfsi.fluid.kernels.records import VOLUME
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import BODY_FORCE, DIMENSIONS, FRACTIONAL, GHOSTS, PHASES, RADIAL, VARIABLES
from distfsi.mesh.kernels.grid import BlockGrid, block_size, cell_at, cell_volume, first_value


@driver
def account_force(begin, end, U, volumes, metrics, given, rows, time, grid: BlockGrid):
    """given[r] (D + 1,) grows by the momentum [N s] and the work [J] that the body force gives in `time` [s] to the
    cells of row r in the states U; `rows`: of a block, along y; all rows of a block follow each other.

    metrics  (blocks, METRICS, X), if coordinates are RADIAL
    """
    cells = block_size(grid)
    planes = len(given) // (len(grid.extent) * rows)
    for r in range(begin, end):
        block, j, k = r // (rows * planes), r % rows, r // rows % planes
        if j < grid.extent[block, 1] and k < grid.extent[block, 2]:
            at = cell_at(block, 0, j, k, grid)
            row, volume = first_value(at, VARIABLES, cells), first_value(at, volumes.shape[1], cells)
            mass, power = 0.0, 0.0
            for i in range(grid.extent[block, 0]):
                part = load(volumes, volume + i) if FRACTIONAL else 1.0
                if RADIAL:
                    part = metrics[block, VOLUME, GHOSTS + i]
                if part > 0.0:
                    mass += part * sum(load(U, row + v * cells + i) for v in static_range(PHASES))
                    power += part * sum(
                        BODY_FORCE[d] * load(U, row + (PHASES + d) * cells + i) for d in static_range(DIMENSIONS)
                    )
            amount = time * cell_volume(block, grid)
            for d in static_range(DIMENSIONS):
                given[r, d] += amount * (BODY_FORCE[d] * mass)
            given[r, DIMENSIONS] += amount * power
