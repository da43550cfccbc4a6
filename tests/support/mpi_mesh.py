"""Checks of the mesh that every rank runs; started by test_mesh.py.

mpi_mesh.py check FOLDER    all checks; rank 0 prints what must not depend on the number of ranks
mpi_mesh.py fail            one rank raises Diverged while the others wait for it
"""

import sys
from pathlib import Path

import numpy as np

from distfsi.device.cpu import Cpu
from distfsi.device.interface import Columns
from distfsi.errors import Diverged
from distfsi.mesh.blocks import Blocks, Grid
from distfsi.mesh.chosen import ChosenGhosts
from distfsi.mesh.communicator import Communicator, install_abort_on_exception
from distfsi.mesh.exchange import GhostExchange
from distfsi.mesh.kernels.particles import EXCHANGE
from distfsi.mesh.kernels.regions import copy_cells, copy_regions, pack_cells, unpack_cells
from distfsi.mesh.particles import ParticleExchange

PADDING = {"wall": "symmetric", "symmetry": "symmetric", "periodic": "wrap", "outflow": "edge", "inflow": "edge"}
KINDS = ("wall", "symmetry", "outflow", "inflow")


# ---- ghost cells -----------------------------------------------------------------------------------------------------


def cell_values(x, y, z, variables):
    """Distinct values (variables, Z, Y, X), exact in float32, at global cell indices."""
    cell = 1 + x[None, None, :] + 32 * y[None, :, None] + 1024 * z[:, None, None]
    return np.stack([cell * (v + 1) for v in range(variables)]).astype(float)


def padded_axis(cells, ghosts, kinds):
    """Per cell of an axis with its ghosts: index of the source, sign of a mirrored component, inflow side or -1."""
    index = np.arange(cells)
    low, high = (np.pad(index, ghosts, mode=PADDING.get(kind, "edge")) for kind in kinds)
    source = np.concatenate([low[:ghosts], index, high[cells + ghosts :]])
    sign, inflow = np.ones(cells + 2 * ghosts), np.full(cells + 2 * ghosts, -1)
    for side, part in enumerate((slice(0, ghosts), slice(cells + ghosts, None))):
        sign[part] = -1 if kinds[side] in ("wall", "symmetry") else 1
        inflow[part] = side if kinds[side] == "inflow" else -1
    return source, sign, inflow


def padded_grid(grid, mirror, constants):
    """The whole grid with its ghosts (variables, Z, Y, X), straight from the definition."""
    axes = [padded_axis(n, g, kinds) for n, g, kinds in zip(grid.cells, grid.ghosts, grid.boundaries, strict=True)]
    values = cell_values(*(source for source, _, _ in axes), len(mirror))
    along = [(None, None, slice(None)), (None, slice(None), None), (slice(None), None, None)]
    for axis in (2, 1, 0):
        inflow = np.broadcast_to(axes[axis][2][along[axis]], values.shape[1:])
        for side in (0, 1):
            values[:, inflow == side] = constants[axis, side][:, None]
    for variable, axis in enumerate(mirror):
        if axis >= 0:
            values[variable] *= axes[axis][1][along[axis]]
    return values


def check_ghost_cells(communicator, copy, grid, block_cells, dtype=np.float64):
    blocks = Blocks(grid, block_cells, communicator)
    mirror = np.array([-1, *range(grid.dimensions), -1])
    constants = -1.0 - np.arange(6 * len(mirror)).reshape(3, 2, -1)
    x, y, z = grid.ghosts
    field = blocks.allocate(len(mirror), dtype)
    field[:] = np.nan
    expected = field.copy()
    everything = padded_grid(grid, mirror, constants)
    for b, ((i, j, k), (nx, ny, nz)) in enumerate(zip(blocks.origin, blocks.extent, strict=True)):
        box = everything[:, k : k + nz + 2 * z, j : j + ny + 2 * y, i : i + nx + 2 * x]
        expected[b, :, : nz + 2 * z, : ny + 2 * y, : nx + 2 * x] = box
        active = (b, slice(None), slice(z, z + nz), slice(y, y + ny), slice(x, x + nx))
        field[active] = expected[active]
    exchange = GhostExchange(blocks, Cpu(1), copy)
    fresh = field.copy()
    for _ in range(2):  # the second time with used buffers
        field[:] = fresh
        exchange.start(field, mirror, constants)
        np.testing.assert_array_equal(field[exchange.ready], expected[exchange.ready])
        exchange.finish()
        np.testing.assert_array_equal(field, expected, err_msg=f"{grid} {block_cells}")
    assert np.array_equal(np.union1d(exchange.ready, exchange.waiting), np.arange(blocks.local_count))
    check_chosen_ghosts(exchange, fresh, expected, mirror)


