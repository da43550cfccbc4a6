"""The flux through one face, by the rows of the fluid's stage, for the faces that a wall changes."""

from distfsi.device.markers import helper, real
from distfsi.fluid.kernels.stage import face_fluxes, primitives_row, rises_row
from distfsi.formulas.symbols import DIMENSIONS, LOOKS_SIDEWAYS, VARIABLES

# Cells that give the flux through one face: its line of four is the middle one of five.
BOX, LINE = 20, 8


@helper
def look_at_face(U, at, cells, steps, axis, P, T):
    """P, T = primitives and rises around the face between a cell `at` and the next along `axis`, by the stage's rows.

    P holds five lines of four cells: the one through the face, and those beside it if the flux looks there.
    """
    first, step = at + at // cells * (VARIABLES - 1) * cells, steps[axis]
    for c in range(4):
        primitives_row(U, P, first + (c - 1) * step, cells, LINE + c, BOX, 1)
    if LOOKS_SIDEWAYS:
        for d in range(1, DIMENSIONS):
            beside = steps[(axis + d) % DIMENSIONS]
            for c in range(1, 3):
                primitives_row(U, P, first + (c - 1) * step - beside, cells, LINE + c - 4 * d, BOX, 1)
                primitives_row(U, P, first + (c - 1) * step + beside, cells, LINE + c + 4 * d, BOX, 1)
    rises_row(P, T, LINE + 1, BOX, 1, 0, 2, 2)


@helper
def flux_of_face(P, T, F, rates, axis):
    """F = flux through the face that was looked at, by the rows of the stage. rates (D,): dt/h per axis."""
    face_fluxes(P, T, F, LINE + 1, BOX, 1, 4, 8, 0, 1, 2, 0, axis, real(2 * DIMENSIONS) * rates[axis], 1, 1)
