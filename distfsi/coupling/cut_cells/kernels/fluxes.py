"""Loops of the band's fluxes: through open faces, and the wall's.

Faces are computed LANES at a time, so that a CPU does them side by side; all quantities of those are LANES apart.
"""

from typing import NamedTuple

from distfsi.coupling.cut_cells.kernels.records import (
    Band,
    Contents,
    States,
    WallLoads,
    Walls,
    aperture_at,
    put_content,
    state_at,
    volume_at,
)
from distfsi.coupling.cut_cells.kernels.redistribution import repeat_lane
from distfsi.coupling.formulas.moving_wall import normal_of, stage_content, wall_impedance, wall_pressure
from distfsi.coupling.kernels.cells import FLUID
from distfsi.coupling.kernels.faces import BOX, LINE, fall_along, flux_of_face, look_at_face
from distfsi.device.markers import driver, helper, load, real, row, store, workspace
from distfsi.fluid.kernels.records import Faces, position_of
from distfsi.fluid.kernels.rows import density_at, face_fluxes, increments_row, primitives_row
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    DIMENSIONS,
    FLUXES,
    HYDROSTATIC,
    LANES,
    PHASES,
    TRANSVERSE_SENSOR,
    VARIABLES,
    primitives,
)
from distfsi.formulas.tensors import dot
from distfsi.mesh.kernels.grid import BlockGrid, block_of, block_size, cell_volume, first_value

STOPS_LOW, STOPS_HIGH = 1, 2


class StageTimes(NamedTuple):
    """A stage of a step: b of the Runge-Kutta method, dt [s] of the step, weight [s]: that times the stage's share."""

    b: float
    dt: float
    weight: float


# ---- faces ----------------------------------------------------------------------------------------------------------


@helper
def aperture_between(walls: Walls, at, axis, grid: BlockGrid):
    """Aperture of the low face of a cell along an axis; no fluid enters covered cells."""
    both = walls.kind[at] == FLUID and walls.kind[at - grid.steps[axis]] == FLUID
    return aperture_at(walls, at, axis, block_size(grid)) if both else 0.0


@driver
def find_walls(begin, end, cells, aperture, area, walls: Walls, grid: BlockGrid):
    """aperture (n, 2 D) of a cell's faces, low and high along each axis; area (n, D) [1/m] = the wall's area per volume
    of the cell, along its normal into the solid: it closes what these leave open."""
    for n in range(begin, end):
        for axis in range(DIMENSIONS):
            low = aperture_between(walls, cells[n], axis, grid)
            high = aperture_between(walls, cells[n] + grid.steps[axis], axis, grid)
            aperture[n, 2 * axis] = low
            aperture[n, 2 * axis + 1] = high
            area[n, axis] = (low - high) / grid.spacing[block_of(cells[n], grid), axis]


@driver
def find_faces(begin, end, band: Band, seen, walls: Walls, grid: BlockGrid):
    """seen (D, n, 2) = 1 for open faces of the band's cells, else 0: the low one along each axis, and the high one
    unless the cell above it is in the band too; more where it stops the slopes of the cell before (STOPS_LOW) or
    behind (STOPS_HIGH)."""
    for n in range(begin, end):
        for axis in range(DIMENSIONS):
            step = grid.steps[axis]
            for side in range(2):
                face, own = 0, side == 0 or band.above[n, axis] < 0
                if own and band.aperture[n, 2 * axis + side] > 0.0:
                    low = band.cells[n] + (side - 1) * step
                    before = aperture_between(walls, low, axis, grid) > 0.0
                    behind = aperture_between(walls, low + 2 * step, axis, grid) > 0.0
                    face = 1 + (0 if before else STOPS_LOW) + (0 if behind else STOPS_HIGH)
                seen[(axis * len(band.cells) + n) * 2 + side] = face


# ---- fluxes through open faces --------------------------------------------------------------------------------------


