"""Loops over the band of cells around the wall: fluxes through open faces and the wall's.

Faces are computed LANES at a time, so that a CPU does them side by side; all quantities of those are LANES apart.
"""

from distfsi.coupling.cut_cells.kernels.geometry import opening
from distfsi.coupling.cut_cells.kernels.redistribution import put_content, repeat_lane, share_at, state_at
from distfsi.coupling.formulas.moving_wall import normal_of, stage_content, wall_impedance, wall_pressure
from distfsi.coupling.kernels.cells import FLUID
from distfsi.coupling.kernels.faces import BOX, LINE, flux_of_face, look_at_face
from distfsi.device.markers import driver, helper, load, real, row, store, workspace
from distfsi.fluid.kernels.records import Faces, position_of
from distfsi.fluid.kernels.rows import face_fluxes, increments_row, primitives_row
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, FLUXES, LANES, PHASES, TRANSVERSE_SENSOR, VARIABLES, primitives
from distfsi.formulas.tensors import dot

STOPS_LOW, STOPS_HIGH = 1, 2


@helper
def open_between(kind, old, new, at, axis, step, cells):
    """Open part of the face between a cell and the one a `step` below along the axis; no fluid enters covered cells."""
    both = kind[at] == FLUID and kind[at - step] == FLUID
    return opening(old, new, at, axis, cells) if both else 0.0


@helper
def see_wall(kind, old, new, at, cells, step, axis, T):
    """Set increments T around the face between a cell and the next along `axis` to 0 where one of the cells that make
    them is covered or behind a closed face; returns the open part of the face."""
    between = open_between(kind, old, new, at + step, axis, step, cells)
    for c in range(2):
        beyond = open_between(kind, old, new, at + 2 * c * step, axis, step, cells)
        if not (between > 0.0 and beyond > 0.0):
            for v in range(VARIABLES):
                T[2 * v + c] = 0.0
    return between


@driver
def find_walls(begin, end, band, area, opened, kind, old, new, shape, steps, spacing):
    """opened (n, 2 D) = the open parts of a cell's faces, low and high along each axis; area (n, D) [1/m] = the wall's
    area per volume of the cell, along its normal into the solid: it closes what these leave open."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        for axis in range(DIMENSIONS):
            step = steps[axis]
            low = open_between(kind, old, new, band[n], axis, step, cells)
            high = open_between(kind, old, new, band[n] + step, axis, step, cells)
            opened[n, 2 * axis] = low
            opened[n, 2 * axis + 1] = high
            area[n, axis] = (low - high) / spacing[axis]


@driver
def find_faces(begin, end, band, above, opened, seen, kind, old, new, shape, steps):
    """seen (D, n, 2) = 1 for open faces of the band's cells, else 0: the low one along each axis, and the high one
    unless the cell `above` (n, D) it is in the band too; more where it stops the slopes of the cell before
    (STOPS_LOW) or behind (STOPS_HIGH)."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        for axis in range(DIMENSIONS):
            step = steps[axis]
            for side in range(2):
                face, own = 0, side == 0 or above[n, axis] < 0
                if own and opened[n, 2 * axis + side] > 0.0:
                    low = band[n] + (side - 1) * step
                    before = open_between(kind, old, new, low, axis, step, cells) > 0.0
                    behind = open_between(kind, old, new, low + 2 * step, axis, step, cells) > 0.0
                    face = 1 + (0 if before else STOPS_LOW) + (0 if behind else STOPS_HIGH)
                seen[(axis * len(band) + n) * 2 + side] = face


