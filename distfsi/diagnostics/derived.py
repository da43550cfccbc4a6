"""Fields that are derived from the flow for the output files: what they have in common."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from distfsi.fluid.fluid import Fluid


class DerivedFields(Protocol):
    """Fields of the cells beside those of the fluid itself, each kind in a file of its own: peaks.py, schlieren.py."""

    def outputs(self, covered: np.ndarray | None) -> dict[str, np.ndarray]:
        """Collective. By name (local blocks, bz, by, bx), padded to whole blocks, NaN in `covered` cells
        (local blocks, Z, Y, X)."""


def padded(fluid: Fluid, field: np.ndarray, covered: np.ndarray | None) -> np.ndarray:
    """The active cells of `field` (local blocks, Z, Y, X), padded with zeros to whole blocks; NaN where covered."""
    blocks = fluid.blocks
    result = np.zeros((blocks.local_count, *blocks.block_cells[::-1]))
    for block in range(blocks.local_count):
        x, y, z = blocks.extent[block]
        part = result[block, :z, :y, :x]
        part[:] = fluid.active(field, block)
        if covered is not None:
            part[fluid.active(covered, block)] = np.nan
    return result
