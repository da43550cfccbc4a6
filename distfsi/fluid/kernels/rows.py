"""Rows of cells and faces: primitives, increments to faces, fluxes and their limiter, the update of a stage.

These are the loops that must vectorise (`@row`); what P, T and F hold is told in fluid/kernels/records.py.
"""

from distfsi.device.markers import helper, int32, load, row, store
from distfsi.fluid.formulas.relaxation_many import (
    changes_between,
    halved_growths,
    range_of_growths,
    range_of_pressure,
)
from distfsi.fluid.formulas.six_equation import mixture_density
from distfsi.fluid.formulas.six_equation_many import fractions_after
from distfsi.fluid.kernels.records import (
    HIGH,
    LOW,
    NEARNESS,
    STRETCH,
    TO_LOW,
    UNIT,
    CellFluxes,
    Cells,
    Faces,
    StageStep,
    States,
    metrics_at,
    position_of,
    variable_at,
)
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import (
    ASYMMETRIC,
    BISECTION_FALLBACK,
    DIMENSIONS,
    FLUXES,
    FRACTIONAL,
    GHOSTS,
    HYDROSTATIC,
    PHASES,
    RADIAL,
    SHARPENED,
    TRANSVERSE_SENSOR,
    VARIABLES,
    before_relaxation,
    beyond_rest,
    face_flux,
    fraction_after,
    halved_range,
    is_admissible,
    limited_flux,
    limiter_indicator,
    primitives,
    range_of_change,
    reconstructed,
    reconstructed_in_r,
    sharpened,
    sound_speed,
    updated,
)

HALVINGS = 80  # of the range of a volume fraction, down to the last bit also where one is a trace
MINIMUM_VOLUME = 0.5  # of a cell: what has less is not the stage's to advance (coupling/cut_cells/kernels/band.py)


# ---- primitives and increments ---------------------------------------------------------------------------------------


@row
def primitives_row(U, P, u, su, p, sp, n):
    """P[p …] = primitives of the n cells at U[u …]; variables are su and sp apart."""
    for i in range(n):
        W = primitives(tuple(load(U, u + v * su + i) for v in static_range(VARIABLES)))
        for v in static_range(VARIABLES):
            store(P, p + v * sp + i, W[v])


@helper
def low_increment(v, axis):
    """Row of T with the increment of variable v from a cell's low face to its mean; that to its high face is row v. In
    radial coordinates they differ along r alone."""
    if RADIAL:
        return v + (VARIABLES if axis == 0 else 0)
    return v + VARIABLES if ASYMMETRIC else v


@helper
def is_fraction(v):
    """Whether a variable is a volume fraction."""
    return v > PHASES + DIMENSIONS and v < 2 * PHASES + DIMENSIONS


@helper
def density_at(P, c, sp):
    """[kg/m3] of the cell P[c]; variables are sp apart."""
    if PHASES == 1:
        return load(P, c)
    else:
        return mixture_density(tuple(load(P, c + v * sp) for v in static_range(VARIABLES)))


@helper
def pressure_increments(P, c, sp, step, fall):
    """Increments of the pressure in a cell whose first variable is at P[c]: beside the weight of fluid at rest, with
    g h along the row, and that weight."""
    pressure = (PHASES + DIMENSIONS) * sp
    p = tuple(load(P, c + pressure + k * step) for k in static_range(1 - GHOSTS, GHOSTS))
    rho = tuple(density_at(P, c + k * step, sp) for k in static_range(1 - GHOSTS, GHOSTS))
    low, high = reconstructed(beyond_rest(p, rho, fall))
    weight = 0.5 * fall * rho[GHOSTS - 1]
    return (low + weight, high + weight)


