"""distfsi from Python: `distfsi.load`, `distfsi.run`, `distfsi.open`, and the errors that they raise.

    import distfsi

    scene = distfsi.load("blast.toml", {"charges.0.mass": "5 kg", "domain.cells": [200, 200]})
    result = distfsi.run(scene, ranks=2)
    print(result.gauges["wall"]["overpressure"].max())

A script that is itself started on ranks (`mpiexec -n 4 python script.py`) runs a scene on these.
"""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

from distfsi.errors import DistfsiError, Diverged, InputError, OutputError, Stopped
from distfsi.results import Results
from distfsi.scene import loader
from distfsi.scene.description import Scene

ON_RANKS = "from distfsi.api import run_on_ranks; run_on_ranks()"
ENDINGS: dict[int, type[DistfsiError]] = {error.exit_code: error for error in (Diverged, OutputError, Stopped)}


def load(path: str | Path, changes: Mapping[str, Any] | None = None) -> Scene:
    """The scene that a TOML file describes; `changes` lay values over its keys, such as {"fluid.phases.air.gamma":
    1.39}; None takes a table away.

    Raises InputError, whose `faults` has one line per fault.
    """
    return loader.load(path, [f"{key}={_as_toml(value)}" for key, value in (changes or {}).items()])


def run(
    scene: Scene | str | Path,
    ranks: int | None = None,
    threads: int | None = None,
    restart: str | None = None,
    gpu: bool = False,
    progress: bool = True,
) -> Results:
    """Run a scene to its end, and open its results.

    ranks: MPI ranks to start; None: this process, or the ranks that it is one of. threads: of each rank; None: the
    node's cores shared by its ranks. restart: a file to go on from, or "auto", as of the command. gpu: compute on the
    node's GPUs. progress: say how far the run is.

    Raises InputError, Diverged, OutputError, and Stopped when the run has ended early.
    """
    scene = scene if isinstance(scene, Scene) else load(scene)
    words = {"threads": threads, "restart": restart, "on_gpu": gpu}
    if ranks is None:
        with _silent(not progress):
            _run_here(scene, words)
    else:
        _start(scene, ranks, words, progress)
    return Results(scene.output.directory)


def open(directory: str | Path) -> Results:  # noqa: A001
    """What a run has left in a directory. Raises InputError when no run has left anything there."""
    return Results(directory)


def run_on_ranks() -> None:
    """What each of the ranks does that `run` starts: it runs the scene of the file that it is said, as the command
    line would."""
    from distfsi.commands.ranks import reported_once, start_ranks
    from distfsi.execution import run

    communicator = start_ranks()
    with reported_once(communicator):
        scene, words = pickle.loads(Path(sys.argv[1]).read_bytes())
        run(scene, communicator, **words)


def _run_here(scene: Scene, words: Mapping[str, Any]) -> None:
    from distfsi.execution import run
    from distfsi.mesh.communicator import Communicator

    run(scene, Communicator(), **words)


def _start(scene: Scene, ranks: int, words: Mapping[str, Any], progress: bool) -> None:
    """Run a scene on ranks of its own. Raises what its end means."""
    launcher = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}")
    if launcher is None:
        raise InputError(["there is no mpiexec to start ranks with; ranks=None runs in this process"])
    with tempfile.NamedTemporaryFile(suffix=".scene") as file, tempfile.TemporaryFile("w+") as said:
        file.write(pickle.dumps((scene, words)))
        file.flush()
        command = [launcher, "-n", str(ranks), sys.executable, "-c", ON_RANKS, file.name]
        code = subprocess.run(
            command, stdout=None if progress else subprocess.DEVNULL, stderr=said, check=False
        ).returncode
        said.seek(0)
        message = said.read().strip()
    if code == InputError.exit_code:
        raise InputError(message.splitlines())
    if code:
        raise ENDINGS.get(code, DistfsiError)(message or f"the ranks ended with exit code {code}")


@contextmanager
def _silent(wanted: bool) -> Iterator[None]:
    if not wanted:
        yield
        return
    with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere):
        yield


def _as_toml(value: Any) -> str:
    """A value as `--set` takes it."""
    if value is None:
        return "none"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(key)} = {_as_toml(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, str):
        return json.dumps(value)
    if hasattr(value, "tolist"):  # of numpy
        return _as_toml(value.tolist())
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_as_toml, value)) + "]"
    return repr(value).lower() if isinstance(value, bool) else repr(value)
