"""What the loops of the fluid are given, and how they name variables.

Arrays of cells are flat; cells of a row lie next to each other. P holds primitives of a tile and its ghosts, T the
increments to faces of some rows, F the fluxes through faces of some rows. Fluxes have their velocity components rotated
so that the normal one comes first.
"""

from typing import Any, NamedTuple

from distfsi.device.markers import helper
from distfsi.formulas.symbols import DIMENSIONS, PHASES, VARIABLES

# Columns of the table of tiles: the block, the first cell (counted with ghosts), the cells, which domain sides the tile
# touches (bits).
BLOCK, X0, Y0, Z0, NX, NY, NZ, SIDES = range(8)

# Rows of the metrics, of each column of cells along the first axis, h being their width:
#   LOW, HIGH  area of its low and of its high face, in volumes/h
#   VOLUME     over that of a planar cell
#   NEARNESS   h over the distance of its centroid from that of the column before
#   TO_LOW     from the low face to the centroid, in h
#   STRETCH    area of its low face in volumes/h of the smaller of the two cells there
#   UNIT       1, as STRETCH of faces along the other axes
METRICS = 7
LOW, HIGH, VOLUME, NEARNESS, TO_LOW, STRETCH, UNIT = range(METRICS)


class States(NamedTuple):
    """The states of a stage.

    before   (blocks, VARIABLES, Z, Y, X) before the step; may be `now`
    now      before the stage
    after    after the stage
    volumes  (blocks, fields, Z, Y, X): the first field is the share of each cell that is fluid, if it is FRACTIONAL
    """

    before: Any
    now: Any
    after: Any
    volumes: Any


class Tiles(NamedTuple):
    """The tiles of a rank's blocks.

    table    (tiles, 8) BLOCK … SIDES
    calm     (tiles,) which are known to stay as they are, also in States.after; only their flux is accounted
    stages   (tiles + 1,) for how many stages in a row each has not changed; counted here
    through  (tiles, 6, conserved) what has left through the domain's sides, per area of a face
    limited  (tiles,) faces at the low sides of its cells whose flux was limited
    metrics  (blocks, METRICS, X) of each column of cells, if coordinates are RADIAL
    spacing  (blocks, 3) size of the cells of each block [m]
    """

    table: Any
    calm: Any
    stages: Any
    through: Any
    limited: Any
    metrics: Any
    spacing: Any


class Box(NamedTuple):
    """Cells of a whole tile with its ghosts along x, y, z."""

    x: int
    y: int
    z: int


class StageTimes(NamedTuple):
    """One stage of a time step of `dt` [s]: after = before + b (now + change - before); `weight`: its share in it."""

    b: float
    dt: float
    weight: float


class StageStep(NamedTuple):
    """The stage of cells of one size.

    x, y, z  dt/h along the axes [s/m]
    """

    b: float
    dt: float
    weight: float
    x: float
    y: float
    z: float


class Faces(NamedTuple):
    """A row of faces, each between a cell and the next one along an axis.

    cell       index in P of the cell at the low side of the first face
    variables  step in P from a variable to the next
    across     step in P to the cell at the high side
    beside_1   step in P to the next cell along one of the other axes
    beside_2   and along the last one
    low, high  index in T of the increments of the cells at the low and at the high side
    flux       index in F of the flux through the first face
    rows       step in T and F from a variable to the next
    axis       normal to the faces
    rate       faces of a cell * dt/h
    """

    cell: int
    variables: int
    across: int
    beside_1: int
    beside_2: int
    low: int
    high: int
    flux: int
    rows: int
    axis: int
    rate: float


class Cells(NamedTuple):
    """A row of cells: index of the first in the states, in P and in the volumes; steps from a variable to the next."""

    state: int
    state_variables: int
    primitive: int
    primitive_variables: int
    volume: int


class CellFluxes(NamedTuple):
    """Index in F of the fluxes through the low face of a row's first cell along x, and through the low and high faces
    along y and z; step in F from a variable to the next."""

    x: int
    y_low: int
    y_high: int
    z_low: int
    z_high: int
    rows: int


@helper
def variable_at(position, axis):
    """The variable that stands at a position when the velocity along `axis` comes first."""
    if position >= PHASES and position < PHASES + DIMENSIONS:
        return PHASES + (position - PHASES + axis) % DIMENSIONS
    return position


@helper
def position_of(variable, axis):
    """Where a variable stands when the velocity along `axis` comes first."""
    if variable >= PHASES and variable < PHASES + DIMENSIONS:
        return PHASES + (variable - PHASES + DIMENSIONS - axis) % DIMENSIONS
    return variable


@helper
def metrics_at(row, cell, variables, rows):
    """Index in P of a row of the metrics, at the column of P[cell]: they lie behind a tile's primitives, whose rows of
    cells have so many columns."""
    return VARIABLES * variables + row * rows + cell % rows
