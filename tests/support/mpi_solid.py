"""Solids for the tests, and the run that every rank makes; started by test_solid.py.

mpi_solid.py    runs the cases with 1 and 2 threads; rank 0 prints what must not depend on the number of ranks
"""

import hashlib
import math

import numpy as np

from distfsi.device.cpu import Cpu
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.eos.mie_grueneisen import MieGrueneisen
from distfsi.laws.solid.failure.johnson_cook import JohnsonCookFailure
from distfsi.laws.solid.scatter import Scatter
from distfsi.laws.solid.strength.johnson_cook import JohnsonCook
from distfsi.laws.solid.strength.perfectly_plastic import PerfectlyPlastic
from distfsi.laws.sources.gravity import Gravity
from distfsi.mesh.blocks import Blocks, Grid
from distfsi.mesh.communicator import Communicator, install_abort_on_exception
from distfsi.scene import description as d
from distfsi.solid.solid import Solid

COPPER_EOS = MieGrueneisen(c0=3940.0, s1=1.489, s2=0.0, s3=0.0, gamma0=2.0, a=0.47)
COPPER = JohnsonCook(45e9, 90e6, 292e6, 0.31, 0.025, 1.09, 1.0, 294.0, 1356.0, 385.0, 0.9)
SOFT_EOS = LinearEos(bulk_modulus=3.25e9)
SOFT = PerfectlyPlastic(shear_modulus=0.7e9, yield_stress=2e7)


def body(shape, spacing, density, velocity, eos=COPPER_EOS, strength=COPPER, fixed=None, failure=None, form=None):
    laws = (eos, strength, fixed, failure)
    return d.Body("body", shape, spacing, density, tuple(map(float, velocity)), *laws, form=form)


def solid(
    bodies,
    lower,
    upper,
    symmetric=(),
    device=None,
    block_cells=4,
    sources=(),
    viscosity=(1.0, 2.0),
    form="updated_lagrangian",
    communicator=None,
    smoothing=1.3,
    artificial_stress=0.0,
    friction=0.0,
    walled=(),
    wall_friction=0.0,
    periodic=(),
):
    """The solid of a scene in a box of 16 cells per axis; `symmetric` axes have a symmetry plane at their low end,
    `walled` ones two walls."""
    D, given = len(lower), {"form": form, "artificial_stress": artificial_stress, "friction": friction}
    given["wall_friction"] = wall_friction
    kinds = tuple(("symmetry" if axis in symmetric else "outflow", "outflow") for axis in range(D))
    kinds = tuple(("wall", "wall") if axis in walled else ends for axis, ends in enumerate(kinds))
    kinds = tuple(("periodic", "periodic") if axis in periodic else ends for axis, ends in enumerate(kinds))
    scene = d.Scene(
        title="test",
        domain=d.Domain(lower, upper, (16,) * D, kinds),
        time=d.Time(1.0, 0.5, None),
        sources=sources,
        fluid=None,
        solid=d.Solid(tuple(bodies), smoothing, *viscosity, **given),
        output=d.Output("", 0.0, 1),
        performance=d.Performance((block_cells,) * D, (block_cells,) * D),
    )
    communicator = communicator or Communicator()
    blocks = Blocks(Grid.of(lower, upper, (16,) * D, kinds), scene.performance.block_cells, communicator)
    return Solid(scene, blocks, communicator, device or Cpu(1))


def step(part, impulse=None):
    """One step of the largest stable size; `impulse(columns)` -> impulses [N s]. Returns the step and the work done."""
    part.prepare()
    dt = -part.communicator.maximum(np.array([-part.time_step()[0]]))[0]
    given = None if impulse is None else impulse(part.columns)
    part.advance(dt)
    if impulse is not None:
        part.apply_impulse(given)
    work = part.blocks.sum(part.work[:, None])[0]
    part.migrate()
    return dt, work


def digest(part):
    """Hash of all particles of all ranks in the order of their ids, and of the totals."""
    c = part.columns
    names = sorted(c)
    rows = np.column_stack([c[name].astype(float) for name in names])
    rows = part.communicator.concatenate(rows)
    ids = part.communicator.concatenate(c["id"])
    totals = [part.totals()[name] for name in ("mass", "kinetic", "internal", "momentum")]
    totals += [part.boundary_impulse(), part.gravity_work(), part.wall_impulse().ravel()]
    totals += [value.ravel() for value in (part.pieces() or {}).values()]
    text = rows[np.argsort(ids)].tobytes() + np.concatenate([np.atleast_1d(t) for t in totals]).tobytes()
    return len(ids), hashlib.sha256(text).hexdigest()


def colliding_discs(device, communicator=None):
    """Two materials that meet near a symmetry plane and cross many blocks, one of them clamped."""
    left = body(d.Ball((-0.42, 0.3), 0.25), 0.05, 8930.0, (900.0, -400.0))
    clamp = d.HalfSpace((0.4, 0.0), (-1.0, 0.0))
    right = body(d.Ball((0.2, 0.3), 0.25), 0.04, 2000.0, (0.0, 0.0), SOFT_EOS, SOFT, clamp)
    box = (-1.0, 0.0), (1.0, 1.0), (1,)
    return solid([left, right], *box, device, 2, sources=(Gravity((0.0, -1e3)),), communicator=communicator), 60


