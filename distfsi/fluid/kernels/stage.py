"""Loops of the fluid: one fused Runge-Kutta stage over tiles, and the fastest signal of each block.

A tile is computed row by row (x fastest), so that its working set stays in the cache:

    primitives of the tile and its ghosts -> P
    for each row:  rises and fluxes along x; along y and z those of the row above roll forward
                   divergence, Runge-Kutta update and relaxation -> U_new

Where all cells that a tile reads hold the same state, all its cells get the same bits: it is computed as one cell.

P holds one box of (pz, py, px) values per variable; rows of rises and fluxes hold px values per variable. Flux rows
have their velocity components rotated so that the normal one comes first.
"""

from math import sqrt

from distfsi.device.markers import ByHand, driver, helper, int32, load, real, row, store, workspace
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    CURVED,
    DIMENSIONS,
    FINISHES,
    FLUXES,
    FRACTIONAL,
    GHOSTS,
    LOOKS_SIDEWAYS,
    PHASES,
    SHARPENED,
    VARIABLES,
    before_relaxation,
    face_flux,
    fraction_after,
    halved_range,
    is_admissible,
    limited_flux,
    primitives,
    range_of_change,
    reconstructed,
    reserve,
    sharpened,
    sound_speed,
    updated,
)

# columns of the tile table: the block, the first cell (counted with ghosts), the cells, which domain sides the tile
# touches (bits)
BLOCK, X0, Y0, Z0, NX, NY, NZ, SIDES = 0, 1, 2, 3, 4, 5, 6, 7

HALVINGS = 80  # of the range of a volume fraction, down to the last bit also where one is a trace
LEAST_VOLUME = 0.5  # of a cell: what has less is not the stage's to advance (coupling/cut_cells/kernels/band.py)


@helper
def rotated(v, axis):
    """Index of the variable that stands at place v when the velocity along `axis` comes first."""
    if v >= PHASES and v < PHASES + DIMENSIONS:
        return PHASES + (v - PHASES + axis) % DIMENSIONS
    return v


@helper
def place(v, axis):
    """Where variable v stands when the velocity along `axis` comes first."""
    if v >= PHASES and v < PHASES + DIMENSIONS:
        return PHASES + (v - PHASES + DIMENSIONS - axis) % DIMENSIONS
    return v


@row
def primitives_row(U, P, u, su, p, sp, n):
    """P[p …] = primitives of the n cells at U[u …]; variables are su and sp apart."""
    for i in range(n):
        W = primitives(tuple(load(U, u + v * su + i) for v in static_range(VARIABLES)))
        for v in static_range(VARIABLES):
            store(P, p + v * sp + i, W[v])


@helper
def low_rise(v):
    """Row of T with the rise of variable v from a cell's low face to its mean; that on to its high face is in row v."""
    return v + VARIABLES if CURVED else v


@row
def rises_row(P, T, p, sp, step, t, st, n):
    """T[t …] = by how much each primitive of the n cells rises from the mean to the high face along the axis whose
    cells are `step` apart, then where it differs from the low face to the mean."""
    for v in static_range(VARIABLES):
        for i in range(n):
            c = p + v * sp + i
            cells = tuple(load(P, c + k * step) for k in static_range(1 - GHOSTS, GHOSTS))
            low, high = sharpened(cells) if SHARPENED and v == VARIABLES - 1 else reconstructed(cells)
            store(T, t + v * st + i, high)
            if CURVED:
                store(T, t + low_rise(v) * st + i, low)


@helper
def largest_jump(P, c, side):
    """The larger pressure difference between a cell and its neighbours `side` away, whose pressures are around P[c]."""
    return max(abs(load(P, c + side) - load(P, c)), abs(load(P, c) - load(P, c - side)))


