"""A cylinder that a shock throws along x, by an independent computation on meshes fitted to its wall.

Euler's equations on a mesh that moves with the cylinder: MUSCL (van Leer 1979) in the indices of a smooth mesh, HLLC
(Toro, chapter 10), Heun's method. The wall is a line of the mesh, and the cylinder gets the momentum that goes through
it. By symmetry the upper half is enough. Nothing is shared with the solver.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]  # states: (4, rows, columns), of density, velocity and pressure, or conserved variables

GAMMA = 1.4
AHEAD = (1.4, 0.0, 0.0, 1.0)  # density, velocity, pressure of gas at rest in which sound has the speed 1
BEHIND = (5.4, 20.0 / 9.0, 0.0, 31.0 / 3.0)  # and behind a shock of Mach 3
SHOCK_SPEED, SHOCK_START = 3.0, 0.08
RADIUS, CENTRE = 0.05, 0.15
OUTER = 0.4  # radius of the mesh in unbounded gas: no wave is there and back before the end of the case
HEIGHT, LENGTH = 0.1, 1.0  # of half a channel, and of the mesh to either side of the cylinder in it
CFL = 0.4


class Flight(NamedTuple):
    """Where the cylinder's centre is, and its velocity, at the start and after each step: (steps + 1,) each."""

    time: Array
    x: Array
    u: Array


def unbounded(angles: int) -> Array:
    """Vertices (2, rows, columns) of square cells between rays and circles, so many around half a circle."""
    step = np.pi / angles
    radius = RADIUS * np.exp(step * np.arange(round(np.log(OUTER / RADIUS) / step) + 1))[:, None]
    angle = np.pi - step * np.arange(angles + 1)
    return np.array([radius * np.cos(angle), radius * np.sin(angle)])


