"""The flux through one face, by the rows of the fluid's stage, for the faces that a wall changes."""

from distfsi.device.markers import helper, real
from distfsi.fluid.kernels.records import Faces
from distfsi.fluid.kernels.rows import face_fluxes, increments_row, primitives_row
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import BODY_FORCE, DIMENSIONS, HYDROSTATIC, TRANSVERSE_SENSOR, VARIABLES
from distfsi.mesh.kernels.grid import BlockGrid, block_of, block_size, first_value

# Cells that give the flux through one face: its line of four is the middle one of five.
BOX, LINE = 20, 8


@helper
def fall_along(axis, dt, rate):
    """g h of the body force along an axis [m2/s2], to the bit as the stage finds it; 0 without one. rate: dt/h."""
    force = sum((BODY_FORCE[d] if axis == d else 0.0) for d in static_range(DIMENSIONS))
    return force * (real(dt) / real(rate)) if HYDROSTATIC else 0.0


@helper
def look_at_face(U, at, axis, dt, grid: BlockGrid, P, T):
    """P, T = primitives and increments around the face between a cell `at` and the next along `axis`, by the rows of
    the stage, which takes `dt` [s].

    P holds five lines of four cells: the one through the face, and those beside it if the flux looks there.
    """
    cells, step = block_size(grid), grid.steps[axis]
    first = first_value(at, VARIABLES, cells)
    # the line through the face
    for c in range(4):
        primitives_row(U, P, first + (c - 1) * step, cells, LINE + c, BOX, 1)
    # the lines beside it
    if TRANSVERSE_SENSOR:
        for d in range(1, DIMENSIONS):
            aside = grid.steps[(axis + d) % DIMENSIONS]
            for c in range(1, 3):
                primitives_row(U, P, first + (c - 1) * step - aside, cells, LINE + c - 4 * d, BOX, 1)
                primitives_row(U, P, first + (c - 1) * step + aside, cells, LINE + c + 4 * d, BOX, 1)
    h = grid.spacing[block_of(at, grid), axis]
    increments_row(P, T, LINE + 1, BOX, 1, 0, 2, 2, fall_along(axis, dt, dt / h))


@helper
def flux_of_face(P, T, F, rate, axis):
    """F = flux through the face that was looked at, by the rows of the stage; rate: dt/h [s/m]."""
    face = Faces(
        cell=LINE + 1,
        variables=BOX,
        across=1,
        beside_1=4,
        beside_2=8,
        low=0,
        high=1,
        flux=0,
        rows=2,
        axis=axis,
        rate=real(2 * DIMENSIONS) * real(rate),
    )
    face_fluxes(P, T, F, face, 1, 1)
