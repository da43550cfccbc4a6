"""Flows that would leave cells without mass or sound speed: limited at their faces, or their steps redone."""

from dataclasses import replace

import numpy as np
import pytest

from distfsi.diagnostics.budget import Budget
from distfsi.laws.fluid.ideal_gas import IdealGas
from distfsi.mesh.communicator import Communicator
from distfsi.scene.description import Box, FluidState, Performance, Region
from distfsi.simulation import Simulation
from distfsi.step import Reason, TimeStep
from fluids import AIR, WATER, model_of
from tubes import OPEN, advance, fields, scene_of, start

MONATOMIC = IdealGas(5.0 / 3.0)
WALLS = ("wall", "wall")
LIMITED_FLUIDS = (("air",), ("water",), ("water", "air"), ("tnt", "water"))


def torn_apart(speed, cfl, boundary=OPEN):
    """Gas that flies apart from x = 0.5 at so many m/s (Toro's 123 problem has 2); its sound speed is 0.75 m/s."""
    regions = (
        Region(FluidState(0, 1.0, 0.4, (speed,)), None),
        Region(FluidState(0, 1.0, 0.4, (-speed,)), Box((0.0,), (0.5,))),
    )
    return start(
        scene_of((AIR,), regions, (0.0,), (1.0,), (200,), 0.3 / speed, (boundary,), cfl, reconstruction="van_leer")
    )


def falling_in(dimensions, cells, cfl, end=0.6, **method):
    """Noh's problem at Mach 775: cold gas falls to the corner with speed 1 from everywhere."""
    D = dimensions
    regions = (Region(FluidState(0, 1.0, 1e-6, (0.0,) * D), None),)
    simulation = start(
        scene_of(
            (MONATOMIC,),
            regions,
            (0.0,) * D,
            (1.0,) * D,
            (cells,) * D,
            end,
            (("symmetry", "outflow"),) * D,
            cfl,
            **method,
        )
    )
    blocks, fluid = simulation.blocks, simulation.fluid
    for block in range(blocks.local_count):
        U, x = fluid.cells(block), np.meshgrid(*blocks.cell_centers(block)[2::-1], indexing="ij")[::-1][:D]
        r = np.sqrt(sum(along**2 for along in x))
        for d in range(D):
            U[1 + d] = -x[d] / r
        U[-1] += 0.5
    return simulation


def assert_admissible(simulation):
    found = fields(simulation)
    assert found["density"].min() > 0.0 and found["pressure"].min() > 0.0


@pytest.mark.parametrize("cfl", [0.5, 0.9])
@pytest.mark.parametrize("speed", [2.0, 20.0, 1000.0])
def test_gas_torn_apart_up_to_mach_1300(speed, cfl):
    assert_admissible(advance(torn_apart(speed, cfl)))


@pytest.mark.parametrize(
    ("dimensions", "cells", "cfl"),
    [(1, 200, 0.9), (2, 40, 0.5), (2, 40, 0.9), pytest.param(3, 16, 0.9, marks=pytest.mark.full)],
)
def test_cold_gas_falls_in(dimensions, cells, cfl):
    """The kinetic energy is 3e5 times the internal one, so that the truncation error alone can make it negative."""
    simulation = advance(falling_in(dimensions, cells, cfl))
    assert_admissible(simulation)
    assert simulation.fluid.limited_faces() > 0


def test_most_flows_need_no_limiter():
    """Where nothing is at stake no face is touched: Toro's 123 problem at CFL 0.5."""
    simulation = advance(torn_apart(2.0, 0.5))
    assert simulation.fluid.limited_faces() == simulation.fluid.rejected_steps == 0


@pytest.mark.parametrize(("eos", "speed"), [((WATER, AIR), 100.0), ((WATER, AIR), 1000.0), ((WATER,), 100.0)])
def test_water_torn_apart(eos, speed):
    """Water with a trace of air cavitates at a positive pressure. Pure water stands tension: -1.4913e8 Pa on the
    isentrope; its sound speed ends at -p_inf."""
    regions = (
        Region(FluidState(0, 1000.0, 1e5, (speed,)), None),
        Region(FluidState(0, 1000.0, 1e5, (-speed,)), Box((0.0,), (0.5,))),
    )
    scene = scene_of(eos, regions, (0.0,), (1.0,), (200,), 1.5e-4, cfl=0.9, reconstruction="van_leer")
    found = fields(advance(start(scene)))
    assert found["density"].min() > 0.0
    if len(eos) == 2:
        assert 0.0 < found["pressure"].min() < 1.001e5
    else:
        assert found["pressure"].min() == pytest.approx(-1.4913e8, rel=1e-3)


def test_limited_flow_keeps_the_budget_and_has_the_same_bits_on_any_cut():
    """Limited faces and redone steps, in a box whose walls take up the momentum."""
    results = []
    for block, tile in (((40, 40), (40, 40)), ((17, 12), (5, 4))):
        simulation = falling_in(2, 40, 0.9, 0.1, performance=Performance(block, tile))
        budget = Budget(simulation.fluid, None, None)
        budget.row(simulation)
        row = budget.row(advance(simulation))
        assert max(abs(row[name]) for name in row if name.startswith("drift")) < 1e-13
        assert row["limited faces"] > 1000
        results.append((fields(simulation), row["limited faces"], simulation.steps))
    for name, values in results[0][0].items():
        assert np.array_equal(values, results[1][0][name]), name
    assert results[0][1:] == results[1][1:]