@helper
def look_at_faces(U, Q, P, at, lane, cells, steps, axis):
    """Q = the states around the face between a cell `at` and the next along `axis`, of a `lane` in boxes of LANES."""
    first, step = at + at // cells * (VARIABLES - 1) * cells, steps[axis]
    for v in range(VARIABLES):
        for c in range(4):
            store(Q, (v * BOX + LINE + c) * LANES + lane, load(U, first + v * cells + (c - 1) * step))
        if TRANSVERSE_SENSOR:
            for d in range(1, DIMENSIONS):
                beside = steps[(axis + d) % DIMENSIONS]
                for c in range(1, 3):
                    place_there = first + v * cells + (c - 1) * step
                    store(Q, (v * BOX + LINE + c - 4 * d) * LANES + lane, load(U, place_there - beside))
                    store(Q, (v * BOX + LINE + c + 4 * d) * LANES + lane, load(U, place_there + beside))


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
def run_of_axis(faces, first, last, per_axis):
    """How many of the faces first … last lie along the same axis as the first."""
    n = 1
    while first + n < last and faces[first + n] // per_axis == faces[first] // per_axis:
        n += 1
    return n


@driver
def find_fluxes(begin, end, band, faces, seen, flux, U, shape, steps, rates):
    """flux (n, 2 D FLUXES) = what passes the `faces` (m,), places in `seen` as find_faces() left it, in ascending
    order. An item is a box of LANES faces."""
    cells, per_axis = shape[0] * shape[1] * shape[2], 2 * len(band)
    Q, P = workspace(BOX * VARIABLES * LANES), workspace(BOX * VARIABLES * LANES)
    T, F = workspace(2 * VARIABLES * LANES), workspace((2 * FLUXES + 2) * LANES)
    for box in range(begin, end):
        first, last = box * LANES, min((box + 1) * LANES, len(faces))
        while first < last:
            axis, n = faces[first] // per_axis, run_of_axis(faces, first, last, per_axis)
            for i in range(LANES):
                face = faces[first + min(i, n - 1)]
                at = band[face % per_axis // 2] + (face % 2 - 1) * steps[axis]
                look_at_faces(U, Q, P, at, i, cells, steps, axis)
            primitives_of_faces(Q, P)
            c = (LINE + 1) * LANES
            increments_row(P, T, c, BOX * LANES, LANES, 0, 2 * LANES, 2 * LANES)
            for i in range(n):
                stops = seen[faces[first + i]] - 1
                for v in range(VARIABLES):
                    if stops == STOPS_LOW or stops == STOPS_LOW + STOPS_HIGH:
                        store(T, 2 * v * LANES + i, 0.0)
                    if stops >= STOPS_HIGH:
                        store(T, (2 * v + 1) * LANES + i, 0.0)
            rate = real(2 * DIMENSIONS) * rates[axis]
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
                rate=rate,
            )
            face_fluxes(P, T, F, faces_of_box, LANES, LANES)
            for i in range(n):
                face = faces[first + i]
                m, to = face % per_axis // 2, (2 * axis + face % 2) * FLUXES
                for v in range(FLUXES):
                    flux[m, to + v] = load(F, 2 * position_of(v, axis) * LANES + i)
            first += n


@helper
def add_fluxes(D, n, above, opened, flux, rates):
    """D (FLUXES,) = dt times the divergence of the fluxes of find_fluxes() in the cell number n of the band."""
    for v in range(FLUXES):
        D[v] = 0.0
    for axis in range(DIMENSIONS):
        for side in range(2):
            between = opened[n, 2 * axis + side]
            if between > 0.0:
                rate = (2 * side - 1) * rates[axis] * between
                shared = side == 1 and above[n, axis] >= 0
                m, first = (above[n, axis] if shared else n), (2 * axis + (0 if shared else side)) * FLUXES
                for v in range(FLUXES):
                    D[v] += rate * flux[m, first + v]


@row
def content_row(S, Q, b, dt, n):
    """Q = contents after a stage of the n cells whose states before the step and now, volumes then and now, part that
    the wall has freed, and divergence stand in S; values of a cell are LANES apart."""
    for i in range(n):
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


