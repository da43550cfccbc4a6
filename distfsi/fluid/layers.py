"""Fluid at rest under a body force: the pressure of each layer of cells, in the way the stage balances it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from distfsi.errors import InputError
from distfsi.mesh.blocks import Grid
from distfsi.scene.description import Box, HalfSpace, Shape

ROUNDS = 200  # of finding densities from pressures and pressures from densities, at most
SETTLED = 4e-16  # relative change of the pressures at which they are found


@dataclass(frozen=True)
class Layers:
    """The layers of cells across an axis, and their pressures (n,) [Pa]."""

    axis: int
    grid: Grid
    pressures: np.ndarray

    @classmethod
    def at_rest(
        cls,
        grid: Grid,
        force: tuple[int, float],
        level: float,
        pressure: float,
        densities_of: Callable[[np.ndarray], np.ndarray],
    ) -> Layers:
        """Under a `force` along an axis [m/s2], with the `pressure` [Pa] at the coordinate `level` [m].

        densities_of (n,) -> (n,): of the layers at pressures. From layer to layer the pressure grows by the mean of
        their densities times g h (fluid/formulas/hydrostatics.py). Raises InputError where there is no such state.
        """
        axis, fall = force[0], force[1] * grid.spacing[force[0]]
        index = (level - grid.lower[axis]) / grid.spacing[axis] - 0.5
        start = int(np.clip(round(index), 0, grid.cells[axis] - 1))
        pressures = np.full(grid.cells[axis], float(pressure))
        with np.errstate(all="ignore"):
            for _ in range(ROUNDS):
                before, rho = pressures, densities_of(pressures)
                grown = np.concatenate([[0.0], np.cumsum(0.5 * fall * (rho[1:] + rho[:-1]))])
                pressures = pressure + (start - index) * fall * rho[start] + (grown - grown[start])
                if np.abs(pressures - before).max() <= SETTLED * np.abs(pressures).max():
                    return cls(axis, grid, pressures)
        raise InputError(
            [f"fluid.hydrostatic_level: nothing is at rest here: pressures come to {pressures.min():.4g} Pa"]
        )

    def of(self, first: int, count: int) -> tuple[slice, tuple[int, ...]]:
        """Which layers `count` cells from cell `first` of the grid on are in; their shape beside cells (z, y, x)."""
        shape = tuple(count if 2 - self.axis == d else 1 for d in range(3))
        return slice(first, first + count), shape

    def index(self, positions: np.ndarray) -> np.ndarray:
        """The layers (n,) that points (n, D) [m] lie in."""
        along = (positions[:, self.axis] - self.grid.lower[self.axis]) / self.grid.spacing[self.axis]
        return np.clip(along.astype(np.int64), 0, len(self.pressures) - 1)


def is_layer(shape: Shape | None, axis: int, grid: Grid) -> bool:
    """Whether a region's shape lies across the whole domain, from one coordinate along `axis` to another."""
    match shape:
        case None:
            return True
        case HalfSpace(_, normal):
            return all((n != 0.0) == (d == axis) for d, n in enumerate(normal))
        case Box(lower, upper):
            ends = enumerate(zip(lower, upper, grid.lower, grid.upper, strict=False))
            return all(d == axis or (a <= low and b >= high) for d, (a, b, low, high) in ends)
    return False