@pytest.mark.parametrize("block", [(16, 16), (5, 4)])
def test_the_cell_that_limits_the_time_step_is_named(block):
    """One cell of hot gas, and the speed of sound there plus the flow's; as before the step."""
    air, hot = (FluidState(0, 1.0, p, (10.0, 0.0)) for p in (1e5, 4e5))
    regions = (Region(air, None), Region(hot, Box((0.5, 0.25), (0.5625, 0.3125))))
    performance = Performance(block, block)
    scene = scene_of((AIR,), regions, (0.0, 0.0), (1.0, 1.0), (16, 16), 1.0, performance=performance)
    simulation = start(scene)
    simulation.step()
    assert simulation.limited_by == "fluid CFL, 758.3 m/s at (0.53125, 0.28125) m"  # before a row of the history is due
    assert simulation.name_limit() == simulation.limited_by
    simulation.step()
    assert simulation.limited_by.startswith("fluid CFL, 758.3 m/s")


def test_the_particle_that_limits_the_time_step_is_named():
    """That of the rank whose particles need the shortest step; by its name until one like it is named anew."""
    step = TimeStep(reason=Reason.SOLID, particle=(2.0, "sound of solid particle 7"))
    simulation = Simulation(None, Communicator(), None, None, None, None, None, last_step=step)
    assert simulation.limited_by == "solid"
    assert simulation.name_limit() == simulation.limited_by == "sound of solid particle 7"
    simulation.last_step = TimeStep(reason=Reason.WALL)
    assert simulation.limited_by == "wall speed"
    simulation.last_step = replace(step, particle=(3.0, "sound of solid particle 8"))
    assert simulation.limited_by == "sound of solid particle 7"


def test_a_failed_step_is_redone():
    """With half the time step, counted, and without a trace of the first attempt in the budget."""
    simulation = torn_apart(100.0, 0.9, WALLS)
    budget = Budget(simulation.fluid, None, None)
    budget.row(simulation)
    while not simulation.fluid.rejected_steps:
        simulation.step()
    assert simulation.limited_by == "rejected step"
    row = budget.row(simulation)
    assert row["rejected steps"] > 0
    assert max(abs(row[name]) for name in row if name.startswith("drift")) < 1e-13


def test_reject_brings_back_the_state_and_the_budget():
    simulation = torn_apart(2.0, 0.5)
    for _ in range(3):
        simulation.step()
    fluid = simulation.fluid
    before, left = fluid.cells(0).copy(), fluid.left_domain()
    simulation.step()
    after = fluid.cells(0).copy()
    fluid.reject()
    assert np.array_equal(fluid.cells(0), before) and np.array_equal(fluid.left_domain(), left)
    simulation.step()
    assert np.array_equal(fluid.cells(0), after)


def violent_faces(names, count=150):
    """Random pairs of states with jumps of many sound speeds between them, and many decades of pressure."""
    random = np.random.default_rng(1)
    ranges = {"air": (-2.0, 2.0), "water": (2.9, 3.1), "tnt": (1.0, 3.2)}
    for _ in range(count):
        states = []
        for _ in range(2):
            rho = [10.0 ** random.uniform(*ranges[name]) for name in names]
            p = 1e10 + 10.0 ** random.uniform(5.0, 11.0) if "tnt" in names else 10.0 ** random.uniform(3.0, 10.0)
            velocity = random.uniform(-1.0, 1.0, 2) * 10.0 ** random.uniform(0.0, 4.5)
            fraction = [random.choice([1e-6, 1.0 - 1e-6, random.uniform(0.01, 0.99)])] if len(names) == 2 else []
            states.append((*rho, *velocity, p, *fraction))
        yield states


@pytest.mark.parametrize("names", LIMITED_FLUIDS, ids="-".join)
def test_limited_flux_leaves_what_the_first_order_flux_can_leave(names):
    """And it is unlimited where it may be; rate * signal speed = 1 is the bound for the first-order flux."""
    limited, model = 0, model_of(*names, dimensions=2)
    names_of_formulas = ("face_flux", "sound_speed", "is_admissible", "limited_flux")
    face_flux, sound_speed, is_admissible, limited_flux = (model.formula(name) for name in names_of_formulas)
    for left, right in violent_faces(names):
        speed = max(abs(W[len(names)]) + sound_speed(W) for W in (left, right))
        tilted = [tuple(w * (1.0 + 0.3 * s) for w in W[:-1]) + W[-1:] for W, s in ((left, 1.0), (right, -1.0))]
        F, F_low, rate = face_flux(*tilted, 0.0), face_flux(left, right, 0.0), 0.5 / speed
        found = limited_flux(left, right, F, 0.0, rate)
        if is_admissible(left, right, F, rate):
            size = np.abs(F) + np.abs(F_low)
            assert np.all(np.abs(np.subtract(found, F)) <= 1e-12 * size)
        elif is_admissible(left, right, F_low, rate):
            limited += 1
            assert is_admissible(left, right, found, rate)
    assert limited > 0