@helper
def look_at_faces(U, Q, at, lane, axis, grid: BlockGrid):
    """Q = the states around the face between a cell `at` and the next along `axis`, of a `lane` in boxes of LANES."""
    cells, step = block_size(grid), grid.steps[axis]
    first = first_value(at, VARIABLES, cells)
    for v in range(VARIABLES):
        for c in range(4):
            store(Q, (v * BOX + LINE + c) * LANES + lane, load(U, first + v * cells + (c - 1) * step))
        if TRANSVERSE_SENSOR:
            for d in range(1, DIMENSIONS):
                aside = grid.steps[(axis + d) % DIMENSIONS]
                for c in range(1, 3):
                    other = first + v * cells + (c - 1) * step
                    store(Q, (v * BOX + LINE + c - 4 * d) * LANES + lane, load(U, other - aside))
                    store(Q, (v * BOX + LINE + c + 4 * d) * LANES + lane, load(U, other + aside))


@helper
def primitives_of_faces(Q, P):
    """P = primitives of the states Q around LANES faces."""
    primitives_row(Q, P, LINE * LANES, BOX * LANES, LINE * LANES, BOX * LANES, 4 * LANES)
    if TRANSVERSE_SENSOR:
        for line in range(1 - DIMENSIONS, DIMENSIONS):
            if line != 0:
                first = (LINE + 4 * line + 1) * LANES
                primitives_row(Q, P, first, BOX * LANES, first, BOX * LANES, 2 * LANES)


@helper
def stop_slopes(P, T, i, stops, fall):
    """The face in lane i gets no increments of the cells whose slopes it stops, but for the weight of a body force,
    with g h along the face's axis."""
    stops_low = stops == STOPS_LOW or stops == STOPS_LOW + STOPS_HIGH
    for v in range(VARIABLES):
        if stops_low:
            store(T, 2 * v * LANES + i, 0.0)
        if stops >= STOPS_HIGH:
            store(T, (2 * v + 1) * LANES + i, 0.0)
    if HYDROSTATIC:
        low, pressure = (LINE + 1) * LANES + i, PHASES + DIMENSIONS
        if stops_low:
            store(T, 2 * pressure * LANES + i, 0.5 * fall * density_at(P, low, BOX * LANES))
        if stops >= STOPS_HIGH:
            store(T, (2 * pressure + 1) * LANES + i, 0.5 * fall * density_at(P, low + LANES, BOX * LANES))


@helper
def run_of_axis(faces, first, last, per_axis):
    """How many of the faces first … last lie along the same axis as the first."""
    n = 1
    while first + n < last and faces[first + n] // per_axis == faces[first] // per_axis:
        n += 1
    return n


