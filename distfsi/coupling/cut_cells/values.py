"""What the steps of the cut cells hand on to each other. Arrays are the device's where nothing else is said."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from distfsi.coupling.cut_cells.kernels.records import Band, Contents, Merging, States, WallLoads, Walls
from distfsi.device.interface import Device
from distfsi.mesh.kernels.search import Bins
from distfsi.mesh.particles import GhostPlan
from distfsi.mesh.rows import Groups

# ---- particles ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Passage:
    """The particles on their way in a step: this rank's own first, then ghosts and images, all that its cells see.

    plan        who needs copies of which particles
    own_middle  (own, D), middle (count, D) [m]: of their ways
    bins        the search cells of the middles
    stretched   (n,) rows of the own ones that are more than one point; split: whether any of any rank is
    farthest    [m] that one has gone along an axis at most
    """

    plan: GhostPlan
    own_middle: Any
    middle: Any
    bins: Bins
    stretched: Any
    split: bool
    farthest: float


@dataclass(frozen=True)
class WallMotion:
    """The particles that make the wall, in the order of their passage, and how they move.

    own_mass  (own,), mass (count,) [kg]: 0 of those that are no wall
    velocity  (count, D) [m/s] with which they have moved
    image     (own, D): how much the images of a particle along each axis count
    """

    passage: Passage
    own_mass: Any
    mass: Any
    velocity: Any
    image: Any


# ---- cells ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CellLists:
    """Cells of this rank's blocks, block by block.

    band     (n,) those around the wall (coupling/cut_cells/kernels/band.py)
    covered  (m,) those without fluid
    uneven   (k,) whole cells that the wall has left, whose fluid does not quite fill them
    counts   (local blocks,) how many of the band there are, on the host
    blocks   sums over the band's cells of each block
    """

    band: Any
    covered: Any
    uneven: Any
    counts: np.ndarray
    blocks: Groups


@dataclass(frozen=True)
class OpenFaces:
    """Open faces of the band's cells.

    index  (m,) indices in `seen`, ascending
    seen   (D, n, 2) flat, of all faces: see find_faces() in coupling/cut_cells/kernels/fluxes.py
    flux   (n, 2 D FLUXES) room for what passes them in a stage
    """

    index: Any
    seen: Any
    flux: Any


# ---- steps ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CutGeometry:
    """Where the wall is in a step, how it moves, and what the fluid gives to it.

    motion    the particles that make the wall
    lone      (m,) rows of this rank's particles that are no wall
    walls     volume fractions and apertures, before and after the step
    lists     of cells: band, covered, uneven
    band      the band's cells, their faces and walls
    merging   of the band's cells
    faces     of the band that are open
    sides     (s,) rows of the cells at the domain's ends that are in the band or covered
    walled    (k,) indices in the band of the cells that the wall passes through
    loads     how the wall moves, and what the fluid gives to it: the stages add to that
    start_volume  (n,) fluid volume fractions of the band's cells before the first stage, which leaves them here
    at_end    whether bodies touch an end of the domain
    expands   whether whole cells fill what is missing in them: where lone particles have left a wall
    """

    motion: WallMotion
    lone: Any
    walls: Walls
    lists: CellLists
    band: Band
    merging: Merging
    faces: OpenFaces
    sides: Any
    walled: Any
    loads: WallLoads
    start_volume: Any
    expands: bool
    at_end: bool

    def again(self, device: Device) -> CutGeometry:
        """That of the next step where the wall stands: what the fluid gives to it begins anew."""
        loads = self.loads
        fresh = (device.zeros(array.shape) for array in (loads.impulse, loads.work, loads.added))
        return replace(self, loads=WallLoads(loads.velocity, loads.inertia, *fresh))


@dataclass(frozen=True)
class StageCells:
    """The fluid of all cells in a stage.

    before  (local blocks, variables, Z, Y, X) states before the step
    input   that the stage starts from
    output  that the stage leaves: contents in the band's cells
    """

    before: Any
    input: States
    output: Contents


@dataclass(frozen=True)
class Transfer:
    """What the fluid gives to this rank's particles in a step.

    impulse  (own, D) [N s]
    shared   (own, D) [m/s] per added mass of fluid that goes along with light ones
    dragged  (local blocks, D + 1) [N s, J] what the fluid has paid for lone ones, on the host
    """

    impulse: Any
    shared: Any
    dragged: np.ndarray
