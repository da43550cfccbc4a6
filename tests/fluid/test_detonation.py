"""Detonations by programmed burn: planar ones against Chapman and Jouguet and the Taylor wave, and that nothing is
created."""

import numpy as np
import pytest

from distfsi.diagnostics.budget import Budget
from distfsi.errors import InputError
from distfsi.fluid.marching import march
from distfsi.laws.afterburn.air_limited import AirLimited
from distfsi.laws.afterburn.miller import Miller
from distfsi.laws.burn.programmed import Programmed
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.materials import find
from distfsi.scene.shocks import chapman_jouguet
from distfsi.simulation import Simulation
from launch import run_ranks
from side_by_side import SideBySide

PLANAR = """
[domain]
lower = 0
upper = "0.1 m"
cells = 200
x = ["wall", "outflow"]
[time]
end = "12 us"
[fluid]
reconstruction = "van_leer"
[fluid.phases.charge]
material = "TNT"
[fluid.phases.air]
material = "air"
[[fluid.regions]]
phase = "charge"
[[fluid.regions]]
phase = "air"
shape = { kind = "half_space", point = "95 mm", normal = -1 }
[fluid.detonation]
phase = "charge"
[[fluid.detonation.detonators]]
kind = "plane"
point = 0
normal = 1
"""
BALL = """
[domain]
lower = [0, 0]
upper = ["0.1 m", "0.1 m"]
cells = [32, 32]
x = ["symmetry", "outflow"]
y = ["symmetry", "outflow"]
[time]
end = "14 us"
maximum_steps = 120
[performance]
block_cells = [16, 16]
tile_cells = [8, 5]
[fluid.phases.air]
material = "air"
[fluid.phases.charge]
material = "Comp B"
[[fluid.regions]]
phase = "air"
[[fluid.regions]]
phase = "charge"
shape = { kind = "ball", center = [0, 0], radius = "45 mm" }
[fluid.detonation]
phase = "charge"
[[fluid.detonation.detonators]]
kind = "point"
position = ["5 mm", "12 mm"]
delay = "1 us"
[fluid.afterburn]
phase = "charge"
law = { kind = "miller", energy = "10 MJ/kg", rate = "2e4 1/s" }
"""


@pytest.fixture
def scene(tmp_path):
    """The scene of a text with overrides."""

    def read(text, *overrides):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return load(path, [f'output.directory="{tmp_path}/out"', *overrides])

    return read


def start(scene):
    return Simulation.of(scene, Communicator(), 1)


def primitives(simulation, block=0):
    fluid = simulation.fluid
    return np.stack(fluid.model.formula("primitives")(fluid.cells(block).astype(float)))


# ---- planar ----------------------------------------------------------------------------------------------------------


def taylor_wave(eos, state, count=2000):
    """x/t and pressure behind a planar detonation that began at a wall: along the isentrope du = c d rho/rho, down to
    rest, x/t = u + c."""
    density, pressure, velocity, found = state.density, state.pressure, state.velocity, []
    while velocity > 0.0:
        (reference, slope), (omega, _) = eos.reference(density), eos.grueneisen(density)
        sound = np.sqrt(slope + (pressure - reference + omega * pressure) / density)
        found.append((velocity + sound, pressure))
        change = -density / count
        velocity += sound / density * change
        pressure += sound**2 * change
        density += change
    return np.array(found[::-1]).T


@pytest.mark.parametrize("explosive", ["TNT", "C4", "Comp B"])
def test_a_planar_detonation_has_the_speed_of_chapman_and_jouguet(scene, explosive):
    end = 0.09 / find(explosive).detonation.speed
    simulation = start(scene(PLANAR, f"fluid.phases.charge.material={explosive}", f"time.end={end}"))
    burn, eos = simulation.scene.fluid.detonation.burn, simulation.scene.fluid.phases[0].eos
    found, h = chapman_jouguet(eos, burn.density, burn.energy), simulation.scene.domain.spacing[0]
    energy, fronts = simulation.fluid.totals()[0][-1], []
    while not simulation.done:
        simulation.step()
        assert simulation.fluid.totals()[0][-1] == pytest.approx(energy, rel=1e-12)
        pressure = primitives(simulation)[3, 0, 0]
        above = np.flatnonzero(pressure > 0.3 * found.pressure)
        if len(above) and above[-1] > 60:
            i = above[-1]
            fronts.append((simulation.time, i + (pressure[i] - 0.3 * found.pressure) / (pressure[i] - pressure[i + 1])))
    time, place = np.array(fronts).T
    assert np.polyfit(time, place * h, 1)[0] == pytest.approx(found.front, rel=0.005)
    # the peak, and the wave behind it
    x = (np.arange(200) + 0.5) * h
    speed, wave = taylor_wave(eos, found)
    expected = np.interp(x / simulation.time, speed, wave, left=wave[0])
    behind = x < burn.speed * simulation.time - 20 * h
    assert np.abs(pressure - expected)[behind].mean() < 0.005 * found.pressure
    assert 0.92 < pressure.max() / found.pressure < 1.01
    # the pressure at the front, to which the wave behind it leads
    front = burn.speed * simulation.time
    near = (x < front - 5 * h) & (x > front - 25 * h)
    leads_to, should = (np.polyval(np.polyfit(x[near] - front, p[near], 2), 0.0) for p in (pressure, expected))
    assert should == pytest.approx(found.pressure, rel=0.005) and leads_to == pytest.approx(found.pressure, rel=0.03)
    assert primitives(simulation)[5, 0, 0][behind].max() == 0.0  # nothing is left unburnt


