"""A run that is killed before its n-th file operation.

`python killing.py SCENE RESTART [SETTING ...]` reads numbers from its input, forks for each one a process that makes
the run and is killed there, and answers with the exit code.

The operations are those that Python does in the output directory: files opened, renamed, removed, directories made and
removed, a folder looked through. 0: the run is not killed, and the answer has the number of its operations, too.
"""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

OPERATIONS = {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.listdir", "os.scandir", "os.truncate"}


def fork_run(before: int, scene: str, restart: str | None, settings: Sequence[str]) -> tuple[int, int]:
    """Make a run in a process of its own that is killed before operation `before`; exit code, operations."""
    reading, writing = os.pipe()
    child = os.fork()
    if child:
        os.close(writing)
        _, status = os.waitpid(child, 0)
        counted = os.read(reading, 100)
        os.close(reading)
        return os.waitstatus_to_exitcode(status), int(counted or 0)
    code = 1
    try:
        from distfsi.errors import DistfsiError
        from distfsi.execution import run
        from distfsi.mesh.communicator import Communicator
        from distfsi.scene import load

        description = load(scene, settings)
        counter = Counter(before, Path(description.output.directory).absolute())
        communicator = Communicator()
        sys.addaudithook(counter)
        try:
            run(description, communicator, 1, restart)
            code = 0
        except DistfsiError as error:
            print(error, file=sys.stderr)
            code = error.exit_code
        os.write(writing, str(counter.count).encode())
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)


class Counter:
    """Counts the file operations in a directory, and kills the process before one of them."""

    def __init__(self, before: int, directory: Path):
        self.count, self._before, self._directory = 0, before, str(directory)

    def __call__(self, event: str, arguments: tuple) -> None:
        if event not in OPERATIONS or not arguments or not isinstance(arguments[0], (str, bytes, os.PathLike)):
            return
        if os.path.abspath(os.fsdecode(arguments[0])).startswith(self._directory):
            self.count += 1
            if self.count == self._before:
                os.kill(os.getpid(), signal.SIGKILL)


def warm_up() -> None:
    """Do once what each run would do for itself: import all, find fonts, make numba ready to load machine code."""
    import matplotlib.pyplot as plt
    import scipy.integrate  # noqa: F401
    from numba.core.registry import cpu_target

    import distfsi.execution
    import distfsi.fluid.initial
    import distfsi.output.picture
    import distfsi.scene  # noqa: F401

    cpu_target.target_context.refresh()
    figure, axes = plt.subplots()
    axes.set_title("$10^1$")
    figure.savefig(os.devnull, format="png")
    plt.close(figure)


def main(scene: str, restart: str, settings: Sequence[str]) -> None:
    """Answer the numbers of the input, line by line."""
    import mpi4py

    mpi4py.rc.initialize = False  # each process that is forked has an MPI of its own

    warm_up()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        code, count = fork_run(int(line), scene, None if restart == "none" else restart, settings)
        print(code, count, file=answers, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