def check_chosen_ghosts(exchange, fresh, expected, mirror):
    """Only ghosts of marked cells are filled, of two fields together; those of an inflow, where no mark is, are not."""
    kernels = Cpu.build((copy_cells, pack_cells, unpack_cells, *EXCHANGE), {"DIMENSIONS": 1})
    chosen = ChosenGhosts(exchange, Cpu(1), kernels)
    parity = np.where(mirror < 0, 0, 1 << np.maximum(mirror, 0))
    mark = np.where(np.isfinite(fresh[:, :1]), fresh[:, :1] % 3 == 1, 0).astype(np.int8)
    exchange.start(mark, np.array([-1]), np.zeros((3, 2, 1)))
    exchange.finish()
    for chosen_mark in (mark, np.zeros_like(mark), mark):
        chosen.choose(chosen_mark.reshape(-1))
        field, first = fresh.copy(), fresh[:, :1].copy()
        chosen.exchange((field, parity), (first, parity[:1]))
        wanted = np.where((chosen_mark > 0) & np.isnan(fresh), expected, fresh)
        np.testing.assert_array_equal(field, wanted)
        np.testing.assert_array_equal(first, wanted[:, :1])


def random_grid(rng):
    """A small grid with any boundaries, and a block size that often leaves edge blocks of one cell."""
    dimensions, layers = int(rng.integers(1, 4)), int(rng.integers(2, 4))
    cells = tuple(rng.integers(layers, (40, 14, 8)[dimensions - 1], dimensions).tolist())
    boundaries = tuple(
        ("periodic", "periodic") if rng.random() < 0.25 else tuple(rng.choice(KINDS, 2).tolist()) for _ in cells
    )
    block_cells = tuple(int(rng.choice([1, 2, 3, max(n - 1, 1), n])) for n in cells)
    return Grid.of((0.0,) * dimensions, (1.0,) * dimensions, cells, boundaries, layers), block_cells


def check_ghosts(communicator):
    copy = Cpu.build([copy_regions], {}).copy_regions
    rng = np.random.default_rng(1)
    for _ in range(60):
        check_ghost_cells(communicator, copy, *random_grid(rng))
    walls = (("wall", "wall"), ("symmetry", "wall"), ("periodic", "periodic"))
    check_ghost_cells(communicator, copy, Grid.of((0,) * 3, (1,) * 3, (9, 7, 5), walls), (4, 3, 4), np.float32)


# ---- sums, owners, files ---------------------------------------------------------------------------------------------


def check_sum(communicator):
    grid = Grid.of((0.0, 0.0), (1.0, 1.0), (37, 23), (("wall", "wall"),) * 2)
    blocks = Blocks(grid, (4, 4), communicator)
    values = np.random.default_rng(2).lognormal(0.0, 1.0, (blocks.count, 1))
    mine = slice(blocks.first, blocks.first + blocks.local_count)
    total = 0.0
    for value in values[:, 0]:
        total += value
    assert total != values.sum()  # which adds in pairs
    assert blocks.sum(values[mine]).tolist() == [total]
    assert blocks.local_count > 0 or communicator.size > blocks.count
    print_once(communicator, "sum", total.hex(), blocks.sum(values[mine])[0].hex())


def check_reductions(communicator):
    rank, size = communicator.rank, communicator.size
    last = np.nan if rank == size - 1 else 5.0
    assert communicator.maximum(np.array([rank, -rank, last])).tolist()[:2] == [size - 1, 0]
    assert not communicator.maximum(np.array([last])) < np.inf
    assert communicator.broadcast({"rank": rank}) == {"rank": 0}
    assert communicator.allgather(rank) == list(range(size))
    rows = communicator.concatenate(np.full((rank, 2), rank, dtype=np.int32))
    assert rows.dtype == np.int32
    assert rows[:, 1].tolist() == [r for r in range(size) for _ in range(r)]
    assert 0 <= communicator.local_rank < communicator.local_size <= size


def check_file(communicator, folder):
    path = Path(folder) / f"ranks{communicator.size}.bin"
    if communicator.rank == 0:
        path.write_bytes(bytes(8 * 12))
    communicator.barrier()
    writers = max(communicator.size - 1, 1)  # the last of several ranks has nothing to write
    rows = [r for r in range(12) if r % writers == communicator.rank]
    communicator.write_at(path, [8 * r for r in rows], [np.array([[r, -r]], dtype=np.int32) for r in rows])
    written = np.fromfile(path, dtype=np.int32).reshape(-1, 2)
    assert written.tolist() == [[r, -r] for r in range(12)]


