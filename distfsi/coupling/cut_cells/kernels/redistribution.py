"""Loops over the band of cells around the wall: contents, their mixing, and the exchange of volumes.

Between a stage and the mixing after it the band's cells hold contents v U, otherwise states U; a cell outside the band
is whole, so that both are the same. `swept` (blocks, SWEPT, Z, Y, X) holds v and, for two phases, the contents of both
phase energies. Cells are named as in coupling/kernels/cells.py.
"""

from distfsi.coupling.cut_cells.kernels.geometry import SHUT, is_in_domain, opening, step_to
from distfsi.coupling.formulas.moving_wall import state_before_relaxation, state_of, with_energies
from distfsi.coupling.kernels.cells import FLUID
from distfsi.device.markers import driver, helper, load, row, store, workspace
from distfsi.fluid.formulas.relaxation import halved_range, range_of_change
from distfsi.fluid.kernels.rows import HALVINGS
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import BISECTION_FALLBACK, DIMENSIONS, LANES, PHASES, VARIABLES, bulk_modulus, primitives

SWEPT = 3  # fields of `swept` for two phases; one phase has 1
SEALED = 1e-3  # of a cell: the least volume of fluid that is shut in
GIVEN = 0.125  # of its volume: the most that a cell gives to a neighbour at a time
LACKING = 0.05  # of a whole cell: what may be missing to its volume
YIELDED = 0.05  # of its pressure: what a cell loses at a time when it fills what is missing

# ---- contents -------------------------------------------------------------------------------------------------------


@helper
def state_at(U, at, cells):
    """What a cell holds."""
    first = at + at // cells * (VARIABLES - 1) * cells
    return tuple(load(U, first + v * cells) for v in static_range(VARIABLES))


@helper
def share_at(at, cells):
    """Flat index of a cell's volume in `swept`."""
    return at + at // cells * ((SWEPT - 1) * cells if PHASES == 2 else 0)


@helper
def put_content(U, swept, at, cells, content):
    """Store a content, and the phase energies that belong to it."""
    first = at + at // cells * (VARIABLES - 1) * cells
    for v in static_range(VARIABLES):
        store(U, first + v * cells, content[v])
    if PHASES == 2:
        share = share_at(at, cells)
        store(swept, share + cells, content[VARIABLES])
        store(swept, share + 2 * cells, content[VARIABLES + 1])


@driver
def take_contents(begin, end, band, U, swept, shape):
    """States of the band become contents."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        at = band[n]
        put_content(U, swept, at, cells, with_energies(state_at(U, at, cells), load(swept, share_at(at, cells))))


@driver
def keep_volumes(begin, end, band, swept, shape, volume):
    """volume[n] = that of the fluid in a cell of the band."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        volume[n] = load(swept, share_at(band[n], cells))


@helper
def index_of(at, shape, origin):
    """Place of a cell in the grid."""
    b = at // (shape[0] * shape[1] * shape[2])
    gy = 2 if DIMENSIONS > 1 else 0
    gz = 2 if DIMENSIONS > 2 else 0
    return (
        origin[b, 0] + at % shape[2] - 2,
        origin[b, 1] + at // shape[2] % shape[1] - gy,
        origin[b, 2] + at // (shape[1] * shape[2]) % shape[0] - gz,
    )


@helper
def way_to_master(master, at, cells, steps):
    """Step in memory from a cell to its master; 0 if it has none."""
    first, way = at + at // cells * (DIMENSIONS - 1) * cells, 0
    for d in static_range(DIMENSIONS):
        way += master[first + d * cells] * steps[d]
    return way


@helper
def add_content(total, U, swept, fraction, at, cells):
    """Add a cell's content, phase energies, volume and open fraction to the four parts of `total`."""
    Q, share = state_at(U, at, cells), share_at(at, cells)
    for v in static_range(VARIABLES):
        total[v] += Q[v]
    if PHASES == 2:
        total[VARIABLES] += load(swept, share + cells)
        total[VARIABLES + 1] += load(swept, share + 2 * cells)
    total[VARIABLES + 2] += load(swept, share)
    total[VARIABLES + 3] += load(fraction, at)


@driver
def mark_leaving(begin, end, band, mark, kind, master, shape, steps):
    """mark[n] = 1 where a cell of the band is shut and its fluid can go, else 0."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        mark[n] = 1 if kind[band[n]] == SHUT and way_to_master(master, band[n], cells, steps) != 0 else 0


@driver
def absorb(begin, end, band, moved, U, swept, kind, fraction, master, steps, shape):
    """moved (n, VARIABLES + 3) = contents, phase energies and volumes of the band's cells after those that are shut
    have handed theirs to a neighbour."""
    cells = shape[0] * shape[1] * shape[2]
    total = workspace(VARIABLES + 4)
    for n in range(begin, end):
        at = band[n]
        for v in range(VARIABLES + 4):
            total[v] = 0.0
        if kind[at] == FLUID or way_to_master(master, at, cells, steps) == 0:
            add_content(total, U, swept, fraction, at, cells)
        for axis in range(DIMENSIONS):
            for side in range(2):
                way = (2 * side - 1) * steps[axis]
                if kind[at + way] == SHUT and way_to_master(master, at + way, cells, steps) == -way:
                    add_content(total, U, swept, fraction, at + way, cells)
        for v in range(VARIABLES + 3):
            moved[n, v] = total[v]


@driver
def put_moved(begin, end, band, moved, U, swept, shape):
    """Store the contents and volumes of the band."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        put_content(U, swept, band[n], cells, tuple(moved[n, v] for v in static_range(VARIABLES + 2)))
        store(swept, share_at(band[n], cells), moved[n, VARIABLES + 2])


