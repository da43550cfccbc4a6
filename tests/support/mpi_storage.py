"""Run under mpiexec by test_storage.py: the last rank alone may write no large files; all must see the same error."""

import resource
import sys
from pathlib import Path

import numpy as np

from distfsi.errors import OutputError
from distfsi.mesh.communicator import Communicator
from distfsi.output.storage import create_dataset, storage, write_complete

ROWS = 4000  # of each rank, 8 bytes each


def write(directory: Path, hdf5: str, rows: int) -> None:
    """Write `rows` numbers of each rank as one dataset."""
    communicator = Communicator()
    size, start = rows * communicator.size, rows * communicator.rank
    values = np.arange(start, start + rows)
    write_complete(
        storage(hdf5, communicator),
        communicator,
        directory / f"{hdf5}.h5",
        lambda file: {"values": create_dataset(file, "values", (size,), values.dtype)},
        [("values", (start,), values)],
    )


def main(directory: Path, rank_in_need: int) -> None:
    """Write small files, then large ones, with both kinds of storage that need no special h5py."""
    communicator = Communicator()
    if communicator.rank == rank_in_need:
        resource.setrlimit(resource.RLIMIT_FSIZE, (ROWS, ROWS))
    for hdf5 in ("mpi-io", "gather"):
        for rows in (ROWS // 100, ROWS):
            try:
                write(directory, hdf5, rows)
                outcome = "written"
            except OutputError as error:
                outcome = str(error)
            outcomes = communicator.allgather(outcome)
            assert len(set(outcomes)) == 1, outcomes
            if communicator.rank == 0:
                print(f"{hdf5} {rows}: {outcome}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
