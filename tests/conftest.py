"""What several test modules share, and how their tests are dealt to processes."""

from collections.abc import Callable

import pytest

from launch import run_ranks


@pytest.fixture(scope="session")
def mpiexec() -> Callable[..., str]:
    """`mpiexec(ranks, *arguments)`: runs `python *arguments` on so many MPI ranks; returns what it printed."""

    def run(ranks: int, *arguments: object, exit_code: int = 0, seconds: float = 240.0) -> str:
        return run_ranks(ranks, [str(argument) for argument in arguments], seconds, exit_code)

    return run


def pytest_addoption(parser: pytest.Parser) -> None:
    """How much of what is random a test does."""
    parser.addoption("--kills", type=int, help="points at which the long tests of killed runs kill, e.g. 200")


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Two processes; one where times are measured or there is one GPU for all."""
    return 0 if config.option.markexpr in ("idle", "gpu") else 2


@pytest.hookimpl(tryfirst=True)  # before the groups are read
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests of a file stay together; those that start ranks all in one process: they need both cores for themselves."""
    for item in items:
        starters = ("run_ranks", "run_case")
        starts_ranks = "mpiexec" in item.fixturenames or any(hasattr(item.module, name) for name in starters)
        item.add_marker(pytest.mark.xdist_group("ranks" if starts_ranks else item.path.stem))