@driver
def find_trapped(begin, end, band, held, kind, U, swept, shape):
    """held (n, PHASES) [kg/m3] = masses per volume of a cell in the band whose fluid is shut in, 0 of the others."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        state, volume = state_at(U, band[n], cells), load(swept, share_at(band[n], cells))
        for k in static_range(PHASES):
            held[n, k] = state[k] * volume if kind[band[n]] == SHUT else 0.0


@driver
def look_around(begin, end, band, joined, above, master, offsets, steps, shape, origin, grid_cells):
    """joined (n, offsets) = 1 where the cell at an offset from a cell's master, or from the cell if it has none, has
    joined the same; above (n, D) = the place in the band of the next cell along each axis, -1 for none."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        at = band[n]
        center = at + way_to_master(master, at, cells, steps)
        index, first = index_of(center, shape, origin), center + at // cells * (DIMENSIONS - 1) * cells
        for m in range(len(offsets)):
            there, same = first + step_to(offsets, m, steps), True
            for d in static_range(DIMENSIONS):
                same = same and master[there + d * cells] == -offsets[m, d]
            joined[n, m] = 1 if same and is_in_domain(index, offsets[m], grid_cells) else 0
        for axis in range(DIMENSIONS):
            first, last = n, min(n + steps[axis] + 1, len(band))
            while last - first > 1:
                middle = (first + last) // 2
                if band[middle] <= at + steps[axis]:
                    first = middle
                else:
                    last = middle
            above[n, axis] = first if band[first] == at + steps[axis] else -1


@row
def states_row(Q, S, n):
    """S = states of the n contents Q, behind which their volumes stand, and a negative value where phases have not
    relaxed; values of a cell are LANES apart."""
    for i in range(n):
        content = tuple(load(Q, v * LANES + i) for v in static_range(VARIABLES + 2))
        state = state_of(content, load(Q, (VARIABLES + 2) * LANES + i))
        for v in static_range(VARIABLES + 1):
            store(S, v * LANES + i, state[v])


@helper
def relaxed_to_the_end(Q, i):
    """Volume fraction at which both phases of the content in lane i have one pressure."""
    content = tuple(load(Q, v * LANES + i) for v in static_range(VARIABLES + 2))
    U, phases = state_before_relaxation(content, load(Q, (VARIABLES + 2) * LANES + i))
    low, high = range_of_change(phases)
    for _ in range(HALVINGS):
        low, high = halved_range(phases, low, high)
    return phases[1] + 0.5 * (low + high)


@helper
def repeat_lane(Q, values, n):
    """Lanes n … LANES of so many values hold what the first does."""
    for v in range(values):
        for i in range(n, LANES):
            store(Q, v * LANES + i, load(Q, v * LANES))


@driver
def mix(begin, end, band, joined, mixed, U, swept, fraction, master, offsets, steps, shape):
    """mixed (n, VARIABLES + 1) = state and volume of the band's cells, once those that belong together share theirs. An
    item is a box of LANES cells."""
    cells = shape[0] * shape[1] * shape[2]
    total, Q, S = workspace(VARIABLES + 4), workspace((VARIABLES + 3) * LANES), workspace((VARIABLES + 1) * LANES)
    for box in range(begin, end):
        lanes = min(LANES, len(band) - box * LANES)
        for i in range(lanes):
            n = box * LANES + i
            at = band[n]
            center = at + way_to_master(master, at, cells, steps)
            for v in range(VARIABLES + 4):
                total[v] = 0.0
            add_content(total, U, swept, fraction, center, cells)
            shares = center != at
            for m in range(len(offsets)):
                if joined[n, m] > 0:
                    shares = True
                    add_content(total, U, swept, fraction, center + step_to(offsets, m, steps), cells)
            total[VARIABLES + 2] = max(total[VARIABLES + 2], SEALED)
            for v in range(VARIABLES + 3):
                store(Q, v * LANES + i, total[v])
            part = load(fraction, at) / total[VARIABLES + 3] if shares else 1.0
            mixed[n, VARIABLES] = total[VARIABLES + 2] * part
        repeat_lane(Q, VARIABLES + 3, lanes)
        states_row(Q, S, LANES)
        for i in range(lanes):
            for v in range(VARIABLES):
                mixed[box * LANES + i, v] = load(S, v * LANES + i)
            if BISECTION_FALLBACK:
                if load(S, VARIABLES * LANES + i) < 0.0:
                    mixed[box * LANES + i, VARIABLES - 1] = relaxed_to_the_end(Q, i)


