"""Bars in bodies: trusses whose nodes hold on to the particles around them. All ranks have all of them.

A node goes with what is around it, the linear fit of the particles that its body had there at the start, but for its
slip along the bar; the forces of both go back to the particles with the weights of the fit. So momentum is kept, and
energy, as forces work at the mean of the velocities before and after them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from distfsi.scene.bar_lines import Line
from distfsi.scene.bars import Bars, Bond

STEP = 0.9  # of 1/the highest frequency of a node
FIRST_SLIP = 0.01  # of the slip of the bond's strength: up to there it is linear
STIFF = 1.0  # times the stiffness of an element, across a bar and along one that does not slip


@dataclass
class Nodes:
    """All nodes and elements of the scene, and what holds them.

    position, velocity (n, D), mass, surface (n,) [m2]: of the bar that a node stands for; held (n, D): along which axes
    it does not move; axis (n,): along which its bar lies
    ends (m, 2) nodes of the elements, length, section, law (m,): which of the bars
    tied (t,) ids of particles; around (n, k) which of them, weight (n, k)
    """

    position: np.ndarray
    velocity: np.ndarray
    mass: np.ndarray
    surface: np.ndarray
    held: np.ndarray
    axis: np.ndarray
    law_of_node: np.ndarray
    ends: np.ndarray
    length: np.ndarray
    section: np.ndarray
    law: np.ndarray
    tied: np.ndarray
    around: np.ndarray
    weight: np.ndarray


def bond_stress(bond: Bond, slip: np.ndarray) -> np.ndarray:
    """(n,) [Pa] that a bond bears at its largest slip (n,) [m] so far."""
    first, flat, last = bond.slips
    s0 = FIRST_SLIP * first
    rising = bond.strength * (np.maximum(slip, s0) / first) ** bond.exponent * np.minimum(slip / s0, 1.0)
    falling = 1.0 - (1.0 - bond.residual) * np.clip((slip - flat) / max(last - flat, 1e-300), 0.0, 1.0)
    return np.where(slip < first, rising, bond.strength * falling)


class BarNetwork:
    """The bars of a scene, and their state.

    plastic, strained (m,): plastic strain, and how much there has been; torn (m,)
    stress (m,) [Pa]; slipped, farthest (n,) [m]: plastic slip, and the largest one
    internal [J] what bars and bonds hold or have turned into heat; gravity_work [J]; outside (D,) [N s]: impulse of
    gravity and of symmetry planes, less what a solid takes for such: that of ties on its particles
    """

    def __init__(self, nodes: Nodes, laws: list[Bars], particle_mass: np.ndarray):
        """`particle_mass` (t,) [kg] of the tied particles."""
        self.nodes, self._laws = nodes, laws
        n, m, D = len(nodes.mass), len(nodes.length), nodes.position.shape[1]
        self.plastic, self.strained, self.torn = np.zeros(m), np.zeros(m), np.zeros(m, dtype=bool)
        self.stress, self.slipped, self.farthest = np.zeros(m), np.zeros(n), np.zeros(n)
        self.internal, self.gravity_work, self.outside = 0.0, 0.0, np.zeros(D)
        self._force, self._reaction = np.zeros((n, D)), np.zeros((len(nodes.tied), D))
        of_element = {name: np.array([getattr(law, name) for law in laws])[nodes.law] for name in _NUMBERS}
        self._modulus, self._yield, self._hardening, self._limit = of_element.values()
        stiffness = self._modulus * nodes.section / nodes.length
        beside = np.zeros(n)
        for end in range(2):
            np.add.at(beside, nodes.ends[:, end], stiffness)
        self._tie = STIFF * beside
        self._bond = self._tie.copy()
        for k, law in enumerate(laws):
            if law.bond:
                own, s0 = nodes.law_of_node == k, FIRST_SLIP * law.bond.slips[0]
                self._bond[own] = nodes.surface[own] * bond_stress(law.bond, np.array([s0]))[0] / s0
        # The longest step, by what holds a node and moves with it.
        shared = 1.0 / nodes.mass + (nodes.weight**2 / particle_mass[nodes.around]).sum(axis=1)
        rate2 = 2.0 * beside / nodes.mass + np.maximum(self._tie, self._bond) * shared
        self.longest = STEP / math.sqrt(float(rate2.max()))

    def find_forces(self, position: np.ndarray) -> np.ndarray:
        """Forces (t, D) [N] on the tied particles, which are at a `position` (t, D) [m]; elements and bonds yield."""
        nodes = self.nodes
        self._force = np.zeros_like(nodes.position)
        # elements
        way = nodes.position[nodes.ends[:, 1]] - nodes.position[nodes.ends[:, 0]]
        length = np.linalg.norm(way, axis=1)
        strain = length / nodes.length - 1.0
        trial = self._modulus * (strain - self.plastic)
        beyond = np.maximum(np.abs(trial) - (self._yield + self._hardening * self.strained), 0.0)
        flow = np.where(self.torn, 0.0, beyond / (self._modulus + self._hardening))
        self.plastic, self.strained = self.plastic + np.sign(trial) * flow, self.strained + flow
        self.torn |= self.strained > self._limit
        self.stress = np.where(self.torn, 0.0, self._modulus * (strain - self.plastic))
        pull = (self.stress * nodes.section / length)[:, None] * way
        for end, sign in ((0, 1.0), (1, -1.0)):
            np.add.at(self._force, nodes.ends[:, end], sign * pull)
        # ties
        apart = nodes.position - self.around(position)
        rows = np.arange(len(apart))
        force = -self._tie[:, None] * apart
        force[rows, nodes.axis] = -self._slip(apart[rows, nodes.axis])
        self._force += force
        at, size = nodes.around.ravel(), len(position)
        shares = [-(nodes.weight * along[:, None]).ravel() for along in force.T]
        self._reaction = np.stack([np.bincount(at, share, size) for share in shares], axis=1)
        return self._reaction

    def _slip(self, slip: np.ndarray) -> np.ndarray:
        """(n,) [N] with which what is around nodes resists their `slip` (n,) [m]; bonds yield."""
        resists = self._bond * (slip - self.slipped)
        self.farthest = np.maximum(self.farthest, np.abs(slip))
        for k, law in enumerate(self._laws):
            if law.bond:
                own = self.nodes.law_of_node == k
                bearable = self.nodes.surface[own] * bond_stress(law.bond, self.farthest[own])
                resists[own] = np.clip(resists[own], -bearable, bearable)
        self.slipped = slip - resists / self._bond
        return resists

    def around(self, values: np.ndarray) -> np.ndarray:
        """(n, D) what tied particles with `values` (t, D) have at the nodes."""
        return (self.nodes.weight[:, :, None] * values[self.nodes.around]).sum(axis=1)

    def kick(self, dt: float, mean: np.ndarray, gravity: np.ndarray) -> None:
        """`dt` [s] of the forces of find_forces() and of `gravity` (D,) [m/s2]; `mean` (t, D) [m/s]: velocities of the
        tied particles before and after it."""
        nodes = self.nodes
        mass, before = nodes.mass[:, None], nodes.velocity
        gained = dt * (self._force / mass + gravity)
        nodes.velocity = before + np.where(nodes.held, 0.0, gained)
        own = 0.5 * (before + nodes.velocity)
        self.internal -= dt * float((self._force * own).sum() + (self._reaction * mean).sum())
        self.gravity_work += dt * float((mass * gravity * own).sum())
        held = np.where(nodes.held, -dt * self._force, dt * mass * gravity)
        self.outside = self.outside + held.sum(axis=0) - dt * self._reaction.sum(axis=0)

    def go(self, dt: float) -> None:
        """`dt` [s] of their velocities."""
        self.nodes.position = self.nodes.position + dt * self.nodes.velocity

    # ---- totals and restart ------------------------------------------------------------------------------------------

    @property
    def kinetic(self) -> float:
        """Kinetic energy [J]."""
        return 0.5 * float((self.nodes.mass[:, None] * self.nodes.velocity**2).sum())

    @property
    def momentum(self) -> np.ndarray:
        """(D,) [N s]"""
        return np.asarray((self.nodes.mass[:, None] * self.nodes.velocity).sum(axis=0))

    def state(self) -> dict[str, np.ndarray]:
        """All that changes, by names."""
        return {
            "position": self.nodes.position,
            "velocity": self.nodes.velocity,
            **{name: getattr(self, name) for name in _KEPT},
            "sums": np.array([self.internal, self.gravity_work]),
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on from what state() gave."""
        self.nodes.position, self.nodes.velocity = state["position"], state["velocity"]
        for name in _KEPT:
            setattr(self, name, state[name])
        self.internal, self.gravity_work = map(float, state["sums"])