def channel(angles: int) -> Array:
    """The same between the axis, on which half a circle lies, and the wall of a channel."""
    angle = np.pi - np.pi / angles * np.arange(angles + 1)
    steps = np.pi * RADIUS / angles * (1.0 + 3.0 / angles) ** np.arange(20 * angles)
    ahead = np.cumsum(steps)
    ahead = ahead[ahead < LENGTH]
    gone = np.concatenate([-ahead[::-1], np.zeros(angles + 1), ahead])
    angle = np.pad(angle, len(ahead), mode="edge")
    low = np.array([RADIUS * np.cos(angle) + gone, RADIUS * np.sin(angle)])
    low[1, gone != 0.0] = 0.0
    high = np.array([3.0 * RADIUS * (1.0 - 2.0 / np.pi * angle) + gone, np.full(len(gone), HEIGHT)])
    share = np.linspace(0.0, 1.0, angles // 2 + 1)[:, None]
    return low[:, None] + share * (high - low)[:, None]


def fly(vertices: Array, density: float, end: float) -> Flight:
    """The flight of a cylinder of a `density` up to the time `end`, on a mesh around it."""
    mesh = _Mesh(vertices)
    mass = 0.5 * np.pi * RADIUS**2 * density
    q = mesh.content(CENTRE)
    time, x, u, samples = 0.0, CENTRE, 0.0, []
    while time < end:
        samples.append((time, x, u))
        dt = min(CFL * mesh.largest_step(q, u), end - time)
        rate, force = mesh.rates(q, time, x, u)
        q1, x1, u1 = q + dt * rate, x + dt * u, u + dt * force / mass
        rate, force = mesh.rates(q1, time + dt, x1, u1)
        q = 0.5 * (q + q1 + dt * rate)
        x, u, time = 0.5 * (x + x1 + dt * u1), 0.5 * (u + u1 + dt * force / mass), time + dt
    return Flight(*np.array([*samples, (time, x, u)]).T)


class _Mesh:
    """Cells between `vertices` (2, rows, columns): of the gas above the axis, around a cylinder at the origin.

    The first row lies on the cylinder and on the axis. The last row is a wall if it is flat, and the ends of the rows
    are far away; otherwise they lie on the axis, and the last row is far away.
    """

    def __init__(self, vertices: Array):
        (right, up), (out_x, out_y) = np.diff(vertices, axis=2), np.diff(vertices, axis=1)
        faces = np.array([-up, right]), np.array([out_y, -out_x]).swapaxes(1, 2)  # across rows; across columns
        self.lengths = [np.hypot(*face) for face in faces]
        self.normals = [face / length for face, length in zip(faces, self.lengths, strict=True)]
        a, b = vertices[:, 1:, 1:] - vertices[:, :-1, :-1], vertices[:, 1:, :-1] - vertices[:, :-1, 1:]
        self.volume = 0.5 * np.abs(a[0] * b[1] - a[1] * b[0])
        low, high = vertices[0, :-1], vertices[0, 1:]
        self.x = 0.25 * (low[:, 1:] + low[:, :-1] + high[:, 1:] + high[:, :-1])
        self.width = self.volume / np.maximum(self.lengths[0][:-1], self.lengths[1][:-1].T)
        self.wet = np.hypot(*(0.5 * (vertices[:, 0, 1:] + vertices[:, 0, :-1]))) < RADIUS
        flat = bool(np.ptp(vertices[1, -1]) == 0.0)
        self.walls = (True, flat), (not flat, not flat)

    def incident(self, time: float, x: float) -> Array:
        """Density, velocity, pressure behind and ahead of the undisturbed shock, in cells around a centre at x."""
        passed = self.x + x < SHOCK_START + SHOCK_SPEED * time
        return np.where(passed, np.array(BEHIND)[:, None, None], np.array(AHEAD)[:, None, None])

    def content(self, x: float) -> Array:
        """Conserved variables per volume at the start."""
        rho, u, v, p = self.incident(0.0, x)
        return np.array([rho, rho * u, rho * v, p / (GAMMA - 1.0) + 0.5 * rho * (u**2 + v**2)])

    def largest_step(self, q: Array, speed: float) -> float:
        """The time in which no signal crosses a cell of the mesh, which moves at `speed`."""
        rho, u, v, p = _against(q, speed)
        return float((self.width / (np.hypot(u, v) + np.sqrt(GAMMA * p / rho))).min())

    def rates(self, q: Array, time: float, x: float, speed: float) -> tuple[Array, float]:
        """Rates of the conserved variables, and the force along x on the upper half of the cylinder."""
        w, far = _against(q, speed), self.incident(time, x)
        far[1] -= speed
        outwards = self._through(w, far, 0)
        along = self._through(w.swapaxes(1, 2), far.swapaxes(1, 2), 1)
        rate = -(np.diff(outwards, axis=1) + np.diff(along, axis=1).swapaxes(1, 2)) / self.volume
        rate[3] += speed * rate[1] + 0.5 * speed**2 * rate[0]  # from the frame of the mesh to that of the gas ahead
        rate[1] += speed * rate[0]
        return rate, -float(outwards[1, 0, self.wet].sum())

    def _through(self, w: Array, far: Array, axis: int) -> Array:
        """What goes through the faces across an axis of the mesh, which is the first of the states' two."""
        normal, (low_wall, high_wall) = self.normals[axis], self.walls[axis]
        low_ghost, high_ghost = one_sided(w)
        low_ghost, high_ghost = low_ghost if low_wall else far[:, :1], high_ghost if high_wall else far[:, -1:]
        low, high = face_values(np.concatenate([low_ghost, w, high_ghost], axis=1))
        if low_wall:
            low[:, 0] = mirrored(high[:, 0], *normal[:, 0])
        if high_wall:
            high[:, -1] = mirrored(low[:, -1], *normal[:, -1])
        return flux(low, high, *normal) * self.lengths[axis]


def _against(q: Array, speed: float) -> Array:
    """Density, velocity against the mesh, pressure."""
    u, v = q[1] / q[0], q[2] / q[0]
    return np.array([q[0], u - speed, v, (GAMMA - 1.0) * (q[3] - 0.5 * q[0] * (u**2 + v**2))])


def face_values(w: Array) -> tuple[Array, Array]:
    """States on both sides of the faces between cells along the first axis, from cells and a ghost at each end."""
    change = np.diff(w, axis=1)
    a, b = change[:, :-1], change[:, 1:]
    product = a * b
    slope = np.where(product > 0.0, 2.0 * product / np.where(product > 0.0, a + b, 1.0), 0.0)
    low, high = w[:, :-1].copy(), w[:, 1:].copy()
    low[:, 1:] += 0.5 * slope
    high[:, :-1] -= 0.5 * slope
    return low, high


def one_sided(w: Array) -> tuple[Array, Array]:
    """Ghosts at both ends that make the slopes there one-sided, or none where density or pressure might lose half."""
    low, high = w[:, 1:2] - w[:, :1], w[:, -1:] - w[:, -2:-1]
    return w[:, :1] - _safe(w[:, :1], low), w[:, -1:] + _safe(w[:, -1:], high)


def _safe(w: Array, slope: Array) -> Array:
    return np.where((np.abs(slope) < w)[[0, 3]].all(axis=0), slope, 0.0)


def mirrored(w: Array, nx: Array, ny: Array) -> Array:
    """The state behind a wall with the normal (nx, ny)."""
    normal = w[1] * nx + w[2] * ny
    return np.array([w[0], w[1] - 2.0 * normal * nx, w[2] - 2.0 * normal * ny, w[3]])


def flux(low: Array, high: Array, nx: Array, ny: Array) -> Array:
    """HLLC flux along (nx, ny), with the wave speeds of Roe's averages (Einfeldt)."""
    (rho_l, u_l, v_l, p_l), (rho_r, u_r, v_r, p_r) = low, high
    n_l, n_r = u_l * nx + v_l * ny, u_r * nx + v_r * ny
    c_l, c_r = np.sqrt(GAMMA * p_l / rho_l), np.sqrt(GAMMA * p_r / rho_r)
    weight = np.sqrt(rho_l) / (np.sqrt(rho_l) + np.sqrt(rho_r))
    n = weight * n_l + (1.0 - weight) * n_r
    jump = 0.5 * (GAMMA - 1.0) * weight * (1.0 - weight) * (n_r - n_l) ** 2
    c = np.sqrt(weight * c_l**2 + (1.0 - weight) * c_r**2 + jump)
    s_l, s_r = np.minimum(n_l - c_l, n - c), np.maximum(n_r + c_r, n + c)
    m_l, m_r = rho_l * (s_l - n_l), rho_r * (s_r - n_r)
    star = (p_r - p_l + m_l * n_l - m_r * n_r) / (m_l - m_r)
    left = star > 0.0
    rho, u, v, p, n, s = (np.where(left, a, b) for a, b in zip((*low, n_l, s_l), (*high, n_r, s_r), strict=True))
    energy = p / (GAMMA - 1.0) + 0.5 * rho * (u**2 + v**2)
    inside = np.where(left, s < 0.0, s > 0.0)
    ratio = np.where(inside, (s - n) / np.where(inside, s - star, 1.0), 1.0)
    speed = np.where(inside, star, n)  # of the gas at the face
    pressure = np.where(inside, p + rho * (s - n) * (star - n), p)
    change = speed - n
    mass = ratio * rho * speed
    gain = np.where(inside, change * (star + p / (rho * np.where(inside, s - n, 1.0))), 0.0)
    return np.array(
        [
            mass,
            mass * (u + change * nx) + pressure * nx,
            mass * (v + change * ny) + pressure * ny,
            mass * (energy / rho + gain) + pressure * speed,
        ]
    )