@row
def increments_row(P, T, p, sp, step, t, st, n, fall):
    """T[t …] = increments of the primitives of the n cells at P[p …] from the mean to the high face along the axis
    whose cells are `step` apart, then where they differ those from the low face to the mean; `fall`: g h of a body
    force along that axis, if there is one."""
    for v in static_range(VARIABLES):
        for i in range(n):
            c = p + v * sp + i
            cells = tuple(load(P, c + k * step) for k in static_range(1 - GHOSTS, GHOSTS))
            if HYDROSTATIC and v == PHASES + DIMENSIONS:
                low, high = pressure_increments(P, p + i, sp, step, fall)
            else:
                low, high = sharpened(cells) if SHARPENED and is_fraction(v) else reconstructed(cells)
            store(T, t + v * st + i, high)
            if ASYMMETRIC and not RADIAL:
                store(T, t + low_increment(v, 0) * st + i, low)


@row
def increments_in_r_row(P, T, p, sp, t, st, n):
    """As `increments_row` along r, where centroids do not lie in the middle of cells, and not equally far apart."""
    nearness, to_low = metrics_at(NEARNESS, p, sp, st), metrics_at(TO_LOW, p, sp, st)
    for v in static_range(VARIABLES):
        for i in range(n):
            c = p + v * sp + i
            cells = tuple(load(P, c + k) for k in static_range(1 - GHOSTS, GHOSTS))
            backward, forward = load(P, nearness + i), load(P, nearness + i + 1)
            along = reconstructed_in_r(cells, backward, forward, load(P, to_low + i))
            low, high = sharpened(cells) if SHARPENED and is_fraction(v) else along
            store(T, t + v * st + i, high)
            store(T, t + low_increment(v, 0) * st + i, low)


# ---- the transverse pressure sensor ----------------------------------------------------------------------------------


@helper
def largest_jump(P, c, side):
    """The larger pressure difference between a cell and its neighbours `side` away, whose pressures are around P[c]."""
    return max(abs(load(P, c + side) - load(P, c)), abs(load(P, c) - load(P, c - side)))


@helper
def jump_along_face(P, c, faces: Faces):
    """The largest pressure difference [Pa] between the face's two cells, the first of which is at P[c], and those
    beside them."""
    jump = max(largest_jump(P, c, faces.beside_1), largest_jump(P, c + faces.across, faces.beside_1))
    if DIMENSIONS > 2:
        other = max(largest_jump(P, c, faces.beside_2), largest_jump(P, c + faces.across, faces.beside_2))
        jump = max(jump, other)
    return jump


@helper
def jump_of_face(P, i, faces: Faces):
    """What `face_flux` needs of the pressures around face i of a row."""
    pressure = faces.cell + i + (PHASES + DIMENSIONS) * faces.variables
    return jump_along_face(P, pressure, faces) if TRANSVERSE_SENSOR else 0.0


# ---- fluxes ----------------------------------------------------------------------------------------------------------


@helper
def cell_mean(P, c, faces: Faces):
    """Primitive state of the cell P[c], the velocity along the row's axis first."""
    return tuple(load(P, c + variable_at(v, faces.axis) * faces.variables) for v in static_range(VARIABLES))


@helper
def rate_of_face(P, i, faces: Faces):
    """What the limiter takes for the rate of face i of a row: in r that of the cell which has more face for its
    volume."""
    if RADIAL:
        row = STRETCH if faces.axis == 0 else UNIT
        return faces.rate * load(P, metrics_at(row, faces.cell + faces.across, faces.variables, faces.rows) + i)
    return faces.rate


@row
def flux_row(P, T, F, faces: Faces, n):
    """F = flux through the n faces, and behind it the indicator that tells whether the limiter must look at it; returns
    how many it must."""
    count = int32(0)
    for i in range(n):
        # the states at both sides of the face: cell means and their increments
        low, high = cell_mean(P, faces.cell + i, faces), cell_mean(P, faces.cell + faces.across + i, faces)
        left = tuple(
            low[v] + load(T, faces.low + variable_at(v, faces.axis) * faces.rows + i) for v in static_range(VARIABLES)
        )
        right = tuple(
            high[v] - load(T, faces.high + low_increment(variable_at(v, faces.axis), faces.axis) * faces.rows + i)
            for v in static_range(VARIABLES)
        )
        # the flux
        flux = face_flux(left, right, jump_of_face(P, i, faces))
        for v in static_range(FLUXES):
            store(F, faces.flux + v * faces.rows + i, flux[v])
        # the limiter's indicator
        c = min(sound_speed(left), sound_speed(right))
        if ASYMMETRIC and not RADIAL:  # then a cell's mean may have a much lower one
            c = min(c, min(sound_speed(low), sound_speed(high)))
        indicator = limiter_indicator(low, high, flux, c, rate_of_face(P, i, faces))
        store(F, faces.flux + FLUXES * faces.rows + i, indicator)
        count = int32(count + (1 if indicator < 0.0 else 0))
    return count


