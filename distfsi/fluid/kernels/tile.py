"""A tile of the fluid: where its cells, increments and fluxes are, whether it is at rest, what leaves the domain.

P holds one box of primitives per variable. T and F hold rows of increments and of fluxes in slots: slot 0 is of the
faces along x; 1 and 2 take turns at the low and high faces of a row along y; behind them are two for each row of a
plane, which take turns at its low and high faces along z.
"""

from typing import NamedTuple

from distfsi.device.markers import helper, load, real, store
from distfsi.fluid.kernels.records import (
    BLOCK,
    HIGH,
    LOW,
    METRICS,
    NX,
    NY,
    NZ,
    SIDES,
    VOLUME,
    X0,
    Y0,
    Z0,
    Box,
    CellFluxes,
    StageStep,
    StageTimes,
    States,
    Tiles,
    metrics_at,
    position_of,
)
from distfsi.fluid.kernels.rows import count_unlike, repeat_row
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import ASYMMETRIC, DIMENSIONS, FLUXES, GHOSTS, PHASES, RADIAL, VARIABLES


class Tile(NamedTuple):
    """A tile: its number and cells, where it lies in the states, and whether it is computed as one cell.

    state      index of its first cell in the states
    volume     and in the volumes
    next_y     step in both to the next cell along y
    next_z     along z
    variables  from a variable to the next
    x, y, z    its cells
    """

    number: int
    state: int
    volume: int
    next_y: int
    next_z: int
    variables: int
    x: int
    y: int
    z: int
    uniform: bool


@helper
def tile_at(t, tiles: Tiles, states: States, uniform):
    """The fields of Tile for tile number t."""
    next_y = states.now.shape[4]
    next_z = next_y * states.now.shape[3]
    variables = next_z * states.now.shape[2]
    block = tiles.table[t, BLOCK]
    first = tiles.table[t, Z0] * next_z + tiles.table[t, Y0] * next_y + tiles.table[t, X0]
    state = block * VARIABLES * variables + first
    volume = state - block * (VARIABLES - states.volumes.shape[1]) * variables
    cells = tiles.table[t, NX], tiles.table[t, NY], tiles.table[t, NZ]
    return (t, state, volume, next_y, next_z, variables, cells[0], cells[1], cells[2], uniform)


@helper
def step_of_tile(t, tiles: Tiles, times: StageTimes):
    """The fields of StageStep for tile number t, from the size of its block's cells: once, so that rows know it as a
    number."""
    b, dt = tiles.table[t, BLOCK], times.dt
    x, y, z = tuple(real(dt / tiles.spacing[b, d]) for d in static_range(3))
    return (times.b, real(dt), times.weight, x, y, z)


# ---- where things are ------------------------------------------------------------------------------------------------


@helper
def ghosts_y():
    """Layers of ghost cells along y."""
    return GHOSTS if DIMENSIONS > 1 else 0


@helper
def ghosts_z():
    """Layers of ghost cells along z."""
    return GHOSTS if DIMENSIONS > 2 else 0


@helper
def computed(cells, tile: Tile):
    """How many of a tile's cells along an axis are computed."""
    return 1 if tile.uniform else cells


@helper
def cell_of(j, k, box: Box):
    """Index in P of the first cell of row j in plane k, both counted without ghosts."""
    return ((k + ghosts_z()) * box.y + j + ghosts_y()) * box.x + GHOSTS


@helper
def increments_in(slot, box: Box):
    """Index in T of the increments of a row of cells."""
    return slot * (2 if ASYMMETRIC else 1) * VARIABLES * box.x


@helper
def fluxes_in(slot, box: Box):
    """Index in F of the fluxes through a row of faces, behind which their indicators are."""
    return slot * (FLUXES + 1) * box.x


@helper
def slots(box: Box):
    """How many slots T and F have."""
    return 3 + 2 * box.y


@helper
def slot_y(j):
    """Slot of what belongs to row j of cells and to the faces at its low side along y."""
    return 1 + j % 2


@helper
def slot_z(j, k, box: Box):
    """Slot of what belongs to row j in plane k of cells and to the faces at its low side along z."""
    return 3 + box.y * (k % 2) + j


@helper
def row_fluxes(j, k, box: Box):
    """The fields of CellFluxes for row j in plane k."""
    return (
        fluxes_in(0, box),
        fluxes_in(slot_y(j), box),
        fluxes_in(slot_y(j + 1), box),
        fluxes_in(slot_z(j, k, box), box),
        fluxes_in(slot_z(j, k + 1, box), box),
        box.x,
    )


@helper
def copy_metrics(tiles: Tiles, tile: Tile, box: Box, P):
    """The metrics of a tile's columns of cells, ghosts included, go behind its primitives."""
    block, first = tiles.table[tile.number, BLOCK], tiles.table[tile.number, X0] - GHOSTS
    for row in range(METRICS):
        for i in range(computed(tile.x, tile) + 2 * GHOSTS):
            store(P, metrics_at(row, i, box.x * box.y * box.z, box.x), tiles.metrics[block, row, first + i])