@driver
def find_fluxes(begin, end, cells, faces, seen, flux, U, dt, grid: BlockGrid):
    """flux (n, 2 D FLUXES) = what passes the `faces` (m,), indices in `seen` as find_faces() left it, in ascending
    order, of the band's `cells`, which all have one size. An item is a box of LANES faces."""
    per_axis = 2 * len(cells)
    Q, P = workspace(BOX * VARIABLES * LANES), workspace(BOX * VARIABLES * LANES)
    T, F = workspace(2 * VARIABLES * LANES), workspace((2 * FLUXES + 2) * LANES)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(faces))
        while first < last:
            # primitives around faces along one axis
            axis, n = faces[first] // per_axis, run_of_axis(faces, first, last, per_axis)
            for i in range(LANES):
                face = faces[first + min(i, n - 1)]
                at = cells[face % per_axis // 2] + (face % 2 - 1) * grid.steps[axis]
                look_at_faces(U, Q, at, i, axis, grid)
            primitives_of_faces(Q, P)
            # their reconstruction, which ends at the wall
            h = grid.spacing[block_of(cells[faces[first] % per_axis // 2], grid), axis]
            c, fall = (LINE + 1) * LANES, fall_along(axis, dt, dt / h)
            increments_row(P, T, c, BOX * LANES, LANES, 0, 2 * LANES, 2 * LANES, fall)
            for i in range(n):
                stop_slopes(P, T, i, seen[faces[first + i]] - 1, fall)
            # fluxes
            faces_of_box = Faces(
                cell=c,
                variables=BOX * LANES,
                across=LANES,
                beside_1=4 * LANES,
                beside_2=8 * LANES,
                low=0,
                high=LANES,
                flux=0,
                rows=2 * LANES,
                axis=axis,
                rate=real(2 * DIMENSIONS) * real(dt / h),
            )
            face_fluxes(P, T, F, faces_of_box, LANES, LANES)
            for i in range(n):
                face = faces[first + i]
                m, to = face % per_axis // 2, (2 * axis + face % 2) * FLUXES
                for v in range(FLUXES):
                    flux[m, to + v] = load(F, 2 * position_of(v, axis) * LANES + i)
            first += n


# ---- the update of the band -----------------------------------------------------------------------------------------


@helper
def add_fluxes(D, n, band: Band, flux, dt, grid: BlockGrid):
    """D (FLUXES,) = dt times the divergence of the fluxes of find_fluxes() in the cell number n of the band."""
    b = block_of(band.cells[n], grid)
    for v in range(FLUXES):
        D[v] = 0.0
    for axis in range(DIMENSIONS):
        for side in range(2):
            between = band.aperture[n, 2 * axis + side]
            if between > 0.0:
                rate = (2 * side - 1) * real(dt / grid.spacing[b, axis]) * between
                shared = side == 1 and band.above[n, axis] >= 0
                m, first = (band.above[n, axis] if shared else n), (2 * axis + (0 if shared else side)) * FLUXES
                for v in range(FLUXES):
                    D[v] += rate * flux[m, first + v]


@helper
def push_wall(D, n, now, freed, area, loads: WallLoads, stage: StageTimes):
    """The wall in the cell number n of the band, of a state `now`, adds to dt times the divergence D, and to what it
    gets."""
    wall = tuple(loads.velocity[n, d] for d in static_range(DIMENSIONS))
    size, normal = normal_of(area)
    if size > 0.0:
        W = primitives(now)
        relative = tuple(W[PHASES + d] - wall[d] for d in static_range(DIMENSIONS))
        approach = dot(relative, normal)
        p = wall_pressure(now, W, approach)
        loads.added[n] += stage.weight * wall_impedance(now, W, approach) * size
        for d in static_range(DIMENSIONS):
            D[PHASES + d] += stage.dt * p * area[d]
            loads.impulse[n, d] += stage.weight * p * area[d]
        D[PHASES + DIMENSIONS] += freed * p
        loads.work[n] += stage.weight * p * dot(area, wall)


@row
def content_row(S, Q, b, dt, n):
    """Q = contents after a stage of the n cells whose states before the step and now, volumes then and now, part that
    the wall has freed, and divergence stand in S; values of a cell are LANES apart."""
    for i in range(n):
        # states before the step and now, volumes then and now, divergence, freed part
        content = stage_content(
            tuple(load(S, v * LANES + i) for v in static_range(VARIABLES)),
            tuple(load(S, (VARIABLES + v) * LANES + i) for v in static_range(VARIABLES)),
            load(S, 2 * VARIABLES * LANES + i),
            load(S, (2 * VARIABLES + 1) * LANES + i),
            tuple(load(S, (2 * VARIABLES + 3 + v) * LANES + i) for v in static_range(FLUXES)),
            load(S, (2 * VARIABLES + 2) * LANES + i),
            b,
            dt,
        )
        for v in static_range(VARIABLES):
            store(Q, v * LANES + i, content[v])
        if PHASES == 2:
            store(Q, VARIABLES * LANES + i, content[VARIABLES])
            store(Q, (VARIABLES + 1) * LANES + i, content[VARIABLES + 1])


@helper
def put_lane(S, i, before, now, start, volume, freed, D):
    """Lane i of S = what content_row() wants to know of a cell."""
    for v in static_range(VARIABLES):
        store(S, v * LANES + i, before[v])
        store(S, (VARIABLES + v) * LANES + i, now[v])
    store(S, 2 * VARIABLES * LANES + i, start)
    store(S, (2 * VARIABLES + 1) * LANES + i, volume)
    store(S, (2 * VARIABLES + 2) * LANES + i, freed)
    for v in range(FLUXES):
        store(S, (2 * VARIABLES + 3 + v) * LANES + i, D[v])


@driver
def advance_band(
    begin,
    end,
    band: Band,
    flux,
    before,
    start_volume,
    now: States,
    after: Contents,
    loads: WallLoads,
    stage: StageTimes,
    grid: BlockGrid,
):
    """One stage of the band's cells, from the `flux` of find_fluxes(): their contents `after` it. An item is a box of
    LANES cells.

    before (blocks, VARIABLES, Z, Y, X), start_volume (n,): states and volumes of fluid before the step; `now` and
    `after` share their volumes. The loads on the wall grow.
    """
    cells = block_size(grid)
    D, S, Q = workspace(FLUXES), workspace((2 * VARIABLES + 3 + FLUXES) * LANES), workspace((VARIABLES + 2) * LANES)
    for box in range(begin, end):
        first = box * LANES
        lanes = min(LANES, len(band.cells) - first)
        for i in range(lanes):
            # divergence of the fluxes through open faces
            n, at = first + i, band.cells[first + i]
            add_fluxes(D, n, band, flux, stage.dt, grid)
            # the wall's part in it, and the volume that the wall frees
            area = tuple(band.area[n, d] for d in static_range(DIMENSIONS))
            wall = tuple(loads.velocity[n, d] for d in static_range(DIMENSIONS))
            freed = real(stage.dt * dot(area, wall))  # the same to the bit in volume and content
            state = state_at(now.U, at, cells)
            push_wall(D, n, state, freed, area, loads, stage)
            # volume by the geometric conservation law
            start, volume = start_volume[n], load(now.volume, volume_at(at, cells))
            put_lane(S, i, state_at(before, at, cells), state, start, volume, freed, D)
            store(after.volume, volume_at(at, cells), start + stage.b * (volume + freed - start))
        # contents
        repeat_lane(S, 2 * VARIABLES + 3 + FLUXES, lanes)
        content_row(S, Q, stage.b, stage.dt, LANES)
        for i in range(lanes):
            content = tuple(load(Q, v * LANES + i) for v in static_range(VARIABLES + 2))
            put_content(after.Q, after.volume, band.cells[first + i], cells, content)


# ---- the domain's ends ----------------------------------------------------------------------------------------------


@helper
def stop_at_wall(walls: Walls, at, axis, dt, P, T, grid: BlockGrid):
    """Set increments T around the face between a cell and the next along `axis` to 0, or to the weight of a body force,
    where one of the cells that make them is covered or behind a closed face; returns the aperture of the face."""
    step, h = grid.steps[axis], grid.spacing[block_of(at, grid), axis]
    between = aperture_between(walls, at + step, axis, grid)
    for c in range(2):
        beyond = aperture_between(walls, at + 2 * c * step, axis, grid)
        if not (between > 0.0 and beyond > 0.0):
            for v in range(VARIABLES):
                T[2 * v + c] = 0.0
            if HYDROSTATIC:
                T[2 * (PHASES + DIMENSIONS) + c] = 0.5 * fall_along(axis, dt, dt / h) * density_at(P, LINE + 1 + c, BOX)
    return between


@driver
def account_sides(begin, end, chosen, side_cells, side, passed, U, walls: Walls, dt, weight, grid: BlockGrid):
    """passed[n] grows by what the fluid's stage counts as leaving through a domain's side, side[n] = 2 axis + (0 low,
    1 high), beyond what leaves there, for the cells `chosen`. dt [s]: of the step; weight [s]: that times the stage's
    share.
    """
    P, T, F = workspace(BOX * VARIABLES), workspace(2 * VARIABLES), workspace(2 * FLUXES + 2)
    for m in range(begin, end):
        n = chosen[m]
        axis, high = side[n] // 2, side[n] % 2
        low_cell = side_cells[n] if high == 1 else side_cells[n] - grid.steps[axis]
        b = block_of(low_cell, grid)
        amount = (2 * high - 1) * (weight * cell_volume(b, grid) / grid.spacing[b, axis])
        for seen in range(2):  # first as the stage does, which sees no wall
            look_at_face(U, low_cell, axis, dt, grid, P, T)
            if seen == 1:
                amount = -amount * stop_at_wall(walls, low_cell, axis, dt, P, T, grid)
            if amount != 0.0:
                flux_of_face(P, T, F, dt / grid.spacing[b, axis], axis)
                for v in range(PHASES + DIMENSIONS + 1):
                    passed[n, v] += amount * load(F, 2 * position_of(v, axis))
