"""Ghost cells at the ends of the domain under a body force: their pressure is that of fluid at rest."""

from distfsi.device.markers import driver, helper, load, real, store
from distfsi.fluid.formulas.six_equation import mixture_density
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import BODY_FORCE, DIMENSIONS, GHOSTS, PHASES, VARIABLES, conserved, primitives
from distfsi.mesh.kernels.grid import BlockGrid, block_of, block_size, first_value

AT, OUT, AXIS, MIRRORED = range(4)  # columns of the table of columns of ghost cells


@helper
def primitives_at(U, at, cells):
    """Primitive state of a cell; `cells` of a block in memory."""
    first = first_value(at, VARIABLES, cells)
    return primitives(tuple(load(U, first + v * cells) for v in static_range(VARIABLES)))


@helper
def density_of(W):
    """[kg/m3] of a primitive state."""
    return W[0] if PHASES == 1 else mixture_density(W)


@driver
def weigh_ghosts(begin, end, columns, U, grid: BlockGrid):
    """After the ghosts of U are filled: those beyond the ends of the domain get the pressure of the cell that they
    repeat or mirror, and the weight of the fluid between.

    columns (n, 4): AT the last active cell, OUT the step in memory from there outwards, AXIS, and whether the ghosts
    are MIRRORED.
    """
    cells = block_size(grid)
    for n in range(begin, end):
        at, out, axis = columns[n, AT], columns[n, OUT], columns[n, AXIS]
        force = sum((BODY_FORCE[d] if axis == d else 0.0) for d in static_range(DIMENSIONS))
        fall = (1.0 if out > 0 else -1.0) * (force * real(grid.spacing[block_of(at, grid), axis]))
        weight, before = 0.0, 0.0
        for layer in range(GHOSTS):
            ghost = at + (layer + 1) * out
            inner = primitives_at(U, at - layer * out if columns[n, MIRRORED] > 0 else at, cells)
            rho = density_of(inner)
            weight += fall * (rho + before)
            before = rho if columns[n, MIRRORED] > 0 else 0.0
            W, p = primitives_at(U, ghost, cells), inner[PHASES + DIMENSIONS] + weight
            state = conserved(tuple(p if v == PHASES + DIMENSIONS else W[v] for v in static_range(VARIABLES)))
            for v in static_range(VARIABLES):
                store(U, first_value(ghost, VARIABLES, cells) + v * cells, state[v])
