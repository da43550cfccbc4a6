"""What commands that run on MPI ranks share."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from distfsi.errors import DistfsiError, InputError
from distfsi.narrowing import present

if TYPE_CHECKING:
    from distfsi.mesh.communicator import Communicator
    from distfsi.scene.description import Scene


def start_ranks() -> Communicator:
    """Start MPI. Raises InputError where the launcher's ranks do not know each other."""
    from distfsi.mesh.communicator import Communicator, check_launcher, install_abort_on_exception

    communicator = Communicator()
    check_launcher(communicator)
    install_abort_on_exception(communicator)
    return communicator


def load_once(path: str, overrides: Sequence[str], communicator: Communicator) -> Scene:
    """Collective. The scene, read by rank 0 alone; its faults are raised on all ranks as InputError."""
    from distfsi.scene import load

    scene: Scene | None = None
    faults: list[str] = []
    if communicator.rank == 0:
        try:
            scene = load(path, overrides)
        except InputError as error:
            faults = error.faults
    scene, faults = communicator.broadcast((scene, faults))
    if faults:
        raise InputError(faults)
    return present(scene)


@contextmanager
def reported_once(communicator: Communicator) -> Iterator[None]:
    """An error that all ranks raise ends all of them with its exit code; rank 0 alone prints it."""
    try:
        yield
    except DistfsiError as error:
        if communicator.rank == 0:
            print(error, file=sys.stderr, flush=True)
        sys.exit(error.exit_code)