@driver
def advance_band(
    begin, end, band, above, opened, flux, U_n, U, U_new, swept, start_volume, area, velocity, impulse, work, added,
    shape, rates, b, dt, weight,
):  # fmt: skip
    """One stage of the band's cells, from the `flux` of find_fluxes(): U_new and swept = their contents. An item is a
    box of LANES cells.

    start_volume (n,): of the fluid before the step. area, velocity (n, D): of the wall; impulse (n, D) [N s/m3] and
    work (n,) [J/m3] grow by what the fluid gives to it in the cell, per volume, added (n,) [kg/m3] by how much less
    impulse that were per velocity of the wall; weight: share of the stage times dt.
    """
    cells = shape[0] * shape[1] * shape[2]
    D, S, Q = workspace(FLUXES), workspace((2 * VARIABLES + 3 + FLUXES) * LANES), workspace((VARIABLES + 2) * LANES)
    for box in range(begin, end):
        first = box * LANES
        lanes = min(LANES, len(band) - first)
        for i in range(lanes):
            n, at = first + i, band[first + i]
            add_fluxes(D, n, above, opened, flux, rates)
            now, before = state_at(U, at, cells), state_at(U_n, at, cells)
            surface = tuple(area[n, d] for d in static_range(DIMENSIONS))
            wall = tuple(velocity[n, d] for d in static_range(DIMENSIONS))
            size, normal = normal_of(surface)
            freed = real(dt * dot(surface, wall))  # the same to the bit in volume and content
            if size > 0.0:
                W = primitives(now)
                relative = tuple(W[PHASES + d] - wall[d] for d in static_range(DIMENSIONS))
                approach = dot(relative, normal)
                p = wall_pressure(now, W, approach)
                added[n] += weight * wall_impedance(now, W, approach) * size
                for d in static_range(DIMENSIONS):
                    D[PHASES + d] += dt * p * surface[d]
                    impulse[n, d] += weight * p * surface[d]
                D[PHASES + DIMENSIONS] += freed * p
                work[n] += weight * p * dot(surface, wall)
            share = share_at(at, cells)
            volume, start = load(swept, share), start_volume[n]
            for v in static_range(VARIABLES):
                store(S, v * LANES + i, before[v])
                store(S, (VARIABLES + v) * LANES + i, now[v])
            store(S, 2 * VARIABLES * LANES + i, start)
            store(S, (2 * VARIABLES + 1) * LANES + i, volume)
            store(S, (2 * VARIABLES + 2) * LANES + i, freed)
            for v in range(FLUXES):
                store(S, (2 * VARIABLES + 3 + v) * LANES + i, D[v])
            store(swept, share, start + b * (volume + freed - start))
        repeat_lane(S, 2 * VARIABLES + 3 + FLUXES, lanes)
        content_row(S, Q, b, dt, LANES)
        for i in range(lanes):
            content = tuple(load(Q, v * LANES + i) for v in static_range(VARIABLES + 2))
            put_content(U_new, swept, band[first + i], cells, content)


@driver
def book_sides(
    begin, end, chosen, side_cells, side, passed, U, kind, old, new, shape, steps, rates, weights
):  # fmt: skip
    """passed[n] grows by what the fluid's stage counts as leaving through a domain's side, side[n] = 2 axis + (0 low,
    1 high), beyond what leaves there, for the cells `chosen`. rates (D,): dt/h per axis; weights (D,): share of the
    stage * dt * area of a face.
    """
    cells = shape[0] * shape[1] * shape[2]
    P, T, F = workspace(BOX * VARIABLES), workspace(2 * VARIABLES), workspace(2 * FLUXES + 2)
    for m in range(begin, end):
        n = chosen[m]
        axis, high = side[n] // 2, side[n] % 2
        step = steps[axis]
        before = side_cells[n] if high == 1 else side_cells[n] - step
        weight = (2 * high - 1) * weights[axis]
        for seen in range(2):  # first as the stage does, which sees no wall
            look_at_face(U, before, cells, steps, axis, P, T)
            if seen == 1:
                weight = -weight * see_wall(kind, old, new, before, cells, step, axis, T)
            if weight != 0.0:
                flux_of_face(P, T, F, rates, axis)
                for v in range(PHASES + DIMENSIONS + 1):
                    passed[n, v] += weight * load(F, 2 * position_of(v, axis))
