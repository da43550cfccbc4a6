"""A charge in water: similitude against printed values, and the wave against independent radial computations."""

import numpy as np
import pytest

from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.scene.shipped import shipped_inputs
from distfsi.study import undex_sphere as study


def test_similitude():
    """28 kg: peaks and decays of Cole at 5 and 10 radii, the bubble 500 m deep."""
    assert study.cole_peak(0.8) == pytest.approx(236.5e6, rel=1e-3) and study.cole_peak(1.6) == pytest.approx(
        108.0e6, rel=2e-3
    )
    assert study.cole_decay(0.8) == pytest.approx(188e-6, rel=4e-3)
    assert study.bubble_similitude() == (pytest.approx(35.50e-3, rel=1e-3), pytest.approx(1.277, rel=1e-3))


def test_period_between_samples():
    """The least radius lies where a parabola through the samples has it."""
    times = np.arange(0.0, 10.0, 0.25)
    radii = np.where(times < 4.0, times, 4.0 - 0.02 * (16.0 - (times - 8.1) ** 2))
    period, largest = study.first_period(times, radii)
    assert period == pytest.approx(8.1, rel=1e-9) and largest == radii.max()


@pytest.mark.full
def test_the_wave_is_that_of_radial_computations(tmp_path):
    """60 cells to the radius of the charge: arrival and peak at 2, 5 and 10 radii within 2 %."""
    words = ["stages.0.domain.cells=900", f'output.directory="{tmp_path / "out"}"']
    (stage,) = load(shipped_inputs() / "undex_sphere.toml", words).stages
    run(stage, Communicator(), 1)
    for radii, (arrival, peak) in study.RADIAL["gamma 4.4, 600 MPa"].items():
        found = study.wave(tmp_path / f"out-stage-1/gauges/at_{radii}_radii.csv")
        assert found[:2] == (pytest.approx(arrival, rel=0.02), pytest.approx(peak, rel=0.02))
