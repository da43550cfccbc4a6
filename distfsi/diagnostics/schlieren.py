"""The numerical schlieren picture."""

from __future__ import annotations

import numpy as np

from distfsi.diagnostics.derived import padded
from distfsi.fluid.fluid import Fluid


class Schlieren:
    """The field "schlieren" of the output files."""

    def __init__(self, fluid: Fluid):
        self._fluid = fluid

    def outputs(self, covered: np.ndarray | None) -> dict[str, np.ndarray]:
        """Collective. The field as it is now."""
        return {"schlieren": schlieren(self._fluid, covered)}


def schlieren(fluid: Fluid, covered: np.ndarray | None) -> np.ndarray:
    """Collective. |grad rho| over its largest value in the domain, (local blocks, bz, by, bx), NaN where covered.

    A picture is exp(-k schlieren) with k about 15 (Quirk and Karni, J. Fluid Mech. 318, 1996, Eq. A1). Central
    differences; one-sided next to a covered cell.
    """
    fluid.exchange_ghosts(fluid.stages[0])
    density = fluid.state[:, : fluid.model.phases].astype(np.float64).sum(axis=1)
    usable = np.ones(density.shape, dtype=bool) if covered is None else ~covered
    squared = np.zeros_like(density)
    for axis, h in enumerate(fluid.blocks.grid.spacing[: fluid.model.dimensions]):
        squared += (_slope(density, usable, 3 - axis) / h) ** 2
    gradient = padded(fluid, np.sqrt(squared), covered)
    largest = fluid.blocks.communicator.maximum(np.array([np.nanmax(gradient, initial=0.0)]))[0]
    return gradient / largest if largest > 0.0 else gradient


def _slope(values: np.ndarray, usable: np.ndarray, axis: int) -> np.ndarray:
    """Mean of the differences to the usable neighbours along `axis`; zero in the outermost layers."""
    values, usable = np.moveaxis(values, axis, -1), np.moveaxis(usable, axis, -1)
    slope = np.zeros_like(values)
    difference, both = values[..., 1:] - values[..., :-1], usable[..., 1:] & usable[..., :-1]
    difference, count = np.where(both, difference, 0.0), both[..., 1:].astype(int) + both[..., :-1]
    slope[..., 1:-1] = (difference[..., 1:] + difference[..., :-1]) / np.maximum(count, 1)
    return np.moveaxis(slope, -1, axis)