@helper
def next_negative(values, first, i, n):
    """The first of the n values[first …] from i on that is negative or NaN; n if there is none."""
    while i < n and load(values, first + i) >= 0.0:
        i += 1
    return i


@row
def limit_faces(P, F, faces: Faces, n, counted):
    """Limit those of the n fluxes of `flux_row` whose indicator asks for it; returns how many of the first `counted`
    were changed."""
    count = 0
    indicators = faces.flux + FLUXES * faces.rows
    i = next_negative(F, indicators, 0, n)
    while i < n:
        low, high = cell_mean(P, faces.cell + i, faces), cell_mean(P, faces.cell + faces.across + i, faces)
        flux = tuple(load(F, faces.flux + v * faces.rows + i) for v in static_range(FLUXES))
        rate = rate_of_face(P, i, faces)
        if not is_admissible(low, high, flux, rate):
            limited = limited_flux(low, high, flux, jump_of_face(P, i, faces), rate)
            for v in static_range(FLUXES):
                store(F, faces.flux + v * faces.rows + i, limited[v])
            count += 1 if i < counted else 0
        i = next_negative(F, indicators, i + 1, n)
    return count


@helper
def face_fluxes(P, T, F, faces: Faces, n, counted):
    """`flux_row` and, if needed, `limit_faces`; returns how many of the first `counted` faces were limited."""
    if flux_row(P, T, F, faces, n) > 0:
        return limit_faces(P, F, faces, n, counted)
    return 0


# ---- the update ------------------------------------------------------------------------------------------------------


@helper
def divergence_in_r(P, F, v, i, cells: Cells, fluxes: CellFluxes, step: StageStep):
    """dt times the part along r of the flux divergence of variable v in cell i of a row. Momentum is pushed by how much
    the pressure on each face differs from the cell's own, which acts on all of them alike."""
    x = fluxes.x + v * fluxes.rows + i
    low = load(P, metrics_at(LOW, cells.primitive, cells.primitive_variables, fluxes.rows) + i)
    high = load(P, metrics_at(HIGH, cells.primitive, cells.primitive_variables, fluxes.rows) + i)
    own = load(P, cells.primitive + (PHASES + DIMENSIONS) * cells.primitive_variables + i) if v == PHASES else 0.0
    return (high * (load(F, x + 1) - own) - low * (load(F, x) - own)) * step.x


@helper
def divergence(P, F, v, i, cells: Cells, fluxes: CellFluxes, step: StageStep):
    """dt times the flux divergence of variable v in cell i of a row."""
    x = fluxes.x + v * fluxes.rows + i
    if RADIAL:
        total = divergence_in_r(P, F, v, i, cells, fluxes, step)
    else:
        total = (load(F, x + 1) - load(F, x)) * step.x
    if DIMENSIONS > 1:
        y = position_of(v, 1) * fluxes.rows + i
        total = total + (load(F, fluxes.y_high + y) - load(F, fluxes.y_low + y)) * step.y
    if DIMENSIONS > 2:
        z = position_of(v, 2) * fluxes.rows + i
        total = total + (load(F, fluxes.z_high + z) - load(F, fluxes.z_low + z)) * step.z
    return total


@helper
def change_by_fluxes(P, F, volumes, i, cells: Cells, fluxes: CellFluxes, step: StageStep):
    """dt times the flux divergence of all variables in cell i of a row, per volume of its fluid."""
    D = tuple(divergence(P, F, v, i, cells, fluxes, step) for v in static_range(FLUXES))
    if FRACTIONAL:
        concentration = 1.0 / max(load(volumes, cells.volume + i), MINIMUM_VOLUME)
        return tuple(D[v] * concentration for v in static_range(FLUXES))
    return D