# ---- particles -------------------------------------------------------------------------------------------------------


def particle_columns(rng, number, dimensions):
    position = rng.uniform(-0.2, 1.2, (number, dimensions))
    return {
        "id": rng.permutation(10 * number)[:number],
        "position": position,
        "mass": rng.random(number),
        "velocity": rng.normal(size=(number, dimensions)),
        "body": rng.integers(0, 9, number, dtype=np.int32),
        "bonds": rng.integers(0, 1 << 60, (number, 3)),
    }


def expected_blocks(blocks, position):
    """Curve index of each particle's block, from the boxes of all blocks."""
    low, high = all_boxes(blocks)
    inside = (position[:, None] >= low) & (position[:, None] < high)
    return np.argmax(inside.all(axis=2), axis=1)


def all_boxes(blocks):
    """Low and high corners (count, dimensions) of all blocks; those at the ends of the grid are infinite."""
    grid, d = blocks.grid, blocks.grid.dimensions
    cells, lower, spacing = (np.array(a[:d]) for a in (grid.cells, grid.lower, grid.spacing))
    first = blocks.coordinates[:, :d] * blocks.block_cells[:d]
    end = first + blocks.block_cells[:d]
    return np.where(first == 0, -np.inf, lower + first * spacing), np.where(end >= cells, np.inf, lower + end * spacing)


def check_own(blocks, everything, mine, home):
    """`mine` are the particles of this rank's blocks, with all their values, and `home` their blocks."""
    block = expected_blocks(blocks, everything["position"])
    order = np.lexsort((everything["id"], block))
    order = order[blocks.owners[block[order]] == blocks.communicator.rank]
    np.testing.assert_array_equal(np.sort(home.host()), block[order])
    rows = np.lexsort((mine["id"], home.host()))
    for name, column in everything.items():
        assert mine[name].dtype == column.dtype
        np.testing.assert_array_equal(mine[name][rows], column[order], err_msg=name)
    return rows


def check_particles(communicator, grid, block_cells, number, reach):
    rng = np.random.default_rng(3)
    blocks = Blocks(grid, block_cells, communicator)
    device = Cpu(1)
    exchange = ParticleExchange(blocks, device, device.build(EXCHANGE, {"DIMENSIONS": grid.dimensions}))
    everything = particle_columns(rng, number, grid.dimensions)
    holders = max(communicator.size - 1, 1)  # the last of several ranks starts with none
    mine = {name: column[np.arange(number) % holders == communicator.rank] for name, column in everything.items()}
    mine = Columns(device, mine)
    block = exchange.migrate(mine)
    assert np.all(np.diff(check_own(blocks, everything, mine, block)) == 1)  # sorted
    move = rng.normal(0.0, 0.1, everything["position"].shape)
    move_of = dict(zip(everything["id"].tolist(), move, strict=True))
    everything["position"] += move
    if len(mine["id"]):
        mine["position"] += np.array([move_of[i] for i in mine["id"].tolist()])
    before = mine["id"]
    block = exchange.migrate(mine, block)
    check_own(blocks, everything, mine, block)
    assert communicator.size > 1 or mine["id"] is before  # nobody came or left, so all stay in their rows
    assert exchange.migrate(mine, block) is block  # nothing moved
    check_own(blocks, everything, mine, block)
    nothing = np.empty(0, dtype=np.int64)
    check_ghost_particles(
        blocks, everything, mine, exchange.ghosts(mine["position"], mine["id"], reach), reach, nothing
    )
    rng = np.random.default_rng(communicator.rank)
    mirrors = sum(1 << axis for axis, kinds in enumerate(blocks.grid.boundaries) if "symmetry" in kinds)
    bonded = 8 * rng.choice(everything["id"], 40) + (rng.integers(8, size=40) & mirrors)  # near, far and own ones
    plan = exchange.ghosts(mine["position"], mine["id"], reach, bonded)
    check_ghost_particles(blocks, everything, mine, plan, reach, bonded)