def test_the_peak_comes_closer_with_more_cells(scene):
    peaks = []
    for cells in (100, 200, 400):
        simulation = start(scene(PLANAR, f"domain.cells={cells}"))
        while not simulation.done:
            simulation.step()
        peaks.append(primitives(simulation)[3].max() / 21.0e9)
    assert peaks[0] < peaks[1] < peaks[2] < 1.01


# ---- round ones ------------------------------------------------------------------------------------------------------


def run_of(simulation):
    """The state after the run, in the grid's order, and whether totals stayed."""
    before = simulation.fluid.totals()[0]
    while not simulation.done:
        simulation.step()
    after = simulation.fluid.totals()[0] + simulation.fluid.left_domain()
    assert after[[0, 1, -1]] == pytest.approx(before[[0, 1, -1]], rel=1e-12)
    blocks = simulation.blocks
    whole = np.empty((simulation.fluid.model.variables, *blocks.grid.cells[::-1]))
    for b in range(blocks.local_count):
        place = [slice(o, o + n) for o, n in zip(blocks.origin[b][::-1], blocks.extent[b][::-1], strict=True)]
        whole[:, *place] = simulation.fluid.cells(b)
    return whole


@pytest.mark.parametrize("model", ["six_equation", "five_equation"])
def test_a_ball_burns_and_burns_on(scene, model):
    simulation = start(scene(BALL, f"fluid.model={model}"))
    whole = run_of(simulation)
    held = simulation.fluid.held_energies()
    mass = simulation.fluid.totals()[0][1]
    assert held[0] < 1e-6 * mass * 5e6  # all has burnt, but for traces
    assert 0.2 * 10e6 * mass < held[1] < 0.999 * 10e6 * mass  # and some of the products with air
    shares = whole[-2:] / whole[1]
    assert shares.min() >= -1e-9 and shares.max() <= 1.0 + 1e-9


def test_products_burn_with_the_air_of_their_cell(scene):
    """Where all has detonated no air is left over, in the cloud nothing burns, and nothing is created."""
    law = 'fluid.afterburn.law={kind="air_limited", energy="10.2 MJ/kg", air=3.2}'
    air, products, *_, unburnt, left = run_of(start(scene(BALL, law)))  # mass and energy to 1e-12
    mixed, cloud = (products > 0.01) & (unburnt == 0.0), (products > 1.0) & (air < 1e-3)
    assert np.all(left[mixed] <= np.maximum(products - air / 3.2, 0.0)[mixed] + 1e-9) and mixed.sum() > 100
    assert np.all(left[cloud] > 0.999 * products[cloud]) and (products - left).max() > 0.1


def test_blocks_tiles_and_a_restart_change_no_bit(scene):
    whole = run_of(start(scene(BALL)))
    other = run_of(start(scene(BALL, "performance.block_cells=[32, 8]", "performance.tile_cells=[32, 3]")))
    assert np.array_equal(whole, other)
    first, again = start(scene(BALL)), start(scene(BALL))
    for _ in range(50):
        first.step()
    for name, part in again.kept().items():
        part.restore(first.kept()[name].snapshot())
    assert np.array_equal(whole, run_of(again))


def test_ranks_change_no_byte_of_the_history(tmp_path):
    (tmp_path / "scene.toml").write_text(BALL)
    tables = []
    for ranks in (1, 3):
        out = tmp_path / str(ranks)
        words = ["-m", "distfsi", tmp_path / "scene.toml", "--set", f'output.directory="{out}"']
        run_ranks(ranks, [*words, "--set", "time.maximum_steps=30", "--set", "output.history_every=1"], 120.0)
        tables.append((out / "history.csv").read_bytes())
    assert tables[0] == tables[1] and b"held by unburnt [J/m]" in tables[0]


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_cuda_text_has_the_bits_of_the_cpu(monkeypatch, scene, precision):
    pair = SideBySide(monkeypatch)
    simulation = start(scene(BALL, f"fluid.precision={precision}", "fluid.detonation.detonators.0.delay=0"))
    for _ in range(6):
        simulation.step()
    assert not pair.unlike and pair.calls["react"] == 6


