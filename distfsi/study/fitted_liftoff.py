"""The cylinder of `study liftoff` by an independent computation on a mesh fitted to it, the floor and the ceiling.

As `fitted_cylinder`, above and below the cylinder, and the mesh stretches when the cylinder rises: what its faces sweep
is added to the volumes of cells, so that a uniform flow stays uniform. The cylinder must not touch the floor at first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from distfsi.study.fitted_cylinder import (
    AHEAD,
    BEHIND,
    CENTRE,
    CFL,
    GAMMA,
    LENGTH,
    RADIUS,
    SHOCK_SPEED,
    SHOCK_START,
    Array,
    face_values,
    flux,
    mirrored,
    one_sided,
)

HEIGHT = 0.2  # of the channel
ROWS_BELOW, ROWS_ABOVE = 0.25, 0.5  # over the cells around half the cylinder
START = np.array([CENTRE, RADIUS])  # of a cylinder on the floor


class Lift(NamedTuple):
    """Where the cylinder's centre is, and its velocity, at the start and after each step: (steps + 1,) each."""

    time: Array
    x: Array
    y: Array
    u: Array
    v: Array


def lift(gap: float, density: float, end: float, angles: int) -> Lift:
    """The flight of a cylinder that starts a `gap` above the floor, with so many cells around half of it."""
    mesh = _Mesh(angles)
    position, velocity = START + (0.0, gap), np.zeros(2)
    mass = np.pi * RADIUS**2 * density
    Q = mesh.content(position)
    time, samples = 0.0, []
    while time < end:
        samples.append((time, *position, *velocity))
        dt = min(CFL * mesh.largest_step(Q, position, velocity), end - time)
        rate, force = mesh.rates(Q, time, position, velocity)
        Q1, position1, velocity1 = Q + dt * rate, position + dt * velocity, velocity + dt * force / mass
        rate, force = mesh.rates(Q1, time + dt, position1, velocity1)
        Q = 0.5 * (Q + Q1 + dt * rate)
        position = 0.5 * (position + position1 + dt * velocity1)
        velocity = 0.5 * (velocity + velocity1 + dt * force / mass)
        time += dt
    return Lift(*np.array([*samples, (time, *position, *velocity)]).T)


class _Mesh:
    """Columns from the floor to the ceiling; those at the cylinder (`wet`) begin and end at it.

    Contents are (5, rows, columns): mass, momentum, energy and volume. Coordinates are counted from the centre.
    """

    def __init__(self, angles: int):
        step = np.pi / angles
        ahead = np.cumsum(RADIUS * step * (1.0 + 3.0 / angles) ** np.arange(20 * angles))
        ahead = ahead[ahead < LENGTH]
        gone = np.concatenate([-ahead[::-1], np.zeros(angles + 1), ahead])
        turn = np.pad(step * np.arange(angles + 1) - 0.5 * np.pi, len(ahead), mode="edge")  # from the vertical
        self.curve = np.array([RADIUS * np.sin(turn) + gone, np.where(gone == 0.0, RADIUS * np.cos(turn), 0.0)])
        self.outer = RADIUS * (np.sin(turn) + np.sign(turn) * (1.0 - np.cos(turn))) + gone
        self.wet = slice(len(ahead), len(ahead) + angles)
        self.dry = np.delete(np.arange(len(gone) - 1), self.wet)
        self.shares = [
            np.linspace(1.0, 0.0, round(ROWS_BELOW * angles) + 1),
            np.linspace(0.0, 1.0, round(ROWS_ABOVE * angles) + 1),
        ]
        self.below = len(self.shares[0]) - 1

    def parts(self, height: float) -> list[Array]:
        """Vertices (2, rows, columns) below and above a centre at a height."""
        curves = self.curve * [[1.0], [-1.0]], self.curve
        ends = (np.array([self.outer, np.full_like(self.outer, y)]) for y in (-height, HEIGHT - height))
        return [c[:, None] + s[:, None] * (e - c)[:, None] for c, s, e in zip(curves, self.shares, ends, strict=True)]

    def incident(self, time: float, position: Array) -> Array:
        """Density, velocity, pressure behind and ahead of the undisturbed shock in all cells."""
        middle = np.concatenate([_means(part) for part in self.parts(position[1])], axis=1)
        passed = middle[0] + position[0] < SHOCK_START + SHOCK_SPEED * time
        return np.where(passed, np.array(BEHIND)[:, None, None], np.array(AHEAD)[:, None, None])

    def content(self, position: Array) -> Array:
        """What the cells hold at the start."""
        rho, u, v, p = self.incident(0.0, position)
        volume = np.concatenate([_volumes(part) for part in self.parts(position[1])])
        return volume * np.array(
            [rho, rho * u, rho * v, p / (GAMMA - 1.0) + 0.5 * rho * (u**2 + v**2), np.ones_like(rho)]
        )

    def largest_step(self, Q: Array, position: Array, velocity: Array) -> float:
        """The time in which no signal crosses a cell."""
        rho, u, v, p = _states(Q)
        sides = [(np.hypot(*_along(part))[:-1], np.hypot(*_across(part))[:, :-1]) for part in self.parts(position[1])]
        longest = [np.maximum(*pair) for pair in sides]
        signal = np.hypot(u - velocity[0], v - velocity[1]) + np.sqrt(GAMMA * p / rho) + abs(velocity[1])
        return float((Q[4] / np.concatenate(longest) / signal).min())

    def rates(self, Q: Array, time: float, position: Array, velocity: Array) -> tuple[Array, Array]:
        """Rates of the contents, and the force on the cylinder."""
        w, far, parts = _states(Q), self.incident(time, position), self.parts(position[1])
        below, wet, dry = self.below, self.wet, self.dry
        rate = np.zeros_like(Q)
        faces = [np.array([-a[1], a[0]]) for a in map(_along, parts)]
        speeds = [_speeds(velocity, share[:, None]) for share in self.shares]
        whole = [np.concatenate([low[:, :-1], high], axis=1) for low, high in (faces, speeds)]
        rate[:, :, dry] -= np.diff(_through(w[:, :, dry], whole[0][:, :, dry], whole[1], velocity), axis=1)
        under = _through(w[:, :below, wet], faces[0][:, :, wet], speeds[0], velocity)
        over = _through(w[:, below:, wet], faces[1][:, :, wet], speeds[1], velocity)
        rate[:, :below, wet] -= np.diff(under, axis=1)
        rate[:, below:, wet] -= np.diff(over, axis=1)
        sides = np.concatenate([np.array([a[1], -a[0]]) for a in map(_across, parts)], axis=1).swapaxes(1, 2)
        middles = np.concatenate([0.5 * (share[1:] + share[:-1]) for share in self.shares])
        along = _through(w.swapaxes(1, 2), sides, _speeds(velocity, middles[None, :]), velocity, far.swapaxes(1, 2))
        rate -= np.diff(along, axis=1).swapaxes(1, 2)
        return rate, under[1:3, -1].sum(axis=1) - over[1:3, 0].sum(axis=1)


