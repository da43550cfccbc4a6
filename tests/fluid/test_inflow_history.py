"""Pressures that come in through an end, in time: against exact waves."""

from math import exp

import numpy as np
import pytest

from distfsi.errors import InputError
from distfsi.laws.histories.table import TabledPressure
from distfsi.scene import load
from launch import ROOT
from tubes import advance, centers, fields, start

AIR = 1.2, 1e5, 1.4
TUBE = """
[domain]
lower = 0
upper = 1
cells = 200
x = ["inflow", "outflow"]
[time]
end = {end}
[fluid]
reconstruction = "van_leer"
[fluid.phases.air]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "air"
density = 1.2
pressure = 1e5
[fluid.inflow.x_low]
phase = "air"
density = 1.2
pressure = 1e5
history = {history}
"""
SOUND = (1.4 * 1e5 / 1.2) ** 0.5


def run(tmp_path, history, end):
    path = tmp_path / "tube.toml"
    path.write_text(TUBE.format(history=history, end=end))
    return advance(start(load(path)))


def profile(simulation):
    found = fields(simulation)
    return centers(simulation)[0], found["pressure"][0, 0] - 1e5, found["velocity"][0, 0, :, 0]


WAVES = {
    "friedlander": (
        '{ kind = "friedlander", peak = 10, duration = "1 ms", decay = 1.5, start = "0.2 ms" }',
        lambda t: 10.0 * (1.0 - t / 1e-3) * exp(-1500.0 * t),
    ),
    "exponential": (
        '{ kind = "exponential", peak = "10 Pa", decay_time = "0.5 ms", start = "0.2 ms" }',
        lambda t: 10.0 * exp(-t / 5e-4),
    ),
    "table": (
        '{ kind = "table", times = ["0.2 ms", "0.7 ms", "2 ms"], overpressures = [0, 10, -5] }',
        lambda t: np.interp(t, [0.0, 5e-4, 1.8e-3], [0.0, 10.0, -5.0]),
    ),
}


@pytest.mark.parametrize("name", WAVES)
def test_a_weak_wave_comes_in_as_it_is_given(name, tmp_path):
    """p(x, t) = p(0, t - x/c), u = p/(rho c): to 2 % of the peak on the mean, 3 ms after the start."""
    history, expected = WAVES[name]
    x, p, u = profile(run(tmp_path, history, 2.5e-3))
    since = 2.5e-3 - 2e-4 - x / SOUND
    exact = np.array([expected(t) if t >= 0.0 else 0.0 for t in since])
    assert np.abs(p - exact).mean() < 0.02 * 10.0
    assert np.abs(1.2 * SOUND * u - exact).mean() < 0.02 * 10.0


def test_a_strong_wave_is_a_shock(tmp_path):
    """4 bar that stay: the state behind the shock, but for a ripple of its start, and its place, by Rankine and
    Hugoniot."""
    simulation = run(tmp_path, '{ kind = "table", times = [0], overpressures = ["4 bar"] }', 1e-3)
    x, p, u = profile(simulation)
    mach = (1.0 + 2.4 / 2.8 * 4.0) ** 0.5
    expected = 2.0 / 2.4 * SOUND * (mach - 1.0 / mach)
    behind = x < 0.5
    assert np.median(p[behind]) == pytest.approx(4e5, rel=1e-3) and np.abs(p[behind] / 4e5 - 1.0).max() < 0.04
    assert np.median(u[behind]) == pytest.approx(expected, rel=1e-3)
    front = x[np.flatnonzero(p > 2e5)[-1]] + 0.5 * 0.005
    assert abs(front - mach * SOUND * 1e-3) < 2.0 * 0.005


@pytest.mark.parametrize(
    ("history", "words"),
    [
        ('{ kind = "table", times = [0, 1], overpressures = [1] }', "2 times and 1 overpressures"),
        ('{ kind = "table", times = [1, 1], overpressures = [1, 2] }', "times do not grow"),
        ('{ kind = "table", times = [0], overpressures = [-1e5] }', "more than the pressure"),
        ('{ kind = "friedlander", peak = "9 bar", duration = 1, decay = 0 }', "more than the pressure"),
        ('{ kind = "table", times = [], overpressures = [] }', "expected a list of numbers"),
    ],
)
def test_wrong_histories_are_refused(history, words, tmp_path):
    (tmp_path / "tube.toml").write_text(TUBE.format(history=history, end=1.0))
    with pytest.raises(InputError, match=words):
        load(tmp_path / "tube.toml")


def test_a_region_has_no_history(tmp_path):
    text = (ROOT / "inputs/sod.toml").read_text().replace("pressure =", "history = { }\npressure =", 1)
    (tmp_path / "sod.toml").write_text(text)
    with pytest.raises(InputError, match="history"):
        load(tmp_path / "sod.toml")


def test_a_table_between_its_times():
    table = TabledPressure((0.0, 2.0), (1.0, 5.0))
    assert [table.overpressure(t) for t in (-1.0, 0.0, 0.5, 2.0, 9.0)] == [1.0, 1.0, 2.0, 5.0, 5.0]