@helper
def jump_along_face(P, c, step, side_1, side_2):
    """The largest pressure difference [Pa] between the face's two cells, c and c + step, and those beside them."""
    jump = max(largest_jump(P, c, side_1), largest_jump(P, c + step, side_1))
    if DIMENSIONS > 2:
        jump = max(jump, max(largest_jump(P, c, side_2), largest_jump(P, c + step, side_2)))
    return jump


@helper
def cell_mean(P, c, sp, axis):
    """Primitive state of the cell P[c], the velocity along `axis` first."""
    return tuple(load(P, c + rotated(v, axis) * sp) for v in static_range(VARIABLES))


@helper
def jump_of_face(P, c, sp, step, side_1, side_2):
    """What `face_flux` needs of the pressures around the face between the cells c and c + step."""
    return jump_along_face(P, c + (PHASES + DIMENSIONS) * sp, step, side_1, side_2) if LOOKS_SIDEWAYS else 0.0


@row
def flux_row(P, T, F, p, sp, step, side_1, side_2, t_low, t_high, st, f, axis, rate, n):
    """F[f …] = flux through the faces between the n cells at P[p …] and those `step` further along `axis`, and behind
    it the reserve that tells whether the limiter should look at it; returns how many it should.

    Along the other axes neighbours are side_1 and side_2 apart. rate: faces of a cell * dt/h.
    """
    count = int32(0)
    for i in range(n):
        low, high = cell_mean(P, p + i, sp, axis), cell_mean(P, p + step + i, sp, axis)
        left = tuple(low[v] + load(T, t_low + rotated(v, axis) * st + i) for v in static_range(VARIABLES))
        right = tuple(high[v] - load(T, t_high + low_rise(rotated(v, axis)) * st + i) for v in static_range(VARIABLES))
        flux = face_flux(left, right, jump_of_face(P, p + i, sp, step, side_1, side_2))
        for v in static_range(FLUXES):
            store(F, f + v * st + i, flux[v])
        c = min(sound_speed(left), sound_speed(right))
        if CURVED:  # then a cell's mean may have a much lower one
            c = min(c, min(sound_speed(low), sound_speed(high)))
        left_over = reserve(low, high, flux, c, rate)
        store(F, f + FLUXES * st + i, left_over)
        count = int32(count + (1 if left_over < 0.0 else 0))
    return count


@helper
def next_without_reserve(F, reserves, i, n):
    """The first face from i on that has no reserve; n if there is none."""
    while i < n and load(F, reserves + i) >= 0.0:
        i += 1
    return i


@row
def limit_faces(P, F, p, sp, step, side_1, side_2, st, f, axis, rate, n, counted):
    """Limit those of the n fluxes F[f …] of `flux_row` that have no reserve; returns how many of the first `counted`
    were changed."""
    count = 0
    i = next_without_reserve(F, f + FLUXES * st, 0, n)
    while i < n:
        low, high = cell_mean(P, p + i, sp, axis), cell_mean(P, p + step + i, sp, axis)
        flux = tuple(load(F, f + v * st + i) for v in static_range(FLUXES))
        if not is_admissible(low, high, flux, rate):
            limited = limited_flux(low, high, flux, jump_of_face(P, p + i, sp, step, side_1, side_2), rate)
            for v in static_range(FLUXES):
                store(F, f + v * st + i, limited[v])
            count += 1 if i < counted else 0
        i = next_without_reserve(F, f + FLUXES * st, i + 1, n)
    return count


@helper
def face_fluxes(P, T, F, p, sp, step, side_1, side_2, t_low, t_high, st, f, axis, rate, n, counted):
    """`flux_row` and, if needed, `limit_faces`; returns how many of the first `counted` faces were limited."""
    if flux_row(P, T, F, p, sp, step, side_1, side_2, t_low, t_high, st, f, axis, rate, n) > 0:
        return limit_faces(P, F, p, sp, step, side_1, side_2, st, f, axis, rate, n, counted)
    return 0


