"""Instantaneous pressure relaxation of the six-equation model (paper, Eq. 28 corrected).

Each phase keeps e - e0 + p (1/rho - 1/rho0) = 0 while its volume fraction moves until both pressures agree. This path
is explicit in the growth t = a/a0 - 1 of its volume (G: reference pressure):

    p(t) - p0 = ((G - G0)(1 + t) - ((p0 - G0) + omega p0) t + (omega/omega0 - 1)(p0 - G0)) / (1 + (1 + omega) t),
    dp/dt = -(g + omega)(p + P) / (1 + (1 + omega) t)    (stiffness.py).

Of ideal, stiffened, Noble-Abel and Noble-Abel stiffened gas it is the hyperbola a = a0 + k (p0 - p)/(p + P) with
k = a0/(g + omega), and the common pressure is the root of a quadratic. Otherwise the hyperbola with the path's slope is
fitted where both phases stand and solved again, a fixed number of times. The last fit's step tells where that was not
enough; there the range of volume fractions is halved until it is a point. Pressures are relative to the pressure before
the step, so that nothing moves, to the bit, when nothing changed.
"""

from math import sqrt

from distfsi.fluid.formulas.stiffness import exponent_1, exponent_2, weight_1, weight_2
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import CLOSED_FORM, MINIMUM_FRACTION, grueneisen_1, grueneisen_2, reference_1, reference_2

REFITS = 3  # with JWL both pressures agree to 1e-6 after imbalances up to a factor 2, to 1e-2 after a factor 10
SETTLED = 1e-6  # of the smaller volume fraction: the last fit's step, whose error is about its square
TRACE = 1e-5  # the smallest volume fraction that counts as such: smaller ones are settled to its square all the same
DEEPEST = -0.9  # a phase pressure may fall by this part of p + P in one stage; the total energy is not touched
NEAREST = 1.000001  # to the volume at which a phase's pressure has no bound


def fraction_change_of_fit(k1, q1, c1, k2, q2, c2):
    """Change of a1 that gives both phases one pressure p when a_k grows by k (p_k - p)/(p + P_k).

    q: phase pressure and c = p_n + P, both relative to the same p_n.
    """
    quadratic = k1 + k2
    linear = k1 * (c2 - q1) + k2 * (c1 - q2)
    constant = k1 * q1 * c2 + k2 * q2 * c1
    root = sqrt(max(linear * linear + 4.0 * quadratic * constant, 0.0))
    y = 2.0 * constant / (linear + root) if linear > 0.0 else (root - linear) / (2.0 * quadratic)
    return k1 * (q1 - y) / (c1 + y)


def change_on_path(t, p0, G0, reference, omega):
    """Pressure change of a phase whose volume has grown by the part t, as far as omega is the one before."""
    return ((reference - G0) * (1.0 + t) - ((p0 - G0) + omega * p0) * t) / (1.0 + (1.0 + omega) * t)


def phases_before(p_n, a1, da, m1, m2, G1_n, G2_n, we1, we2):
    """Where both phases stand: p_n, a1, then of each its density, reference pressure, p - p_n, and p_n + P.

    Transport changed a1 by `da`, and omega_k times the phase energies by we1, we2; before, both phases had the pressure
    p_n and the reference pressures G_n.
    """
    a2 = 1.0 - a1
    rho1, rho2 = m1 / a1, m2 / a2
    G1, slope1 = reference_1(rho1)
    G2, slope2 = reference_2(rho2)
    c1 = p_n + (rho1 * slope1 - weight_1(rho1) * G1) * (1.0 / exponent_1(rho1))
    c2 = p_n + (rho2 * slope2 - weight_2(rho2) * G2) * (1.0 / exponent_2(rho2))
    q1 = max((we1 - da * (p_n - G1_n)) / a1 + (G1 - G1_n), DEEPEST * c1)
    q2 = max((we2 + da * (p_n - G2_n)) / a2 + (G2 - G2_n), DEEPEST * c2)
    return (p_n, a1, rho1, G1, q1, c1, rho2, G2, q2, c2)