def expected_ghosts(blocks, everything, reach, bonded):
    """Rows of the others' particles within reach of this rank's blocks or bonded to its own, in (block, id) order."""
    low, high = all_boxes(blocks)
    own = blocks.owners == blocks.communicator.rank
    position = everything["position"][:, None]
    close = ((position >= low[own] - reach) & (position <= high[own] + reach)).all(axis=2).any(axis=1)
    close |= np.isin(everything["id"], bonded // 8)
    block = expected_blocks(blocks, everything["position"])
    order = np.lexsort((everything["id"], block))
    return order[close[order] & ~own[block[order]]]


def nearest_planes(grid, position):
    """Place (n, dimensions) of the symmetry plane nearest to each position along each axis; infinite where none is."""
    places = np.full(position.shape, np.inf)
    for axis, kinds in enumerate(grid.boundaries[: grid.dimensions]):
        for kind, place in zip(kinds, (grid.lower[axis], grid.upper[axis]), strict=True):
            nearer = np.abs(position[:, axis] - place) < np.abs(position[:, axis] - places[:, axis])
            places[nearer & (kind == "symmetry"), axis] = place
    return places


def check_ghost_particles(blocks, everything, mine, plan, reach, bonded):
    """The plan has the right particles, ghosts and images, and each of them gets the right values."""
    ghosts = expected_ghosts(blocks, everything, reach, bonded)
    ids = np.concatenate([mine["id"], everything["id"][ghosts]])
    assert plan.own == len(mine["id"])
    np.testing.assert_array_equal(plan.key.host[: len(ids)], 8 * ids)

    row_of = {key: row for row, key in enumerate(everything["id"].tolist())}
    position = everything["position"]
    planes = nearest_planes(blocks.grid, position)
    near = (np.abs(position - planes) <= reach) @ (1 << np.arange(position.shape[1]))
    np.bitwise_or.at(near, [row_of[i] for i in (bonded // 8).tolist()], bonded % 8)
    images = [8 * i + mask for i in ids.tolist() for mask in range(1, 8) if mask & near[row_of[i]] == mask]
    assert plan.count == len(plan.key.host)
    assert sorted(plan.key.host[len(ids) :].tolist()) == sorted(images)

    rows = np.array([row_of[i] for i in (plan.key.host // 8).tolist()], dtype=int)
    flipped = plan.key.host[:, None] % 8 >> np.arange(position.shape[1]) & 1 == 1
    check_values(everything, mine, plan, rows, flipped, planes[rows])


def check_values(everything, mine, plan, rows, flipped, planes):
    """Arrays of every parity arrive as the `rows` of everything, mirrored along the `flipped` axes."""
    axes = range(flipped.shape[1])
    sign = np.where(flipped, -1, 1)
    pairs = [(a, b) for a in axes for b in axes if a <= b]
    all_stress, stress = (np.stack([c["mass"] + k for k in range(len(pairs))], axis=1) for c in (everything, mine))
    results = plan.exchange(
        [
            (mine["position"], "position"),
            (mine["velocity"], tuple((a,) for a in axes)),
            (stress, tuple(pairs)),
            (mine["body"].astype(float), ((),)),
            (mine["mass"], ((0,),)),
        ]
    )
    position = everything["position"][rows]
    expected = [
        np.where(flipped, 2.0 * planes - position, position),
        everything["velocity"][rows] * sign,
        all_stress[rows] * np.stack([sign[:, a] * sign[:, b] for a, b in pairs], axis=1),
        everything["body"][rows].astype(float),
        everything["mass"][rows] * sign[:, 0],
    ]
    for result, wanted in zip(results, expected, strict=True):
        assert result.dtype == wanted.dtype
        np.testing.assert_array_equal(result, wanted)


def check_all_particles(communicator):
    wall, outflow = ("wall", "wall"), ("outflow", "outflow")
    corner = (("symmetry", "wall"), ("outflow", "symmetry"))
    check_particles(communicator, Grid.of((0.0,), (1.0,), (40,), (wall,)), (3,), 500, 0.11)
    check_particles(communicator, Grid.of((0.0, 0.0), (1.0, 1.0), (32, 20), (outflow, wall)), (5, 6), 3000, 0.03)
    check_particles(communicator, Grid.of((0.0, 0.0), (1.0, 1.0), (16, 16), corner), (3, 4), 2000, 0.3)
    box = (("symmetry", "symmetry"), ("symmetry", "wall"), wall)
    check_particles(communicator, Grid.of((0.0,) * 3, (1.0,) * 3, (8, 9, 7), box), (4, 4, 3), 2000, 0.1)
    check_particles(communicator, Grid.of((0.0, 0.0), (1.0, 1.0), (8, 8), corner), (8, 8), 1, 0.1)


# ---- start -----------------------------------------------------------------------------------------------------------


def print_once(communicator, *words):
    if communicator.rank == 0:
        print(*words, flush=True)


def main(action, *arguments):
    communicator = Communicator()
    install_abort_on_exception(communicator)
    if action == "fail":
        if communicator.rank == communicator.size - 1:
            raise Diverged("negative density")
        communicator.barrier()
    check_reductions(communicator)
    check_sum(communicator)
    check_file(communicator, *arguments)
    check_ghosts(communicator)
    check_all_particles(communicator)
    print_once(communicator, "all checks passed")


if __name__ == "__main__":
    main(*sys.argv[1:])
