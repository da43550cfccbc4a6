"""Instantaneous pressure relaxation of three to five phases (relaxation.py tells of each phase's path).

All phases get the pressure p at which their volumes fill the cell. With a hyperbola a = a0 + k (p0 - p)/(p + P) per
phase that is the root of sum k (p0 - p)/(p + P), which falls and is convex in p: Newton's steps from a lower bound go
up to the only root and never beyond. Where laws are not stiffened gases the hyperbolas are fitted again. What
has not settled after a fixed number of steps is told by the last one; there the range of p between the lowest and the
highest phase pressure is halved until it is a point, and for each p those of the growths of volumes.

`phases`, where all phases stand: p_n, then a tuple per quantity: volume fraction, density, reference pressure G, phase
pressure q and stiffness c = p_n + P, both relative to p_n.
"""

from distfsi.fluid.formulas.phases import omegas, references, weights
from distfsi.fluid.formulas.relaxation import DEEPEST, NEAREST, REFITS, SETTLED, TRACE, change_on_path
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import CLOSED_FORM, MINIMUM_FRACTION, PHASES

STEPS = 6  # of Newton: enough for pressures that differ by a factor of 1.3; what is left goes on with bisection
REFIT_STEPS = 2  # of Newton, with the hyperbolas fitted anew
CLOSE = 1e-7  # of p + P of the softest phase: Newton's last step, whose error is about its square


def exponents(rho):
    """g + omega of each phase (stiffness.py)."""
    weight = weights(rho)
    omega = omegas(rho)
    return tuple(weight[k] + omega[k] for k in static_range(PHASES))


def stiffnesses(p_n, rho, reference, exponent):
    """p_n + P of each phase."""
    weight = weights(rho)
    return tuple(
        p_n + (rho[k] * reference[k][1] - weight[k] * reference[k][0]) * (1.0 / exponent[k])
        for k in static_range(PHASES)
    )


def phases_before(p_n, a, da, masses, G_n, gained):
    """`phases` when transport has changed volumes by `da` to `a`, and omega_k times the phase energies by `gained`;
    before, all phases had the pressure p_n and the reference pressures G_n."""
    rho = tuple(masses[k] / a[k] for k in static_range(PHASES))
    reference = references(rho)
    exponent = exponents(rho)
    G = tuple(reference[k][0] for k in static_range(PHASES))
    c = stiffnesses(p_n, rho, reference, exponent)
    q = tuple(
        max((gained[k] - da[k] * (p_n - G_n[k])) / a[k] + (G[k] - G_n[k]), (1.0 + DEEPEST) * abs(c[k]) - c[k])
        for k in static_range(PHASES)
    )
    return (p_n, a, rho, G, q, c)


def lowest_of(values):
    """The lowest of a value per phase."""
    lowest = values[0]
    for k in static_range(1, PHASES):
        lowest = min(lowest, values[k])
    return lowest


def highest_of(values):
    """The highest of a value per phase."""
    highest = values[0]
    for k in static_range(1, PHASES):
        highest = max(highest, values[k])
    return highest


def lower_bound(k, q, c):
    """A pressure at which volumes that grow by k (q - y)/(c + y) do not yet fit into the cell: the lowest of a phase,
    or that which one needs whose volume makes up for all others, if these shrink as far as they can."""
    total = sum(k[n] for n in static_range(PHASES))
    lowest = lowest_of(q)
    return max(lowest, highest_of(tuple(k[n] / total * (q[n] + c[n]) - c[n] for n in static_range(PHASES))))


def newton_step(k, q, c, too_much, y):
    """The next pressure y, and the step to it, at which volumes that grow by k (q - y)/(c + y) shrink together by what
    they have `too_much`."""
    part = tuple(1.0 / (c[n] + y) for n in static_range(PHASES))
    surplus = too_much + sum(k[n] * ((q[n] - y) * part[n]) for n in static_range(PHASES))
    slope = sum(k[n] * ((q[n] + c[n]) * (part[n] * part[n])) for n in static_range(PHASES))
    return (y + surplus / slope, surplus / slope)


def changes_at(k, q, c, y, step):
    """Changes of the volumes at the pressure y; Newton's last step over the c + y of the softest phase."""
    softest = lowest_of(tuple(c[n] + y for n in static_range(PHASES)))
    return (tuple(k[n] * ((q[n] - y) / (c[n] + y)) for n in static_range(PHASES)), abs(step) / softest)