def colliding_balls(device):
    """Two balls in three dimensions, a quarter of each, whose particles resist clumping."""
    left = body(d.Ball((-0.22, 0.0, 0.0), 0.2), 0.05, 8930.0, (500.0, 0.0, 0.0))
    right = body(d.Ball((0.22, 0.0, 0.0), 0.2), 0.05, 8930.0, (-700.0, 0.0, 0.0))
    return solid([left, right], (-0.5, 0.0, 0.0), (0.5, 1.0, 1.0), (1, 2), device, 2, artificial_stress=0.3), 25


def bonded_discs(device):
    """Two discs of bonded particles, a half of each, that meet and bounce."""
    left = body(d.Ball((-0.42, 0.0), 0.3), 0.05, 8930.0, (900.0, 0.0))
    right = body(d.Ball((0.3, 0.0), 0.3), 0.04, 2000.0, (-300.0, 0.0), SOFT_EOS, SOFT)
    bodies = [left, right]
    return solid(bodies, (-1.0, 0.0), (1.0, 1.0), (1,), device, block_cells=2, form="total_lagrangian"), 80


def disc_that_leaves(device, communicator=None):
    """A bonded disc that rubs at a wall and goes through an open end, while another one, without bonds, begins to."""
    out = body(d.Ball((0.79, 0.79), 0.2), 0.05, 2000.0, (900.0, 100.0), SOFT_EOS, SOFT)
    loose = body(d.Ball((0.7, -0.6), 0.2), 0.05, 2000.0, (800.0, 0.0), SOFT_EOS, SOFT, form="updated_lagrangian")
    given = {"block_cells": 2, "form": "total_lagrangian", "communicator": communicator}
    given |= {"walled": (1,), "wall_friction": 0.3}
    return solid([out, loose], (-1.0, -1.0), (1.0, 1.0), (), device, **given), 100


def discs_that_go_round(device, communicator=None):
    """Discs of both forms that meet across periodic ends, and the corner of both."""
    left = body(d.Ball((0.6, 0.66), 0.3), 0.1, 2000.0, (900.0, 500.0), SOFT_EOS, SOFT)
    right = body(d.Ball((-0.6, -0.66), 0.3), 0.08, 8930.0, (-300.0, 0.0), form="updated_lagrangian")
    given = {"block_cells": 2, "form": "total_lagrangian", "communicator": communicator, "periodic": (0, 1)}
    return solid([left, right], (-1.0, -1.0), (1.0, 1.0), (), device, **given), 60


def discs_of_two_forms(device):
    """A bonded disc between two of other forms and materials, of which one tears it apart."""
    failure = JohnsonCookFailure(0.1, 0.0, 0.0, 0.0, 0.0, 1.0, None, 0.0, None)
    bonded = body(d.Ball((0.0, 0.0), 0.25), 0.05, 2000.0, (0.0, 0.0), SOFT_EOS, SOFT, failure=failure)
    fast = body(d.Ball((-0.5, 0.1), 0.2), 0.05, 8930.0, (900.0, 0.0), form="updated_lagrangian")
    slow = body(d.Ball((0.6, 0.0), 0.2), 0.04, 2000.0, (-100.0, 0.0), SOFT_EOS, SOFT, form="updated_lagrangian")
    box = (-1.0, 0.0), (1.0, 1.0), (1,)
    return solid([fast, bonded, slow], *box, device, 2, form="total_lagrangian"), 120


def bursting_ball(device, communicator=None):
    """A ball that flies apart while it turns: stretched and cut bonds, pieces and debris, at a symmetry plane."""
    failure = JohnsonCookFailure(0.15, 0.0, 0.0, 0.0, 0.0, 1.0, math.inf, 0.0, Scatter(10.0, 0.1, 1))
    ball = body(d.Ball((0.0,) * 3, 0.4), 0.1, 2000.0, (0.0,) * 3, SOFT_EOS, SOFT, failure=failure)
    box = (-1.0, -1.0, 0.0), (1.0,) * 3, (2,)
    part = solid([ball], *box, device, 2, form="total_lagrangian", communicator=communicator)
    x = part.columns["position"]
    part.columns["velocity"] = 500.0 * x + 500.0 * np.stack([-x[:, 1], x[:, 0], 0.0 * x[:, 0]], axis=1)
    return part, 90


def main():
    communicator = Communicator()
    install_abort_on_exception(communicator)
    for case in (
        colliding_discs,
        colliding_balls,
        bonded_discs,
        discs_of_two_forms,
        disc_that_leaves,
        discs_that_go_round,
        bursting_ball,
    ):
        digests = []
        for threads in (1, 2):
            part, steps = case(Cpu(threads))
            start = part.blocks.block_of(part.columns["position"])
            before = part.communicator.concatenate(np.stack([part.columns["id"], start], axis=1))
            for _ in range(steps):
                step(part)
            end = part.blocks.block_of(part.columns["position"])
            after = part.communicator.concatenate(np.stack([part.columns["id"], end], axis=1))
            assert math.isfinite(part.totals()["internal"])
            if case is bursting_ball:
                debris = part.communicator.concatenate(part.columns["bond_count"] == 0)
                assert 0 < debris.sum() < len(debris)
                assert debris.sum() < len(part.pieces()["piece"]) < len(debris)
            assert (len(after) < len(before)) == (case is disc_that_leaves)
            before = before[np.isin(before[:, 0], after[:, 0])]
            assert np.any(before[np.argsort(before[:, 0]), 1] != after[np.argsort(after[:, 0]), 1])
            digests.append(digest(part))
        assert digests[0] == digests[1]
        if communicator.rank == 0:
            print(case.__name__, *digests[0], flush=True)


if __name__ == "__main__":
    main()
