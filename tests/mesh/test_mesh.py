"""Blocks, ghost cells, particles on the move, and ranks that fail; the rank-parallel checks are in mpi_mesh.py."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mpi_mesh
from distfsi.device.cpu import Cpu
from distfsi.errors import InputError
from distfsi.mesh.blocks import Blocks, Grid
from distfsi.mesh.communicator import Communicator, check_launcher
from distfsi.mesh.curve import deal, morton_keys
from distfsi.mesh.kernels.particles import EXCHANGE
from distfsi.mesh.kernels.regions import copy_regions
from distfsi.mesh.particles import ParticleExchange
from distfsi.mesh.regions import source_cell
from launch import SUPPORT, run_ranks

SCRIPT = SUPPORT / "mpi_mesh.py"


@pytest.fixture(scope="module")
def communicator():
    return Communicator()


@pytest.fixture(scope="module")
def output_of_one_rank(tmp_path_factory):
    return run_ranks(1, [SCRIPT, "check", tmp_path_factory.mktemp("mesh")], timeout=120)


def test_one_rank(output_of_one_rank):
    assert output_of_one_rank.splitlines()[-1] == "all checks passed"


@pytest.mark.parametrize("ranks", [2, 4])
def test_several_ranks_do_the_same(ranks, output_of_one_rank, tmp_path):
    assert run_ranks(ranks, [SCRIPT, "check", tmp_path], timeout=120) == output_of_one_rank


def test_a_rank_that_fails_takes_the_others_down():
    output = run_ranks(2, [SCRIPT, "fail"], timeout=30, code=3)
    assert "rank 1: Traceback" in output
    assert "Diverged: negative density" in output


# ---- one rank, any shape ---------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32))
def test_ghost_cells_of_any_grid(seed, communicator):
    grid, block_cells = mpi_mesh.random_grid(np.random.default_rng(seed))
    mpi_mesh.check_ghost_cells(communicator, copy_regions, grid, block_cells)


@pytest.mark.parametrize(
    ("index", "cells", "kinds", "expected"),
    [
        (-2, 9, ("wall", "wall"), (1, 1, -1)),
        (10, 9, ("wall", "symmetry"), (7, 1, -1)),
        (10, 9, ("outflow", "outflow"), (8, 0, -1)),
        (-1, 9, ("periodic", "periodic"), (8, 0, -1)),
        (-1, 9, ("inflow", "wall"), (0, 0, 0)),
        (10, 9, ("wall", "inflow"), (8, 0, 1)),
        (-2, 1, ("wall", "wall"), (0, 0, -1)),  # there and back
        (-2, 1, ("wall", "outflow"), (0, 1, -1)),
        (-2, 1, ("wall", "inflow"), (0, 1, 1)),
        (2, 1, ("periodic", "periodic"), (0, 0, -1)),
    ],
)
def test_source_of_a_ghost_cell(index, cells, kinds, expected):
    assert source_cell(index, cells, kinds) == expected


def test_grid_fills_unused_axes():
    grid = Grid.of((1.0, 2.0), (3.0, 5.0), (4, 3), (("wall", "outflow"), ("periodic", "periodic")))
    assert grid.cells == (4, 3, 1)
    assert grid.lower == (1.0, 2.0, 0.0)
    assert grid.spacing == (0.5, 1.0, 1.0)
    assert grid.ghosts == (2, 2, 0)
    assert grid.boundaries[2] == ("none", "none")
    assert grid.upper == (3.0, 5.0, 1.0)


def test_blocks_cover_every_cell_once(communicator):
    grid = Grid.of((0.0,) * 3, (1.0,) * 3, (7, 5, 4), (("wall", "wall"),) * 3)
    blocks = Blocks(grid, (3, 2, 9), communicator)
    assert blocks.block_cells == (3, 2, 4)
    assert blocks.shape == (8, 6, 7)
    assert blocks.count == blocks.local_count == 9
    assert blocks.allocate(2, np.float32).shape == (9, 2, 8, 6, 7)
    covered = np.zeros((7, 5, 4), dtype=int)
    for b, (origin, extent) in enumerate(zip(blocks.origin, blocks.extent, strict=True)):
        covered[tuple(slice(o, o + e) for o, e in zip(origin, extent, strict=True))] += 1
        centers = np.stack(np.meshgrid(*blocks.cell_centers(b), indexing="ij"), axis=-1).reshape(-1, 3)
        assert set(blocks.block_of(centers).tolist()) == {b}
    assert (covered == 1).all()


def test_points_outside_belong_to_the_nearest_block(communicator):
    grid = Grid.of((0.0, 0.0), (8.0, 8.0), (8, 8), (("wall", "wall"),) * 2)
    blocks = Blocks(grid, (4, 4), communicator)
    points = np.array([[-9.0, 1.0], [99.0, 1.0], [1.0, 8.0], [8.0, np.inf], [np.nan, 1.0]])
    assert blocks.block_of(points).tolist() == [0, 1, 2, 3, 1]


# ---- the curve -------------------------------------------------------------------------------------------------------


def test_morton_order_visits_quarters_one_after_the_other():
    coordinates = np.stack(np.unravel_index(np.arange(16), (4, 4, 1)), axis=1)
    order = coordinates[np.argsort(morton_keys(coordinates))]
    assert (order // 2)[:, :2].tolist() == [[x, y] for y in (0, 1) for x in (0, 1) for _ in range(4)]
    assert morton_keys(np.array([[2**20, 0, 2**20 + 1]])).tolist() == [2**60 + 2**62 + 4]


@given(costs=st.lists(st.floats(0.01, 100.0), min_size=1, max_size=50), ranks=st.integers(1, 12))
def test_runs_cost_the_same_within_one_block(costs, ranks):
    owners = deal(np.array(costs), ranks)
    assert (np.diff(owners) >= 0).all()
    assert owners[0] >= 0
    assert owners[-1] < ranks
    shares = np.bincount(owners, weights=costs, minlength=ranks)
    assert np.abs(shares - sum(costs) / ranks).max() <= max(costs) * (1.0 + 1e-9)


def test_costs_decide_the_owners():
    assert deal(np.array([1.0, 1.0, 1.0, 1.0]), 2).tolist() == [0, 0, 1, 1]
    assert deal(np.array([3.0, 1.0, 1.0, 1.0]), 2).tolist() == [0, 1, 1, 1]


# ---- errors ----------------------------------------------------------------------------------------------------------


def test_several_runs_of_one_rank_are_refused(communicator, monkeypatch):
    for name in ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS"):
        monkeypatch.delenv(name, raising=False)
    check_launcher(communicator)
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "4")
    with pytest.raises(InputError, match=r"4 ranks.*mpiexec"):
        check_launcher(communicator)


def test_symmetry_planes_too_close_together(communicator):
    grid = Grid.of((0.0,), (1.0,), (8,), (("symmetry", "symmetry"),))
    device = Cpu(1)
    exchange = ParticleExchange(Blocks(grid, (4,), communicator), device, device.build(EXCHANGE, {"DIMENSIONS": 1}))
    with pytest.raises(InputError, match="that mirror are less than"):
        exchange.ghosts(np.zeros((1, 1)), np.zeros(1, dtype=np.int64), 0.5)