@helper
def state_of_cell(U, i, cells: Cells):
    """State of cell i of a row."""
    return tuple(load(U, cells.state + v * cells.state_variables + i) for v in static_range(VARIABLES))


@helper
def primitives_of_cell(P, i, cells: Cells):
    """Primitives of cell i of a row."""
    return tuple(load(P, cells.primitive + v * cells.primitive_variables + i) for v in static_range(VARIABLES))


@row
def update_row(states: States, P, F, T, cells: Cells, fluxes: CellFluxes, step: StageStep, n):
    """states.after = one Runge-Kutta stage of the n cells.

    Returns how many of them have not relaxed; T[0 …] is negative for those.
    """
    count = int32(0)
    for i in range(n):
        new = updated(
            state_of_cell(states.before, i, cells),
            state_of_cell(states.now, i, cells),
            primitives_of_cell(P, i, cells),
            change_by_fluxes(P, F, states.volumes, i, cells, fluxes, step),
            step.b,
            step.dt,
        )
        for v in static_range(VARIABLES):
            store(states.after, cells.state + v * cells.state_variables + i, new[v])
        if BISECTION_FALLBACK:
            store(T, i, new[VARIABLES])
            count = int32(count + (1 if new[VARIABLES] < 0.0 else 0))
    return count


@helper
def bisected_changes(phases):
    """Changes of the volumes of three or more phases that give them one pressure: its range is halved until it is a
    point, and for each pressure the growths that lead to it."""
    low, high = range_of_pressure(phases)
    shortest, longest = range_of_growths(phases)
    for _ in range(HALVINGS):
        y = 0.5 * (low + high)
        shortest, longest = range_of_growths(phases)
        for _ in range(HALVINGS):
            shortest, longest = halved_growths(phases, y, shortest, longest)
        found = changes_between(phases, shortest, longest)
        full = sum(found[k] for k in static_range(PHASES)) > 0.0
        low, high = y if full else low, high if full else y
    return changes_between(phases, shortest, longest)


@row
def bisect_cells(states: States, P, F, T, cells: Cells, fluxes: CellFluxes, step: StageStep, n):
    """Relax those of the n cells by bisection that `update_row` has not."""
    i = next_negative(T, 0, 0, n)
    while i < n:
        before = state_of_cell(states.before, i, cells)
        phases, moved = before_relaxation(
            before,
            state_of_cell(states.now, i, cells),
            primitives_of_cell(P, i, cells),
            change_by_fluxes(P, F, states.volumes, i, cells, fluxes, step),
            step.b,
            step.dt,
        )
        first = cells.state + (PHASES + DIMENSIONS + 1) * cells.state_variables + i
        if PHASES == 2:
            low, high = range_of_change(phases)
            for _ in range(HALVINGS):
                low, high = halved_range(phases, low, high)
            store(states.after, first, fraction_after(before, moved + 0.5 * (low + high)))
        else:
            changes = bisected_changes(phases)
            fractions = fractions_after(before, tuple(moved[k] + changes[k] for k in static_range(PHASES - 1)))
            for k in static_range(PHASES - 1):
                store(states.after, first + k * cells.state_variables, fractions[k])
        i = next_negative(T, 0, i + 1, n)


# ---- cells that are alike --------------------------------------------------------------------------------------------


@row
def count_unlike(U, u, first, su, n):
    """How many values of the n cells at U[u …] differ from those of the cell at `first`; a NaN differs from all."""
    count = 0
    for v in static_range(VARIABLES):
        value = load(U, first + v * su)
        for i in range(n):
            count += 1 if load(U, u + v * su + i) != value else 0
    return count


@row
def repeat_row(U, u, first, su, n):
    """The n cells at U[u …] get the values of the cell at `first`."""
    for v in static_range(VARIABLES):
        value = load(U, first + v * su)
        for i in range(n):
            store(U, u + v * su + i, value)