@helper
def divergence(F, v, i, st, fx, fy_low, fy_high, fz_low, fz_high, cx, cy, cz):
    """dt times the flux divergence of variable v in cell i of a row."""
    total = (load(F, fx + v * st + i + 1) - load(F, fx + v * st + i)) * cx
    if DIMENSIONS > 1:
        w = place(v, 1) * st + i
        total = total + (load(F, fy_high + w) - load(F, fy_low + w)) * cy
    if DIMENSIONS > 2:
        w = place(v, 2) * st + i
        total = total + (load(F, fz_high + w) - load(F, fz_low + w)) * cz
    return total


@helper
def change_by_fluxes(F, V, i, st, fx, fy_low, fy_high, fz_low, fz_high, s, cx, cy, cz):
    """dt times the flux divergence of all variables in cell i of a row, per volume of its fluid."""
    D = tuple(divergence(F, v, i, st, fx, fy_low, fy_high, fz_low, fz_high, cx, cy, cz) for v in static_range(FLUXES))
    if FRACTIONAL:
        concentration = 1.0 / max(load(V, s + i), LEAST_VOLUME)
        return tuple(D[v] * concentration for v in static_range(FLUXES))
    return D


@row
def update_row(
    U_n, U, P, F, V, U_new, T, u, su, p, sp, st, fx, fy_low, fy_high, fz_low, fz_high, s, cx, cy, cz, b, dt, n
):  # fmt: skip
    """U_new = one Runge-Kutta stage of the n cells at U[u …]; V[s …]: their volumes of fluid if it is FRACTIONAL.

    Returns how many cells have not relaxed; T[0 …] is negative for those.
    """
    count = int32(0)
    for i in range(n):
        new = updated(
            tuple(load(U_n, u + v * su + i) for v in static_range(VARIABLES)),
            tuple(load(U, u + v * su + i) for v in static_range(VARIABLES)),
            tuple(load(P, p + v * sp + i) for v in static_range(VARIABLES)),
            change_by_fluxes(F, V, i, st, fx, fy_low, fy_high, fz_low, fz_high, s, cx, cy, cz),
            b,
            dt,
        )
        for v in static_range(VARIABLES):
            store(U_new, u + v * su + i, new[v])
        if FINISHES:
            store(T, i, new[VARIABLES])
            count = int32(count + (1 if new[VARIABLES] < 0.0 else 0))
    return count


@row
def finish_cells(
    U_n, U, P, F, V, U_new, T, u, su, p, sp, st, fx, fy_low, fy_high, fz_low, fz_high, s, cx, cy, cz, b, dt, n
):  # fmt: skip
    """Relax those cells to the end that `update_row` has not."""
    i = next_without_reserve(T, 0, 0, n)
    while i < n:
        before = tuple(load(U_n, u + v * su + i) for v in static_range(VARIABLES))
        phases, moved = before_relaxation(
            before,
            tuple(load(U, u + v * su + i) for v in static_range(VARIABLES)),
            tuple(load(P, p + v * sp + i) for v in static_range(VARIABLES)),
            change_by_fluxes(F, V, i, st, fx, fy_low, fy_high, fz_low, fz_high, s, cx, cy, cz),
            b,
            dt,
        )
        low, high = range_of_change(phases)
        for _ in range(HALVINGS):
            low, high = halved_range(phases, low, high)
        store(U_new, u + (VARIABLES - 1) * su + i, fraction_after(before, moved + 0.5 * (low + high)))
        i = next_without_reserve(T, 0, i + 1, n)


@row
def count_unlike(U, u, first, su, n):
    """How many values of the n cells at U[u …] differ from those of the cell at `first`; a NaN differs from all."""
    count = 0
    for v in static_range(VARIABLES):
        value = load(U, first + v * su)
        for i in range(n):
            count += 1 if load(U, u + v * su + i) != value else 0
    return count


@helper
def is_uniform(U, u, su, sz, sy, n, m, l):
    """Whether the box of n x m x l cells at U[u …] holds one state."""
    for k in range(l):
        for j in range(m):
            if count_unlike(U, u + k * sz + j * sy, u, su, n) > 0:
                return False
    return True