def changes_of_fit(k, q, c):
    """Changes of the volumes that give all phases one pressure when each grows by k (q - y)/(c + y)."""
    y, step = lower_bound(k, q, c), 0.0
    for _ in static_range(STEPS):
        y, step = newton_step(k, q, c, 0.0, y)
    return changes_at(k, q, c, y, step)


def changes_of_refit(k, q, c, too_much):
    """The same where the pressures are near each other already."""
    y, step = lower_bound(k, q, c), 0.0
    for _ in static_range(REFIT_STEPS):
        y, step = newton_step(k, q, c, too_much, y)
    return changes_at(k, q, c, y, step)


def pressures_after(phases, growth):
    """Pressures - p_n of all phases whose volumes have grown by the parts `growth`."""
    p_n, a, rho, G, q, c = phases
    now = tuple(rho[k] / (1.0 + growth[k]) for k in static_range(PHASES))
    reference = references(now)
    before = omegas(rho)
    omega = omegas(now)
    return tuple(
        q[k]
        + change_on_path(growth[k], p_n + q[k], G[k], reference[k][0], omega[k])
        + (omega[k] / before[k] - 1.0) * (p_n + q[k] - G[k]) / (1.0 + (1.0 + omega[k]) * growth[k])
        for k in static_range(PHASES)
    )


def range_of_growths(phases):
    """Least and largest part by which the volume of each phase can grow with a finite pressure."""
    p_n, a, rho, G, q, c = phases
    exponent = exponents(rho)
    smallest = tuple(
        max(MINIMUM_FRACTION / a[k], NEAREST * (1.0 - 1.0 / exponent[k])) - 1.0 for k in static_range(PHASES)
    )
    return (smallest, tuple((1.0 - a[k]) / a[k] for k in static_range(PHASES)))


def settled_by(step, allowed):
    """How much the last step is less than it may be; negative also where there is none (NaN)."""
    return allowed - step if step < allowed else -1.0


def relaxed_changes(phases):
    """Changes of all volumes by relaxation, and a value that is negative where they have not settled."""
    p_n, a, rho, G, q, c = phases
    exponent = exponents(rho)
    changes, left = changes_of_fit(tuple(a[k] * (1.0 / exponent[k]) for k in static_range(PHASES)), q, c)
    if CLOSED_FORM:
        return (changes, settled_by(left, CLOSE))
    else:
        smallest, largest = range_of_growths(phases)
        growth = tuple(min(max(changes[k] / a[k], smallest[k]), largest[k]) for k in static_range(PHASES))
        before = growth
        for _ in static_range(REFITS):
            before = growth
            now = tuple(rho[k] / (1.0 + growth[k]) for k in static_range(PHASES))
            exponent_now = exponents(now)
            omega_now = omegas(now)
            fit = tuple(a[k] * (1.0 + (1.0 + omega_now[k]) * growth[k]) / exponent_now[k] for k in static_range(PHASES))
            stiff = stiffnesses(p_n, now, references(now), exponent_now)
            too_much = sum(a[k] * growth[k] for k in static_range(PHASES))  # where a bound has cut something off
            further, left = changes_of_refit(fit, pressures_after(phases, growth), stiff, too_much)
            growth = tuple(
                min(max(before[k] + further[k] / a[k], smallest[k]), largest[k]) for k in static_range(PHASES)
            )
        moved = highest_of(
            tuple(
                abs(growth[k] - before[k]) * (a[k] / max(a[k] * (1.0 + growth[k]), TRACE)) for k in static_range(PHASES)
            )
        )
        return (tuple(a[k] * growth[k] for k in static_range(PHASES)), settled_by(max(moved, left), SETTLED))


def range_of_pressure(phases):
    """Pressures - p_n between which all phases can share one."""
    return (lowest_of(phases[4]), highest_of(phases[4]))


def halved_growths(phases, y, low, high):
    """The halves of the ranges low ... high in which the growths are that give each phase the pressure y + p_n."""
    middle = tuple(0.5 * (low[k] + high[k]) for k in static_range(PHASES))
    pressure = pressures_after(phases, middle)
    return (
        tuple(middle[k] if pressure[k] > y else low[k] for k in static_range(PHASES)),
        tuple(high[k] if pressure[k] > y else middle[k] for k in static_range(PHASES)),
    )


def changes_between(phases, low, high):
    """Changes of the volumes in the middle of ranges of growths."""
    a = phases[1]
    return tuple(a[k] * (0.5 * (low[k] + high[k])) for k in static_range(PHASES))
