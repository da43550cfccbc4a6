"""Run under mpiexec by test_output.py: every rank writes its part of known fields into the directory given."""

import sys
from pathlib import Path

import numpy as np

from distfsi.mesh.blocks import Blocks, Grid
from distfsi.mesh.communicator import Communicator, check_launcher
from distfsi.output.fields import FieldWriter
from distfsi.output.history import History
from distfsi.output.storage import storage

# Cells, block cells, lower corner and upper corner of each scene; most last blocks are partly filled.
SCENES = {
    "line": ((37,), (16,), (-0.5,), (1.35,)),
    "one_block": ((21, 10), (32, 16), (0.0, 0.0), (2.1, 1.0)),
    "plane": ((50, 37), (16, 8), (-1.0, 2.0), (4.0, 5.7)),
    "space": ((13, 11, 9), (8, 8, 4), (0.0, -1.0, 3.0), (1.3, 0.1, 3.9)),
}
TIMES = (0.0, 1.25e-6)


def pressure(x, y, z, time):
    """A field that differs in every cell and at every time."""
    return 1e5 + 3.0 * x + 50.0 * y * y + 700.0 * z * x + 1e6 * time


def velocity(x, y, z, time):
    """A vector field, (..., 3)."""
    return np.stack(np.broadcast_arrays(x - y, 2.0 * y + time * 1e6, x * z), axis=-1)


def own_cells(blocks: Blocks, time: float) -> dict[str, np.ndarray]:
    """The fields on the own blocks; NaN in the padding of partly filled blocks."""
    shape = (blocks.local_count, *blocks.block_cells[::-1])
    fields = {"pressure": np.full(shape, np.nan), "velocity": np.full((*shape, 3), np.nan)}
    for b in range(blocks.local_count):
        x, y, z = blocks.cell_centers(b)
        at = np.meshgrid(z, y, x, indexing="ij")[::-1]
        inside = (b, slice(len(z)), slice(len(y)), slice(len(x)))
        fields["pressure"][inside] = pressure(*at, time)
        fields["velocity"][inside] = velocity(*at, time)
    return fields


def own_particles(blocks: Blocks, ids: np.ndarray, time: float) -> dict[str, np.ndarray]:
    """The particles with these ids that lie in own blocks, by (block, id); 3-vectors whatever the dimension."""
    dimensions = blocks.grid.dimensions
    position = all_positions(blocks.grid)[ids]
    block = blocks.block_of(position[:, :dimensions])
    order = np.lexsort((ids, block))
    own = order[(block[order] >= blocks.first) & (block[order] < blocks.first + blocks.local_count)]
    return {
        "position": position[own],
        "id": ids[own],
        "pressure": pressure(*position[own].T, time),
        "velocity": velocity(*position[own].T, time),
    }


def all_positions(grid: Grid) -> np.ndarray:
    """Positions (200, 3) of all particles, by id; zero on unused axes."""
    share = np.random.default_rng(1).random((200, 3))
    upper = np.array(grid.lower) + np.array(grid.spacing) * grid.cells
    position = np.array(grid.lower) + share * (upper - grid.lower)
    position[:, grid.dimensions :] = 0.0
    return position


def ids_of_one_block(blocks: Blocks) -> np.ndarray:
    """Ids of the particles in the block of particle 0."""
    block = blocks.block_of(all_positions(blocks.grid)[:, : blocks.grid.dimensions])
    return np.flatnonzero(block == block[0])


def main(directory: Path, hdf5: str = "mpi-io") -> None:
    """Write all scenes, then the cases with few or no particles."""
    communicator = Communicator()
    check_launcher(communicator)
    files = storage(hdf5, communicator)
    for name, (cells, block_cells, lower, upper) in SCENES.items():
        grid = Grid.of(lower, upper, cells, (("wall", "wall"),) * len(cells))
        blocks = Blocks(grid, block_cells, communicator)
        writer = FieldWriter(directory / name, blocks, communicator, files)
        for number, time in enumerate(TIMES):
            writer.write(10 * number, time, own_cells(blocks, time), own_particles(blocks, np.arange(200), time))
    FieldWriter(directory / "no_particles", blocks, communicator, files).write(
        0, 0.5, None, own_particles(blocks, np.arange(0), 0.5)
    )
    FieldWriter(directory / "few_particles", blocks, communicator, files).write(
        0, 0.5, None, own_particles(blocks, ids_of_one_block(blocks), 0.5)
    )
    history = History(directory / "history.csv", ["time [s]", "limited by"], communicator)
    history.append({"time [s]": 0.1 + communicator.rank, "limited by": f"rank {communicator.rank}"})


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
