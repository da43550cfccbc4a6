"""One fused Runge-Kutta stage of the fluid over tiles.

A tile is computed row by row (x fastest), so that its working set stays in the cache:

    primitives of the tile and its ghosts -> P
    for each row:  increments and fluxes along x; along y and z those of the row before roll forward
                   divergence, Runge-Kutta update and relaxation -> states.after

Where all cells that a tile reads hold the same state, all its cells get the same bits: it is computed as one cell. In
radial coordinates that needs a state without motion along r, too.
"""

from distfsi.device.markers import ByHand, driver, helper, real, workspace
from distfsi.fluid.kernels.records import (
    METRICS,
    SIDES,
    Box,
    CellFluxes,
    Cells,
    Faces,
    StageStep,
    StageTimes,
    States,
    Tiles,
)
from distfsi.fluid.kernels.rows import (
    bisect_cells,
    face_fluxes,
    increments_in_r_row,
    increments_row,
    primitives_row,
    update_row,
)
from distfsi.fluid.kernels.tile import (
    Tile,
    account_faces,
    account_sides,
    cell_of,
    computed,
    copy_metrics,
    fluxes_in,
    ghosts_y,
    ghosts_z,
    increments_in,
    is_alike_everywhere,
    is_unchanged,
    repeat_first_cell,
    row_fluxes,
    slot_y,
    slot_z,
    slots,
    step_of_tile,
    tile_at,
)
from distfsi.formulas.symbols import (
    BISECTION_FALLBACK,
    DIMENSIONS,
    GHOSTS,
    HYDROSTATIC,
    RADIAL,
    SHARES,
    TRANSVERSE_SENSOR,
    VARIABLES,
    falls,
)

# ---- rows of faces ---------------------------------------------------------------------------------------------------


@helper
def find_primitives(states: States, tile: Tile, box: Box, P):
    """P = primitives of the cells of a tile, of the ghosts that share a face with a row of them, and of those that the
    transverse pressure sensor looks at."""
    n, m, l = computed(tile.x, tile), computed(tile.y, tile), computed(tile.z, tile)
    variables = box.x * box.y * box.z
    for k in range(-ghosts_z(), l + ghosts_z()):
        for j in range(-ghosts_y(), m + ghosts_y()):
            beside = TRANSVERSE_SENSOR and j >= -1 and j <= m and k >= -1 and k <= l
            if (j >= 0 and j < m) or (k >= 0 and k < l) or beside:
                row = tile.state + k * tile.next_z + j * tile.next_y - GHOSTS
                first = cell_of(j, k, box) - GHOSTS
                primitives_row(states.now, P, row, tile.variables, first, variables, n + 2 * GHOSTS)


@helper
def fall_along(axis, step: StageStep):
    """g h of the body force along an axis [m2/s2]; 0 without one."""
    return falls(step.dt, step.x, step.y, step.z)[axis] if HYDROSTATIC else 0.0


@helper
def fluxes_x(tile: Tile, box: Box, step: StageStep, P, T, F, j, k):
    """Fluxes through the faces of row j in plane k along x; returns how many at low sides of cells were limited."""
    n, cell, variables = computed(tile.x, tile), cell_of(j, k, box) - 1, box.x * box.y * box.z
    if RADIAL:
        increments_in_r_row(P, T, cell, variables, increments_in(0, box), box.x, n + 2)
    else:
        increments_row(P, T, cell, variables, 1, increments_in(0, box), box.x, n + 2, fall_along(0, step))
    faces = Faces(
        cell=cell,
        variables=variables,
        across=1,
        beside_1=box.x,
        beside_2=box.x * box.y,
        low=increments_in(0, box),
        high=increments_in(0, box) + 1,
        flux=fluxes_in(0, box),
        rows=box.x,
        axis=0,
        rate=real(SHARES) * step.x,
    )
    return face_fluxes(P, T, F, faces, n + 1, n)