def _speeds(velocity: Array, share: Array) -> Array:
    """Velocity (2, ...) of the mesh: the cylinder's beside it, and only along the floor and the ceiling there."""
    return np.array([np.full_like(share, velocity[0]), velocity[1] * (1.0 - share)])


def _through(w: Array, faces: Array, speed: Array, body: Array, far: Array | None = None) -> Array:
    """What goes through moving faces (2, n + 1, m) across the first axis of states (4, n, m) between
    walls, or between states that are `far` away."""
    length = np.hypot(*faces)
    normal = faces / length
    ends = one_sided(w) if far is None else (far[:, :1], far[:, -1:])
    low, high = face_values(np.concatenate([ends[0], w, ends[1]], axis=1))
    low[1:3] -= speed
    high[1:3] -= speed
    if far is None:
        low[:, 0], high[:, -1] = mirrored(high[:, 0], *normal[:, 0]), mirrored(low[:, -1], *normal[:, -1])
    f = flux(low, high, *normal)
    f[3] += speed[0] * f[1] + speed[1] * f[2] + 0.5 * (speed**2).sum(axis=0) * f[0]
    f[1:3] += speed * f[0]
    swept = ((speed - body[:, None, None]) * normal).sum(axis=0)
    return np.concatenate([f, -swept[None]]) * length


def _states(Q: Array) -> Array:
    """Density, velocity, pressure."""
    rho, u, v = Q[0] / Q[4], Q[1] / Q[0], Q[2] / Q[0]
    return np.array([rho, u, v, (GAMMA - 1.0) * (Q[3] / Q[4] - 0.5 * rho * (u**2 + v**2))])


def _along(part: Array) -> Array:
    return np.diff(part, axis=2)


def _across(part: Array) -> Array:
    return np.diff(part, axis=1)


def _means(part: Array) -> Array:
    rows = part[:, 1:] + part[:, :-1]
    return 0.25 * (rows[:, :, 1:] + rows[:, :, :-1])


def _volumes(part: Array) -> Array:
    a, b = part[:, 1:, 1:] - part[:, :-1, :-1], part[:, 1:, :-1] - part[:, :-1, 1:]
    return 0.5 * np.abs(a[0] * b[1] - a[1] * b[0])