def test_in_single_precision_it_burns_alike(scene):
    one, other = (run_of_pressures(scene, precision) for precision in ("float64", "float32"))
    assert np.abs(one - other).max() < 0.02 * one.max()


def run_of_pressures(scene, precision):
    simulation = start(scene(PLANAR, "domain.cells=100", f"fluid.precision={precision}"))
    while not simulation.done:
        simulation.step()
    return primitives(simulation)[3]


# ---- laws and inputs -------------------------------------------------------------------------------------------------


def test_the_burnt_share_follows_time_and_compression():
    burn = Programmed(1630.0, 4.3e6, 7000.0, 21e9, 1.5)
    h = 1e-3
    assert burn.unburnt(1.0, -1e-6, 1630.0, h) == 1.0
    assert burn.unburnt(1.0, 1e-7, 1630.0, h) == pytest.approx(1.0 - 0.7 / 1.5, rel=1e-12)
    assert burn.unburnt(0.3, 1e-7, 1630.0, h) == 0.3  # never back
    assert burn.unburnt(1.0, 1e-6, 1630.0, h) == 0.0
    dense = 1630.0 / (1.0 - 21e9 / (1630.0 * 7000.0**2))  # at V_CJ
    assert burn.unburnt(1.0, -1.0, 0.999 * dense, h) == 1.0 and burn.unburnt(1.0, -1.0, 1.001 * dense, h) == 0.0


def test_miller_burns_all_and_no_more():
    law = Miller(10e6, 1e4, 0.5, 0.0, 1e5)
    share = 1.0
    for _ in range(10):
        share = law.left(share, 0.0, 2e6, 0.0, 1e-5)
    assert share == pytest.approx((1.0 - 0.5 * 1e4 * 1e-4) ** 2, rel=1e-12)  # exact in any number of steps
    assert law.left(share, 0.0, 2e6, 0.0, 1.0) == 0.0
    assert law.left(1.0, 0.7, 2e6, 0.0, 1.0) == 0.7  # only what has detonated
    assert law.left(0.5, 0.0, 0.9e5, 0.0, 1.0) == 0.5


def test_air_limits_the_afterburn():
    law = AirLimited(10e6, 3.2)
    assert law.left(1.0, 0.0, 1e6, 0.0, 1.0) == 1.0
    assert law.left(1.0, 0.0, 1e6, 1.6, 1.0) == 0.5
    assert law.left(0.3, 0.0, 1e6, 1.6, 1.0) == 0.3  # never back
    assert law.left(1.0, 0.1, 1e6, 100.0, 1.0) == 1.0  # not before all has detonated
    assert law.left(1.0, 0.0, 1e6, 100.0, 1.0) == 0.0


@pytest.mark.parametrize(
    ("override", "text"),
    [
        (
            "fluid.phases.air.material=water\n"
            'fluid.afterburn={phase="charge", law={kind="air_limited", energy=1, air=3}}',
            "'air_limited' burns with air, but 'air' is no gas",
        ),
        ("fluid.detonation.burn.speed=6000", "6000 m/s contradicts the equation of state, which gives 6929.4 m/s"),
        ("fluid.detonation.burn.pressure=15e9", "1.5e+10 Pa contradicts the equation of state, which gives 2.1e+10 Pa"),
        ("fluid.detonation.phase=air", None),
        ("fluid.regions.0.energy=4e6", "an explosive that detonates is given unburnt, by its pressure"),
        ('fluid.afterburn={phase="air", law={kind="miller", energy=1e7, rate=1}}', "expected that of the detonation"),
    ],
)
def test_what_contradicts_is_a_fault(scene, override, text):
    with pytest.raises(InputError) as caught:
        scene(PLANAR, *override.split("\n"))
    assert text is None or any(text in line for line in caught.value.faults)


def test_speed_and_pressure_follow_from_the_equation_of_state(scene):
    plain = PLANAR.replace(
        'material = "TNT"', 'eos = "jwl"\nrho0 = 1630\nA = 371.2e9\nB = 3.231e9\nR1 = 4.15\nR2 = 0.95\nomega = 0.3'
    )
    plain = plain.replace(
        'phase = "charge"\n[[fluid.regions]]', 'phase = "charge"\ndensity = 1630\npressure = 1e5\n[[fluid.regions]]'
    )
    burn = scene(
        plain, 'fluid.detonation.burn={kind="programmed", density=1630, energy=4.2945e6}'
    ).fluid.detonation.burn
    assert burn.speed == pytest.approx(6929.3, rel=1e-4) and burn.pressure == pytest.approx(21.0e9, rel=1e-3)