@helper
def find_increments_y(tile: Tile, box: Box, step: StageStep, P, T, j, k):
    """Increments of row j in plane k along y."""
    variables = box.x * box.y * box.z
    target = increments_in(slot_y(j + 2), box)
    n, fall = computed(tile.x, tile), fall_along(1, step)
    increments_row(P, T, cell_of(j, k, box), variables, box.x, target, box.x, n, fall)


@helper
def fluxes_y(tile: Tile, box: Box, step: StageStep, P, T, F, j, k, counted):
    """Fluxes through the faces at the low side of row j in plane k along y, after the increments of that row and the
    one before; returns how many of the first `counted` were limited."""
    faces = Faces(
        cell=cell_of(j - 1, k, box),
        variables=box.x * box.y * box.z,
        across=box.x,
        beside_1=1,
        beside_2=box.x * box.y,
        low=increments_in(slot_y(j + 1), box),
        high=increments_in(slot_y(j), box),
        flux=fluxes_in(slot_y(j), box),
        rows=box.x,
        axis=1,
        rate=real(SHARES) * step.y,
    )
    return face_fluxes(P, T, F, faces, computed(tile.x, tile), counted)


@helper
def find_increments_z(tile: Tile, box: Box, step: StageStep, P, T, j, k):
    """Increments of row j in plane k along z."""
    plane = box.x * box.y
    target = increments_in(slot_z(j, k + 2, box), box)
    n, fall = computed(tile.x, tile), fall_along(2, step)
    increments_row(P, T, cell_of(j, k, box), plane * box.z, plane, target, box.x, n, fall)


@helper
def fluxes_z(tile: Tile, box: Box, step: StageStep, P, T, F, j, k, counted):
    """Fluxes through the faces at the low side of row j in plane k along z, after the increments of that row and the
    one before; returns how many of the first `counted` were limited."""
    plane = box.x * box.y
    faces = Faces(
        cell=cell_of(j, k - 1, box),
        variables=plane * box.z,
        across=plane,
        beside_1=1,
        beside_2=box.x,
        low=increments_in(slot_z(j, k + 1, box), box),
        high=increments_in(slot_z(j, k, box), box),
        flux=fluxes_in(slot_z(j, k, box), box),
        rows=box.x,
        axis=2,
        rate=real(SHARES) * step.z,
    )
    return face_fluxes(P, T, F, faces, computed(tile.x, tile), counted)


@helper
def update_cells(states: States, tile: Tile, box: Box, step: StageStep, P, T, F, fluxes: CellFluxes, j, k):
    """states.after of the cells of row j in plane k, from the fluxes through their faces."""
    row = k * tile.next_z + j * tile.next_y
    n = computed(tile.x, tile)
    cells = Cells(
        state=tile.state + row,
        state_variables=tile.variables,
        primitive=cell_of(j, k, box),
        primitive_variables=box.x * box.y * box.z,
        volume=tile.volume + row,
    )
    unsettled = update_row(states, P, F, T, cells, fluxes, step, n)
    if BISECTION_FALLBACK and unsettled > 0:
        bisect_cells(states, P, F, T, cells, fluxes, step, n)


# ---- one tile -------------------------------------------------------------------------------------------------------