@row
def repeat_row(U, u, first, su, n):
    """The n cells at U[u …] get the values of the cell at `first`."""
    for v in static_range(VARIABLES):
        value = load(U, first + v * su)
        for i in range(n):
            store(U, u + v * su + i, value)


@helper
def is_unchanged(U_n, U, U_new, u, su):
    """Whether a cell has the same values in all three states."""
    unchanged = True
    for v in static_range(VARIABLES):
        value = load(U_new, u + v * su)
        unchanged = unchanged and load(U, u + v * su) == value and load(U_n, u + v * su) == value
    return unchanged


@helper
def book(through, t, side, F, f, step, st, axis, n, rows, weight):
    """Add the flux through n faces of a domain side, `step` apart, to what has left through it; and that of as many
    `rows` as are alike."""
    for v in static_range(PHASES + DIMENSIONS + 1):
        total = load(F, f + place(v, axis) * st)
        for i in range(1, n):
            total = total + load(F, f + place(v, axis) * st + i * step)
        for _ in range(rows):
            through[t, side, v] += total * weight


STAGE_FORMULAS = (
    "primitives", "reconstructed", "sharpened", "face_flux", "sound_speed", "reserve", "is_admissible", "limited_flux",
    "updated", "before_relaxation", "range_of_change", "halved_range", "fraction_after",
)  # fmt: skip


def stage_block(constants, arguments):
    """A thread per column of a tile. Shared memory holds primitives and fluxes of it, in 3D of some planes; of two
    phases there also each thread's divergence and fluxes along z, which registers do not hold."""
    D = constants["DIMENSIONS"]
    px, py = int(arguments["px"]), int(arguments["py"])
    g = constants["GHOSTS"]
    x, y = px - 2 * g, py - (2 * g if D > 1 else 0)
    cells, faces = px * py * (2 * g if D > 2 else 1), (x + 1) * (y + (1 if D > 1 else 0))
    kept = 3 * x * y if D > 2 and constants["PHASES"] > 1 else 0
    shared = constants["VARIABLES"] * cells + constants["FLUXES"] * (faces + kept)
    return {"TILE_X": x, "TILE_Y": y, "THREADS": x * y, "SHARED": shared}


