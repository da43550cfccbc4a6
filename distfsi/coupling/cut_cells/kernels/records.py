"""What the loops of the cut cells are given: the fluid of cells, what the wall leaves open of them, lists of cells, and
the loads on the wall. Fields are flat where nothing else is said; cells are named as in mesh/kernels/grid.py."""

from typing import Any, NamedTuple

from distfsi.device.markers import helper, load, store
from distfsi.formulas.subset import static_range
from distfsi.formulas.symbols import DIMENSIONS, PHASES, VARIABLES
from distfsi.mesh.kernels.grid import BlockGrid, first_value

VOLUME_FIELDS = 3  # of `volume` for two phases; one phase has 1


class States(NamedTuple):
    """The fluid of cells, per volume of fluid.

    U       (blocks, VARIABLES, Z, Y, X) conserved states
    volume  (blocks, 1 or VOLUME_FIELDS, Z, Y, X): fluid volume fraction v of each cell
    """

    U: Any
    volume: Any


class Contents(NamedTuple):
    """The fluid of cells, per volume of the cell: conserved contents Q = v U. Cells outside the band are whole, so that
    both are the same.

    Q       (blocks, VARIABLES, Z, Y, X)
    volume  as of States; for two phases the contents of both phase energies behind it
    """

    Q: Any
    volume: Any


class Walls(NamedTuple):
    """What the wall leaves open of cells and faces, before the step (old) and after it (new).

    kind      (blocks, 1, Z, Y, X) FLUID, COVERED or ISOLATED (coupling/kernels/cells.py)
    fraction  (blocks, 1, Z, Y, X) volume fraction of each cell that is open
    aperture  (blocks, D, Z, Y, X) area fraction of each cell's low face along every axis that is open
    """

    kind: Any
    old_fraction: Any
    new_fraction: Any
    old_aperture: Any
    new_aperture: Any


class Band(NamedTuple):
    """The cells of the band, whose fluxes the wall changes; n of them.

    cells     (n,) ascending
    above     (n, D) place in the list of the next cell along each axis, -1 for none
    aperture  (n, 2 D) of a cell's faces in the step, low and high along each axis
    area      (n, D) [1/m] of the wall, per volume of the cell, along its normal into the solid
    """

    cells: Any
    above: Any
    aperture: Any
    area: Any


class Merging(NamedTuple):
    """Which cells share their content: small cells and their merge targets.

    target   (blocks, D, Z, Y, X) offset from a cell to its merge target, 0 if it has none
    offsets  (m, D) to all neighbours
    joined   (n, m) of the band's cells: 1 where the cell at an offset from a cell's target, or from the cell itself if
             it has none, has the same target
    """

    target: Any
    offsets: Any
    joined: Any


class WallLoads(NamedTuple):
    """How the wall moves in the cells of the band, and what the fluid gives to it in a step.

    velocity  (n, D) [m/s] of the wall
    inertia   (n,) [kg/m^d] sum of mass times kernel of the particles that make it
    impulse   (n, D) [N s/m3] to the wall, per volume of the cell
    work      (n,) [J/m3] done on the wall
    added     (n,) [kg/m3] added mass: by how much less impulse that were per velocity of the wall
    """

    velocity: Any
    inertia: Any
    impulse: Any
    work: Any
    added: Any


# ---- reading and writing them ---------------------------------------------------------------------------------------


@helper
def state_at(U, at, cells):
    """What a cell holds; `cells` of a block in memory."""
    first = first_value(at, VARIABLES, cells)
    return tuple(load(U, first + v * cells) for v in static_range(VARIABLES))


@helper
def put_state(U, at, cells, state):
    """Store what a cell holds."""
    first = first_value(at, VARIABLES, cells)
    for v in static_range(VARIABLES):
        store(U, first + v * cells, state[v])


@helper
def volume_at(at, cells):
    """Flat index of a cell's fluid volume fraction."""
    return at + at // cells * ((VOLUME_FIELDS - 1) * cells if PHASES == 2 else 0)


@helper
def put_content(Q, volume, at, cells, content):
    """Store a content in Q, and the phase energies that belong to it behind the `volume`."""
    put_state(Q, at, cells, content)
    if PHASES == 2:
        energies = volume_at(at, cells) + cells
        store(volume, energies, content[VARIABLES])
        store(volume, energies + cells, content[VARIABLES + 1])


@helper
def step_to_target(target, at, cells, grid: BlockGrid):
    """Step in memory from a cell to its merge target; 0 if it has none."""
    first, step = first_value(at, DIMENSIONS, cells), 0
    for d in static_range(DIMENSIONS):
        step += target[first + d * cells] * grid.steps[d]
    return step


@helper
def aperture_at(walls: Walls, at, axis, cells):
    """Mean aperture over the step of the low face of a cell along `axis`."""
    face = first_value(at, DIMENSIONS, cells) + axis * cells
    return 0.5 * (load(walls.old_aperture, face) + load(walls.new_aperture, face))