# ---- around obstacles ------------------------------------------------------------------------------------------------

CORNER = """
[domain]
lower = [0, 0]
upper = ["0.1 m", "0.1 m"]
cells = [50, 50]
[time]
end = "14 us"
maximum_steps = 60
[performance]
block_cells = [16, 16]
[fluid.phases.air]
material = "air"
[fluid.phases.charge]
material = "TNT"
[[fluid.regions]]
phase = "air"
[[fluid.regions]]
phase = "charge"
shape = { kind = "box", lower = ["5 mm", "10 mm"], upper = ["95 mm", "90 mm"] }
[[fluid.regions]]
phase = "air"
shape = { kind = "box", lower = ["30 mm", "40 mm"], upper = ["50 mm", "60 mm"] }
[fluid.detonation]
phase = "charge"
path = "around"
[[fluid.detonation.detonators]]
kind = "point"
position = ["10 mm", "50 mm"]
"""


def test_fronts_march_in_circles():
    n = 61
    x = (np.arange(n) + 0.5) / n
    r = np.hypot(*np.meshgrid(x - 0.5, x - 0.5))
    times = march(np.where(r < 6.0 / n, r / 2.0, np.inf), np.ones((n, n), dtype=bool), (1.0 / n, 1.0 / n), 2.0)
    assert np.abs(times - r / 2.0).max() < 0.003 * times.max()
    for other in (times.T, times[::-1], times[:, ::-1]):
        assert np.abs(times - other).max() < 1e-14
    closed = np.ones((n, n), dtype=bool)
    closed[:, 10] = False
    assert np.isinf(march(np.where(r < 0.1, r, np.inf), closed, (1.0, 1.0), 1.0)[:, :10]).all()


def test_a_detonation_goes_round_a_corner(scene):
    """Lit behind the block of air only by way of its corners, alike on both sides."""
    simulation = start(scene(CORNER))
    blocks, speed = simulation.blocks, simulation.scene.fluid.detonation.burn.speed
    times = np.empty((50, 50))
    for b in range(blocks.local_count):
        place = [slice(o, o + n) for o, n in zip(blocks.origin[b][::-1], blocks.extent[b][::-1], strict=True)]
        times[tuple(place[1:])] = blocks.without_ghosts(simulation.fluid.reactions.lighting.host())[
            b, 0, 0, : blocks.extent[b][1], : blocks.extent[b][0]
        ]
    x = (np.arange(50) + 0.5) * 2e-3
    X, Y = np.meshgrid(x, x)
    up = np.abs(Y - 0.05)
    # the way round: to a corner in front of the block, along it, and on from the one behind
    direct = np.hypot(X - 0.01, up)
    first, second = np.hypot(0.02, 0.01), 0.02
    shade = (X > 0.05) & (up < 0.01)
    behind = first + second + np.hypot(X - 0.05, up - 0.01)
    inside = (X > 0.005) & (X < 0.095) & (up < 0.04)
    error = np.abs(times * speed - behind)[shade & inside]
    assert error.max() < 2.6e-3 and error.mean() < 1.3e-3  # half a cell a corner: by centers of cells
    seen = inside & (up * 0.02 >= 0.01 * (X - 0.01) + 1e-4)  # beside the ray through the first corner
    assert np.abs(times * speed - direct)[seen].max() < 1.5e-3
    assert np.abs(times - times[::-1]).max() < 1e-18
    whole = run_of(simulation)
    energy = whole[4]
    assert np.abs(energy - energy[:, ::-1]).max() < 1e-9 * energy.max()


def test_a_charge_beside_a_plate_keeps_its_energy(scene):
    """Shares go through cut cells, and a front marches around the plate."""
    plate = """
[solid.bodies.plate]
material = "steel 4340"
failure = "none"
shape = { kind = "box", lower = ["30 mm", "20 mm"], upper = ["42 mm", "30 mm"] }
spacing = "1.5 mm"
"""
    text = BALL + plate
    simulation = start(scene(text, "fluid.detonation.path=around", "time.maximum_steps=60"))
    budget = Budget(simulation.fluid, simulation.solid, simulation.coupling)
    first = budget.row(simulation)
    while not simulation.done:
        simulation.step()
    last = budget.row(simulation)
    assert abs(last["drift energy"]) < 1e-12 and abs(last["drift mass_2"]) < 1e-12
    assert last["held by unburnt [J/m]"] < 0.5 * first["held by unburnt [J/m]"]
    assert last["solid kinetic energy [J/m]"] > 0.0