# ---- tiles at rest ---------------------------------------------------------------------------------------------------


@helper
def is_uniform(U, u, su, sz, sy, n, m, l):
    """Whether the box of n x m x l cells at U[u …] holds one state."""
    for k in range(l):
        for j in range(m):
            if count_unlike(U, u + k * sz + j * sy, u, su, n) > 0:
                return False
    return True


@helper
def holds_one_state(states: States, tile: Tile):
    """Whether all cells that a tile reads hold one state."""
    corner = tile.state - ghosts_z() * tile.next_z - ghosts_y() * tile.next_y - GHOSTS
    x, y, z = tile.x + 2 * GHOSTS, tile.y + 2 * ghosts_y(), tile.z + 2 * ghosts_z()
    return is_uniform(states.now, corner, tile.variables, tile.next_z, tile.next_y, x, y, z) and is_uniform(
        states.before, tile.state, tile.variables, tile.next_z, tile.next_y, tile.x, tile.y, tile.z
    )


@helper
def is_alike_everywhere(states: States, tile: Tile):
    """Whether a stage does the same to all cells of a tile."""
    alike = holds_one_state(states, tile)
    if RADIAL:
        alike = alike and load(states.now, tile.state + PHASES * tile.variables) == 0.0
    return alike


@helper
def is_unchanged(states: States, tile: Tile):
    """Whether the first cell of a tile has the same values in all three states."""
    unchanged = True
    for v in static_range(VARIABLES):
        at = tile.state + v * tile.variables
        value = load(states.after, at)
        unchanged = unchanged and load(states.now, at) == value and load(states.before, at) == value
    return unchanged


@helper
def repeat_first_cell(states: States, tile: Tile):
    """All cells of a tile get the new state of the first one."""
    for k in range(tile.z):
        for j in range(tile.y):
            row = tile.state + k * tile.next_z + j * tile.next_y
            repeat_row(states.after, row, tile.state, tile.variables, tile.x)


# ---- the domain's sides ----------------------------------------------------------------------------------------------


@helper
def face_size(tiles: Tiles, tile: Tile, side, i):
    """Area of face i of a row on a domain side, over that of a planar face."""
    block, x = tiles.table[tile.number, BLOCK], tiles.table[tile.number, X0]
    if side == 0:
        return tiles.metrics[block, LOW, x] * tiles.metrics[block, VOLUME, x]
    if side == 1:
        last = x + tile.x - 1
        return tiles.metrics[block, HIGH, last] * tiles.metrics[block, VOLUME, last]
    return tiles.metrics[block, VOLUME, x + i]


@helper
def account_faces(tiles: Tiles, tile: Tile, side, F, flux, rows, n, times, amount):
    """Add the flux through n faces in a row on a domain side to what has left through it, so many `times`; all faces
    of a uniform tile have the flux of the first."""
    step = 0 if tile.uniform else 1
    for v in static_range(PHASES + DIMENSIONS + 1):
        first = flux + position_of(v, side // 2) * rows
        if RADIAL:
            total = load(F, first) * face_size(tiles, tile, side, 0)
            for i in range(1, n):
                total = total + load(F, first + i * step) * face_size(tiles, tile, side, i)
        else:
            total = load(F, first)
            for i in range(1, n):
                total = total + load(F, first + i * step)
        for _ in range(times):
            tiles.through[tile.number, side, v] += total * amount


@helper
def account_sides(tiles: Tiles, tile: Tile, F, fluxes: CellFluxes, step: StageStep, j, k):
    """Account for the faces of row j in plane k that lie on a side of the domain, but for those at the low sides along
    y and z."""
    sides = tiles.table[tile.number, SIDES]
    n, m, l = computed(tile.x, tile), computed(tile.y, tile), computed(tile.z, tile)
    alike = tile.y * tile.z if tile.uniform else 1
    if sides & 1:
        account_faces(tiles, tile, 0, F, fluxes.x, fluxes.rows, 1, alike, step.weight * step.x)
    if sides & 2:
        account_faces(tiles, tile, 1, F, fluxes.x + n, fluxes.rows, 1, alike, step.weight * step.x)
    if DIMENSIONS > 1 and sides & 8 and j == m - 1:
        alike_y = tile.z if tile.uniform else 1
        account_faces(tiles, tile, 3, F, fluxes.y_high, fluxes.rows, tile.x, alike_y, step.weight * step.y)
    if DIMENSIONS > 2 and sides & 32 and k == l - 1:
        alike_z = tile.y if tile.uniform else 1
        account_faces(tiles, tile, 5, F, fluxes.z_high, fluxes.rows, tile.x, alike_z, step.weight * step.z)