_NUMBERS = ("modulus", "yield_stress", "hardening", "failure_strain")
_KEPT = ("plastic", "strained", "torn", "stress", "slipped", "farthest", "outside")


def fit_weights(nodes: np.ndarray, points: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(k,) shares of points (k, D) with a `weight` (k,) in the linear fit at a node (D,): they keep linear fields."""
    arm = points - nodes
    basis = np.hstack([np.ones((len(arm), 1)), arm])
    moment = basis.T @ (weight[:, None] * basis)
    return np.asarray(weight * (basis @ np.linalg.pinv(moment, rcond=1e-8)[:, 0]))


def assemble(
    lines: list[tuple[int, int, Line]], laws: list[Bars], per_depth: bool, velocity: np.ndarray
) -> dict[str, np.ndarray]:
    """Nodes and elements of all lines, each with the number of its law and its axis; `velocity` (lines, D) [m/s].
    per_depth: sections are per metre across the plane."""
    parts: dict[str, list[np.ndarray]] = {}
    first = 0
    for (k, axis, line), speed in zip(lines, velocity, strict=True):
        law, n = laws[k], len(line.nodes)
        share = line.share / (law.spacing if per_depth else 1.0)
        length = np.linalg.norm(np.diff(line.nodes, axis=0), axis=1)
        along = 0.5 * (np.append(length, 0.0) + np.append(0.0, length))
        part = {
            "position": line.nodes,
            "velocity": np.where(line.held, 0.0, speed),
            "mass": share * law.density * law.section * along,
            "surface": share * math.pi * law.diameter * along,
            "held": line.held,
            "axis": np.full(n, axis),
            "law_of_node": np.full(n, k),
            "ends": first + np.stack([np.arange(n - 1), np.arange(1, n)], axis=1),
            "length": length,
            "section": np.full(n - 1, share * law.section),
            "law": np.full(n - 1, k),
        }
        first += n
        for name, values in part.items():
            parts.setdefault(name, []).append(values)
    return {name: np.concatenate(values) for name, values in parts.items()}