@ByHand("stage.cu", STAGE_FORMULAS, stage_block)
@driver
def advance_tiles(
    begin, end, chosen, tiles, calm, stages, U_n, U, U_new, volumes, through, limited, b, dt, weight, cx, cy, cz,
    px, py, pz,
):  # fmt: skip
    """One Runge-Kutta stage of the tiles chosen[begin:end].

    calm (tiles,): which tiles are known to stay as they are, in U_new too; only their flux is booked.
    stages (tiles + 1,): for how many stages each tile has not changed; counted here.
    U_n, U, U_new: (blocks, VARIABLES, Z, Y, X), the state before the step, of this stage and after it; U_n may be U.
    volumes (blocks, k, Z, Y, X): their first field are those of the cells' fluid, if it is FRACTIONAL.
    through (tiles, 6, conserved): grows by weight * dt/h * flux at the domain's sides. limited (tiles,): grows by the
    faces at the low sides of the tile's cells whose flux was limited. cx, cy, cz: dt/h per axis.
    """
    sy = U.shape[4]
    sz = sy * U.shape[3]
    su = sz * U.shape[2]
    sp = px * py * pz
    gy = GHOSTS if DIMENSIONS > 1 else 0
    gz = GHOSTS if DIMENSIONS > 2 else 0
    rises, fluxes = (2 if CURVED else 1) * VARIABLES * px, (FLUXES + 1) * px
    faces = real(2 * DIMENSIONS)
    rx, ry, rz = faces * cx, faces * cy, faces * cz
    P = workspace(VARIABLES * sp)
    T = workspace((3 + 2 * py) * rises)
    F = workspace((3 + 2 * py) * fluxes)
    for at in range(begin, end):
        t = chosen[at]
        nx, ny, nz, sides = tiles[t, NX], tiles[t, NY], tiles[t, NZ], tiles[t, SIDES]
        u0 = tiles[t, BLOCK] * VARIABLES * su + tiles[t, Z0] * sz + tiles[t, Y0] * sy + tiles[t, X0]
        v0 = u0 - tiles[t, BLOCK] * (VARIABLES - volumes.shape[1]) * su
        uniform = calm[t] or (
            is_uniform(U, u0 - gz * sz - gy * sy - GHOSTS, su, sz, sy, nx + 2 * GHOSTS, ny + 2 * gy, nz + 2 * gz)
            and is_uniform(U_n, u0, su, sz, sy, nx, ny, nz)
        )
        n, m, l, step = (1, 1, 1, 0) if uniform else (nx, ny, nz, 1)
        x_alike, y_alike, z_alike = (ny * nz, nz, ny) if uniform else (1, 1, 1)
        for k in range(-gz, l + gz):
            for j in range(-gy, m + gy):
                beside = LOOKS_SIDEWAYS and j >= -1 and j <= m and k >= -1 and k <= l
                if (j >= 0 and j < m) or (k >= 0 and k < l) or beside:
                    primitives_row(
                        U, P, u0 + k * sz + j * sy - GHOSTS, su, ((k + gz) * py + j + gy) * px, sp, n + 2 * GHOSTS
                    )
        count = 0
        tx, fx = 0, 0
        ty, ty_next = rises, 2 * rises
        fy, fy_next = fluxes, 2 * fluxes
        if DIMENSIONS > 2:
            for j in range(m):
                c = (gz * py + j + gy) * px + GHOSTS
                tz, tz_next, fz = (3 + j) * rises, (3 + py + j) * rises, (3 + j) * fluxes
                rises_row(P, T, c - px * py, sp, px * py, tz_next, px, n)
                rises_row(P, T, c, sp, px * py, tz, px, n)
                count += face_fluxes(P, T, F, c - px * py, sp, px * py, 1, px, tz_next, tz, px, fz, 2, rz, n, n)
                if sides & 16:
                    book(through, t, 4, F, fz, step, px, 2, nx, z_alike, weight * cz)
        for k in range(l):
            now, then = (3 + py * (k % 2)), (3 + py * ((k + 1) % 2))
            if DIMENSIONS > 1:
                c = ((k + gz) * py + gy) * px + GHOSTS
                rises_row(P, T, c - px, sp, px, ty_next, px, n)
                rises_row(P, T, c, sp, px, ty, px, n)
                count += face_fluxes(P, T, F, c - px, sp, px, 1, px * py, ty_next, ty, px, fy, 1, ry, n, n)
                if sides & 4:
                    book(through, t, 2, F, fy, step, px, 1, nx, y_alike, weight * cy)
            for j in range(m):
                c = ((k + gz) * py + j + gy) * px + GHOSTS
                rises_row(P, T, c - 1, sp, 1, tx, px, n + 2)
                count += face_fluxes(P, T, F, c - 1, sp, 1, px, px * py, tx, tx + 1, px, fx, 0, rx, n + 1, n)
                if DIMENSIONS > 1:
                    rises_row(P, T, c + px, sp, px, ty_next, px, n)
                    own = n if j < m - 1 else 0
                    count += face_fluxes(P, T, F, c, sp, px, 1, px * py, ty, ty_next, px, fy_next, 1, ry, n, own)
                if DIMENSIONS > 2:
                    tz, tz_next, fz = (now + j) * rises, (then + j) * rises, (then + j) * fluxes
                    rises_row(P, T, c + px * py, sp, px * py, tz_next, px, n)
                    own = n if k < l - 1 else 0
                    count += face_fluxes(P, T, F, c, sp, px * py, 1, px, tz, tz_next, px, fz, 2, rz, n, own)
                u = u0 + k * sz + j * sy
                fz_low, fz_high = (now + j) * fluxes, (then + j) * fluxes
                s = v0 + k * sz + j * sy
                unsettled = update_row(
                    U_n, U, P, F, volumes, U_new, T, u, su, c, sp, px, fx, fy, fy_next, fz_low, fz_high, s, cx, cy, cz,
                    b, dt, n,
                )  # fmt: skip
                if FINISHES and unsettled > 0:
                    finish_cells(
                        U_n, U, P, F, volumes, U_new, T, u, su, c, sp, px, fx, fy, fy_next, fz_low, fz_high, s, cx, cy,
                        cz, b, dt, n,
                    )  # fmt: skip
                if sides & 1:
                    book(through, t, 0, F, fx, step, px, 0, 1, x_alike, weight * cx)
                if sides & 2:
                    book(through, t, 1, F, fx + n, step, px, 0, 1, x_alike, weight * cx)
                if DIMENSIONS > 1 and sides & 8 and j == m - 1:
                    book(through, t, 3, F, fy_next, step, px, 1, nx, y_alike, weight * cy)
                if DIMENSIONS > 2 and sides & 32 and k == l - 1:
                    book(through, t, 5, F, fz_high, step, px, 2, nx, z_alike, weight * cz)
                ty, ty_next = ty_next, ty
                fy, fy_next = fy_next, fy
        if uniform and not calm[t]:
            for k in range(nz):
                for j in range(ny):
                    repeat_row(U_new, u0 + k * sz + j * sy, u0, su, nx)
        limited[t] += count
        stages[t] = stages[t] + 1 if uniform and is_unchanged(U_n, U, U_new, u0, su) else 0