@helper
def advance_cells(states: States, tiles: Tiles, tile: Tile, box: Box, step: StageStep, P, T, F):
    """One stage of those cells of a tile that are computed; returns how many faces at their low sides were limited."""
    n, m, l = computed(tile.x, tile), computed(tile.y, tile), computed(tile.z, tile)
    sides = tiles.table[tile.number, SIDES]
    count = 0
    find_primitives(states, tile, box, P)
    if RADIAL:
        copy_metrics(tiles, tile, box, P)
    # the low side along z
    if DIMENSIONS > 2:
        for j in range(m):
            find_increments_z(tile, box, step, P, T, j, -1)
            find_increments_z(tile, box, step, P, T, j, 0)
            count += fluxes_z(tile, box, step, P, T, F, j, 0, n)
            if sides & 16:
                alike = tile.y if tile.uniform else 1
                flux = fluxes_in(slot_z(j, 0, box), box)
                account_faces(tiles, tile, 4, F, flux, box.x, tile.x, alike, step.weight * step.z)
    for k in range(l):
        # the low side along y of each plane
        if DIMENSIONS > 1:
            find_increments_y(tile, box, step, P, T, -1, k)
            find_increments_y(tile, box, step, P, T, 0, k)
            count += fluxes_y(tile, box, step, P, T, F, 0, k, n)
            if sides & 4:
                alike = tile.z if tile.uniform else 1
                flux = fluxes_in(slot_y(0), box)
                account_faces(tiles, tile, 2, F, flux, box.x, tile.x, alike, step.weight * step.y)
        for j in range(m):
            # faces along x, and those at the high sides of the row
            count += fluxes_x(tile, box, step, P, T, F, j, k)
            if DIMENSIONS > 1:
                find_increments_y(tile, box, step, P, T, j + 1, k)
                count += fluxes_y(tile, box, step, P, T, F, j + 1, k, n if j < m - 1 else 0)
            if DIMENSIONS > 2:
                find_increments_z(tile, box, step, P, T, j, k + 1)
                count += fluxes_z(tile, box, step, P, T, F, j, k + 1, n if k < l - 1 else 0)
            # the new state, and what left the domain
            fluxes = row_fluxes(j, k, box)
            update_cells(states, tile, box, step, P, T, F, fluxes, j, k)
            account_sides(tiles, tile, F, fluxes, step, j, k)
    return count


@helper
def advance_tile(states: States, tiles: Tiles, tile: Tile, box: Box, step: StageStep, P, T, F):
    """One stage of a tile, and how long it has been at rest."""
    tiles.limited[tile.number] += advance_cells(states, tiles, tile, box, step, P, T, F)
    if tile.uniform and not tiles.calm[tile.number]:
        repeat_first_cell(states, tile)
    rests = tile.uniform and is_unchanged(states, tile)
    tiles.stages[tile.number] = tiles.stages[tile.number] + 1 if rests else 0


STAGE_FORMULAS = (
    "primitives",
    "falls",
    "beyond_rest",
    "reconstructed",
    "reconstructed_in_r",
    "sharpened",
    "face_flux",
    "sound_speed",
    "limiter_indicator",
    "is_admissible",
    "limited_flux",
    "updated",
    "before_relaxation",
    "range_of_change",
    "halved_range",
    "fraction_after",
    "range_of_pressure",
    "range_of_growths",
    "halved_growths",
    "changes_between",
    "fractions_after",
)


def stage_block(constants, arguments):
    """A thread per column of a tile. Shared memory holds primitives and fluxes of it, in 3D of some planes; of two
    phases there also each thread's divergence and fluxes along z, which registers do not hold."""
    D = constants["DIMENSIONS"]
    px, py = int(arguments["box_x"]), int(arguments["box_y"])
    g = constants["GHOSTS"]
    x, y = px - 2 * g, py - (2 * g if D > 1 else 0)
    cells, faces = px * py * (2 * g if D > 2 else 1), (x + 1) * (y + (1 if D > 1 else 0))
    kept = 3 * x * y if D > 2 and constants["PHASES"] > 1 else 0
    shared = constants["VARIABLES"] * cells + constants["FLUXES"] * (faces + kept)
    return {"TILE_X": x, "TILE_Y": y, "THREADS": x * y, "SHARED": shared}


@ByHand("stage.cu", STAGE_FORMULAS, stage_block)
@driver
def advance_tiles(begin, end, chosen, tiles: Tiles, states: States, times: StageTimes, box: Box):
    """One Runge-Kutta stage of the tiles chosen[begin:end]; box: cells of a whole tile with ghosts."""
    P = workspace(VARIABLES * box.x * box.y * box.z + (METRICS * box.x if RADIAL else 0))
    T, F = workspace(increments_in(slots(box), box)), workspace(fluxes_in(slots(box), box))
    for at in range(begin, end):
        t = chosen[at]
        step = step_of_tile(t, tiles, times)
        seen = tile_at(t, tiles, states, False)
        tile = tile_at(t, tiles, states, tiles.calm[t] or is_alike_everywhere(states, seen))
        advance_tile(states, tiles, tile, box, step, P, T, F)
