"""What several test modules share."""

from collections.abc import Callable

import pytest

from launch import run_ranks


@pytest.fixture(scope="session")
def mpiexec() -> Callable[..., str]:
    """`mpiexec(ranks, *arguments)`: runs `python *arguments` on so many MPI ranks; returns what it printed."""

    def run(ranks: int, *arguments: object, exit_code: int = 0, seconds: float = 240.0) -> str:
        return run_ranks(ranks, [str(argument) for argument in arguments], seconds, exit_code)

    return run