@row
def signal_row(U, S, u, su, n, rx, ry, rz):
    """S[i] = sum over axes of (|u| + c)/h, largest so far in column i; S[n + i] stays 0 as long as every signal is
    finite; that of a cell with a negative mass is not."""
    for i in range(n):
        W = primitives(tuple(load(U, u + v * su + i) for v in static_range(VARIABLES)))
        c = sound_speed(W)
        signal = (abs(W[PHASES]) + c) * rx
        if DIMENSIONS > 1:
            signal = signal + (abs(W[PHASES + 1]) + c) * ry
        if DIMENSIONS > 2:
            signal = signal + (abs(W[PHASES + 2]) + c) * rz
        lightest = load(U, u + i)
        for k in static_range(1, PHASES):
            lightest = min(lightest, load(U, u + k * su + i))
        signal = signal + (sqrt(lightest) - sqrt(lightest))
        store(S, i, max(load(S, i), signal))
        store(S, n + i, load(S, n + i) + (signal - signal))


def signal_block(constants, arguments):
    """The block's threads share the cells of a block of the grid."""
    return {"THREADS": 128, "SHARED": 0}


@ByHand("stage.cu", ("primitives", "sound_speed"), signal_block)
@driver
def fastest_signals(begin, end, chosen, U, start, extent, rx, ry, rz, fastest):
    """fastest[block] = max over its cells of sum_d (|u_d| + c)/h_d [1/s] for the blocks chosen[begin:end]; NaN when a
    cell has no valid state.

    start: index of a block's first active cell within one variable; rx, ry, rz: 1/h.
    """
    sy = U.shape[4]
    sz = sy * U.shape[3]
    su = sz * U.shape[2]
    S = workspace(2 * sy)
    for at in range(begin, end):
        block = chosen[at]
        n = extent[block, 0]
        for i in range(2 * n):
            S[i] = 0.0
        for k in range(extent[block, 2]):
            for j in range(extent[block, 1]):
                signal_row(U, S, block * VARIABLES * su + start + k * sz + j * sy, su, n, rx, ry, rz)
        largest, invalid = S[0], S[n]
        for i in range(1, n):
            largest, invalid = max(largest, S[i]), invalid + S[n + i]
        fastest[block] = largest + invalid