@driver
def put_mixed(begin, end, chosen, mixed, U, swept, shape):
    """Store the states and volumes of the cells `chosen`."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        first = chosen[n] + chosen[n] // cells * (VARIABLES - 1) * cells
        for v in static_range(VARIABLES):
            store(U, first + v * cells, mixed[n, v])
        store(swept, share_at(chosen[n], cells), mixed[n, VARIABLES])


@driver
def put_rest(begin, end, covered, U, swept, rest, shape):
    """Covered cells hold the state `rest` in no volume."""
    cells = shape[0] * shape[1] * shape[2]
    for n in range(begin, end):
        first = covered[n] + covered[n] // cells * (VARIABLES - 1) * cells
        for v in static_range(VARIABLES):
            store(U, first + v * cells, rest[v])
        store(swept, share_at(covered[n], cells), 0.0)


# ---- volumes --------------------------------------------------------------------------------------------------------


@helper
def surplus(kind, swept, fraction, at, cells):
    """Swept less geometric volume of a cell; 0 where nothing may be exchanged."""
    part = load(fraction, at)
    return load(swept, share_at(at, cells)) - part if kind[at] == FLUID and part > 0.0 else 0.0


@helper
def opposite(kind, swept, fraction, old, new, at, sign, cells, steps, index, grid_cells):
    """Sum of what the neighbours behind open faces have too little, if `sign` is positive, or too much."""
    total = 0.0
    for axis in range(DIMENSIONS):
        for side in range(2):
            place_there = index[axis] + 2 * side - 1
            if place_there >= 0 and place_there < grid_cells[axis]:
                face = at + side * steps[axis]
                if opening(old, new, face, axis, cells) > 0.0:
                    other = surplus(kind, swept, fraction, at + (2 * side - 1) * steps[axis], cells)
                    total += max(-sign * other, 0.0)
    return total


@helper
def expand(mixed, n):
    """The fluid of a whole cell fills what is missing in it, and loses no more than YIELDED of its pressure."""
    state, volume = tuple(mixed[n, v] for v in static_range(VARIABLES)), mixed[n, VARIABLES]
    missing = 1.0 - LACKING - volume
    if missing > 0.0:
        W = primitives(state)
        gained = max(min(missing, volume * (YIELDED * W[PHASES + DIMENSIONS] / bulk_modulus(W))), 0.0)
        for v in static_range(PHASES + DIMENSIONS + 1):
            mixed[n, v] = state[v] * (volume / (volume + gained))
        mixed[n, VARIABLES] = volume + gained


@driver
def exchange_volumes(
    begin, end, uneven, mixed, U, swept, kind, fraction, old, new, expands, steps, shape, origin, grid_cells
):  # fmt: skip
    """mixed (n, VARIABLES + 1) = state and volume of cells, among them all with too much or too little, after those
    with too much have given to their neighbours with too little, with the content that belongs to it.

    What is missing in whole cells all the same their own fluid fills, if it `expands`.
    """
    cells = shape[0] * shape[1] * shape[2]
    total = workspace(VARIABLES)
    for n in range(begin, end):
        at = uneven[n]
        volume = load(swept, share_at(at, cells))
        state = state_at(U, at, cells)
        gained = 0.0
        mine = surplus(kind, swept, fraction, at, cells)
        if mine != 0.0:
            for v in static_range(VARIABLES):
                total[v] = volume * state[v]
            sign = 1.0 if mine > 0.0 else -1.0
            index = index_of(at, shape, origin)
            around = opposite(kind, swept, fraction, old, new, at, sign, cells, steps, index, grid_cells)
            for axis in range(DIMENSIONS):
                for side in range(2):
                    way = 2 * side - 1
                    other_index = (
                        index[0] + (way if axis == 0 else 0),
                        index[1] + (way if axis == 1 else 0),
                        index[2] + (way if axis == 2 else 0),
                    )
                    there = at + way * steps[axis]
                    inside = other_index[axis] >= 0 and other_index[axis] < grid_cells[axis]
                    if inside and opening(old, new, at + side * steps[axis], axis, cells) > 0.0:
                        theirs = surplus(kind, swept, fraction, there, cells)
                        if mine * theirs < 0.0:
                            far = opposite(
                                kind, swept, fraction, old, new, there, -sign, cells, steps, other_index, grid_cells
                            )
                            giver = at if mine > 0.0 else there
                            held = load(swept, share_at(giver, cells))
                            moved = min(-mine * theirs / max(around, far), GIVEN * held)
                            given = state_at(U, giver, cells)
                            gained -= sign * moved
                            for v in static_range(VARIABLES):
                                total[v] -= sign * moved * given[v]
        for v in static_range(VARIABLES):
            mixed[n, v] = total[v] / (volume + gained) if gained != 0.0 else state[v]
        mixed[n, VARIABLES] = volume + gained
        if expands > 0 and kind[at] == FLUID and load(fraction, at) == 1.0:
            expand(mixed, n)
