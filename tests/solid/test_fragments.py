"""Rings and tubes that break: few seeds of the studies."""

from dataclasses import replace

import pytest

from distfsi.study import fragments, tube_alone


def test_a_ring_that_cannot_fail_stays_whole():
    pieces, spread = fragments.whole_without_failure()
    assert pieces == 1
    assert spread < 0.15


def test_a_ring_that_softens_breaks_into_pieces_as_kipp_and_grady_say():
    coarser = replace(fragments.SOFTENING, particles=20.0)
    q, _ = fragments.sizes(coarser, (1e4, 1e5), 2).exponent
    assert q == pytest.approx(2.0 / 3.0, abs=0.1)


@pytest.mark.full
def test_a_ring_of_scattered_strength_breaks_into_pieces_as_mott_says():
    q, _ = fragments.sizes(fragments.SCATTER, (1e4, 1e5), 4).exponent
    assert q == pytest.approx(1.0, abs=0.15)


@pytest.mark.full
def test_a_tube_of_brittle_steel_bursts():
    burst = tube_alone.burst(tube_alone.scaled(0.1), 1, 30e-6)
    assert 1.1 < burst.first_failure < 1.3
    assert burst.first_failure < burst.first_break < 1.8
    assert burst.pieces > 20