def range_of_change(phases):
    """Least and largest change of a1 at which both phases have a volume and a finite pressure."""
    p_n, a1, rho1, G1, q1, c1, rho2, G2, q2, c2 = phases
    a2 = 1.0 - a1
    k1, k2 = a1 * (1.0 / exponent_1(rho1)), a2 * (1.0 / exponent_2(rho2))
    lowest = max(MINIMUM_FRACTION, NEAREST * (a1 - k1)) - a1
    return (lowest, a2 - max(MINIMUM_FRACTION, NEAREST * (a2 - k2)))


def phases_after(phases, change):
    """p - p_n and p_n + P of both phases when a1 has changed."""
    p_n, a1, rho1, G1, q1, c1, rho2, G2, q2, c2 = phases
    t1, t2 = change / a1, -change / (1.0 - a1)
    now1, now2 = rho1 / (1.0 + t1), rho2 / (1.0 + t2)
    ref1, slope1 = reference_1(now1)
    ref2, slope2 = reference_2(now2)
    before1, before_slope1 = grueneisen_1(rho1)
    before2, before_slope2 = grueneisen_2(rho2)
    omega1, omega_slope1 = grueneisen_1(now1)
    omega2, omega_slope2 = grueneisen_2(now2)
    more1 = (omega1 / before1 - 1.0) * (p_n + q1 - G1) / (1.0 + (1.0 + omega1) * t1)
    more2 = (omega2 / before2 - 1.0) * (p_n + q2 - G2) / (1.0 + (1.0 + omega2) * t2)
    return (
        q1 + change_on_path(t1, p_n + q1, G1, ref1, omega1) + more1,
        p_n + (now1 * slope1 - weight_1(now1) * ref1) * (1.0 / exponent_1(now1)),
        q2 + change_on_path(t2, p_n + q2, G2, ref2, omega2) + more2,
        p_n + (now2 * slope2 - weight_2(now2) * ref2) * (1.0 / exponent_2(now2)),
    )


def refitted_1(k, change, a, rho):
    """k of phase 1's hyperbola when its volume a has changed; that is by the change itself where omega is constant."""
    t = change / a
    now = rho / (1.0 + t)
    omega, omega_slope = grueneisen_1(now)
    return k + change if omega_slope == 0.0 else a * (1.0 + (1.0 + omega) * t) / exponent_1(now)


def refitted_2(k, change, a, rho):
    """The same of phase 2."""
    t = change / a
    now = rho / (1.0 + t)
    omega, omega_slope = grueneisen_2(now)
    return k + change if omega_slope == 0.0 else a * (1.0 + (1.0 + omega) * t) / exponent_2(now)


def relaxed_fraction_change(phases):
    """Change of a1 by relaxation, and how much SETTLED exceeds its last step: negative where it has not relaxed."""
    p_n, a1, rho1, G1, q1, c1, rho2, G2, q2, c2 = phases
    a2 = 1.0 - a1
    k1, k2 = a1 * (1.0 / exponent_1(rho1)), a2 * (1.0 / exponent_2(rho2))
    change = fraction_change_of_fit(k1, q1, c1, k2, q2, c2)
    if CLOSED_FORM:
        return (change, 0.0)
    else:
        lowest, highest = range_of_change(phases)
        change = min(max(change, lowest), highest)
        for _ in static_range(REFITS):
            now1, stiff1, now2, stiff2 = phases_after(phases, change)
            before = change
            fit1, fit2 = refitted_1(k1, change, a1, rho1), refitted_2(k2, -change, a2, rho2)
            further = fraction_change_of_fit(fit1, now1, stiff1, fit2, now2, stiff2)
            change = min(max(before + further, lowest), highest)
        return (change, SETTLED * max(min(a1 + change, a2 - change), TRACE) - abs(change - before))


def halved_range(phases, low, high):
    """The half of the range low … high in which the change of a1 is that gives both phases one pressure."""
    middle = 0.5 * (low + high)
    now1, stiff1, now2, stiff2 = phases_after(phases, middle)
    increases = now1 > now2
    return (middle if increases else low, high if increases else middle)
