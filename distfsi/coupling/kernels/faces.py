"""The flux through one face, by the rows of the fluid's stage, for the faces that a wall changes."""

from distfsi.device.markers import helper, real
from distfsi.fluid.kernels.records import Faces
from distfsi.fluid.kernels.rows import face_fluxes, increments_row, primitives_row
from distfsi.formulas.symbols import DIMENSIONS, TRANSVERSE_SENSOR, VARIABLES

# Cells that give the flux through one face: its line of four is the middle one of five.
BOX, LINE = 20, 8


@helper
def look_at_face(U, at, cells, steps, axis, P, T):
    """P, T = primitives and increments around the face between a cell `at` and the next along `axis`, by the rows of
    the stage.

    P holds five lines of four cells: the one through the face, and those beside it if the flux looks there.
    """
    first, step = at + at // cells * (VARIABLES - 1) * cells, steps[axis]
    for c in range(4):
        primitives_row(U, P, first + (c - 1) * step, cells, LINE + c, BOX, 1)
    if TRANSVERSE_SENSOR:
        for d in range(1, DIMENSIONS):
            beside = steps[(axis + d) % DIMENSIONS]
            for c in range(1, 3):
                primitives_row(U, P, first + (c - 1) * step - beside, cells, LINE + c - 4 * d, BOX, 1)
                primitives_row(U, P, first + (c - 1) * step + beside, cells, LINE + c + 4 * d, BOX, 1)
    increments_row(P, T, LINE + 1, BOX, 1, 0, 2, 2)


@helper
def flux_of_face(P, T, F, rates, axis):
    """F = flux through the face that was looked at, by the rows of the stage. rates (D,): dt/h per axis."""
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
        rate=real(2 * DIMENSIONS) * rates[axis],
    )
    face_fluxes(P, T, F, face, 1, 1)
