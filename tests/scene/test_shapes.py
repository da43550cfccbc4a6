"""Shapes against their exact areas and volumes, and the packing of bodies with particles."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.none import NoStrength
from distfsi.scene.description import Ball, Body, Box, Cylinder, HalfSpace, Tube
from distfsi.scene.fractions import Filled, cell_fractions, corrected
from distfsi.scene.packing import initial_velocity, pack
from distfsi.scene.shapes import bounding_box, contains, dimensions, distance, volume, volume_within

SHAPES = [
    Box((0.2,), (0.65,)),
    Ball((0.4,), 0.21),
    Box((0.11, 0.2), (0.6, 0.93)),
    Ball((0.5, 0.45), 0.3),
    Tube((0.5, 0.5), 0.2, 0.3),
    Box((0.1, 0.2, 0.3), (0.4, 0.77, 0.9)),
    Ball((0.5, 0.45, 0.5), 0.31),
    Tube((0.5, 0.5, 0.5), 0.2, 0.4),
]


def body(shape, spacing, **more):
    rest = (0.0,) * dimensions(shape)
    return Body("body", shape, spacing, 1000.0, rest, LinearEos(1e9), NoStrength(), None, **more)


def unit_grid(cells, dimensions):
    h = 1.0 / cells
    return (h * (np.arange(cells) + 0.5),) * dimensions, (h,) * dimensions


# ---- geometry --------------------------------------------------------------------------------------------------------


def test_points_inside_and_outside():
    points = np.array([[0.0, 0.0], [0.5, 0.1], [1.2, 0.0], [-3.0, 0.2]])
    assert contains(Box((0.0, -1.0), (1.0, 1.0)), points).tolist() == [False, True, False, False]
    assert contains(Ball((0.0, 0.0), 1.0), points).tolist() == [True, True, False, False]
    assert contains(Tube((0.0, 0.0), 0.4, 1.3), points).tolist() == [False, True, True, False]
    assert contains(HalfSpace((0.5, 0.0), (-2.0, 0.0)), points).tolist() == [False, False, True, False]
    assert distance(HalfSpace((0.0, 0.0), (3.0, 4.0)), points) == pytest.approx([0.0, 0.38, 0.72, -1.64])


def test_bounding_boxes():
    assert bounding_box(Tube((1.0, 2.0), 0.5, 1.0)) == ((0.0, 1.0), (2.0, 3.0))
    assert bounding_box(HalfSpace((0.5, 0.0), (0.0, -2.0))) == ((-math.inf, 0.0), (math.inf, math.inf))
    assert bounding_box(HalfSpace((0.5, 0.0), (1.0, 1.0))) == ((-math.inf,) * 2, (math.inf,) * 2)


@pytest.mark.parametrize("shape", SHAPES, ids=repr)
def test_cell_fractions_add_up_to_the_volume(shape):
    dimensions = len(bounding_box(shape)[0])
    centers, spacing = unit_grid(20, dimensions)
    fractions = cell_fractions(shape, centers, spacing)
    assert fractions.shape == (20,) * dimensions
    assert fractions.min() >= 0.0
    assert fractions.max() == 1.0
    exact = isinstance(shape, Box) or dimensions == 1
    assert fractions.sum() * math.prod(spacing) == pytest.approx(volume(shape), rel=1e-13 if exact else 6e-3)


def test_cell_fractions_converge_to_a_disc():
    disc = Ball((0.5, 0.45), 0.3)
    areas = [cell_fractions(disc, *unit_grid(cells, 2)).mean() for cells in (10, 40, 160)]
    errors = [abs(area - volume(disc)) for area in areas]
    assert errors[0] < 5e-3 * volume(disc)
    assert errors[-1] < 2e-4 * volume(disc)


def test_axes_are_in_the_order_of_the_fields():
    centers = (np.array([0.25, 0.75]), np.array([0.1, 0.3, 0.5]), np.arange(4.0))
    fractions = cell_fractions(Box((0.0, 0.2, -1.0), (0.5, 0.4, 9.0)), centers, (0.5, 0.2, 1.0))
    assert fractions.shape == (4, 3, 2)
    assert np.argwhere(fractions == 1.0).tolist() == [[z, 1, 0] for z in range(4)]
    assert fractions.sum() == 4.0


def test_a_half_space_along_an_axis_is_exact():
    centers, spacing = unit_grid(10, 2)
    fractions = cell_fractions(HalfSpace((0.33, 0.0), (-1.0, 0.0)), centers, spacing)
    assert fractions == pytest.approx(np.tile([0.0, 0.0, 0.0, 0.7, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0], (10, 1)))
    fractions = cell_fractions(HalfSpace((0.3, 0.0), (-1.0, 0.0)), centers, spacing)
    assert (fractions == np.where(centers[0] > 0.3, 1.0, 0.0)).all()


@pytest.mark.parametrize("shape", [*SHAPES[2:5], HalfSpace((0.4, 0.4), (1.0, 0.3))], ids=repr)
def test_cell_fractions_do_not_depend_on_the_cut(shape):
    (x, y), spacing = unit_grid(20, 2)
    whole = cell_fractions(shape, (x, y), spacing)
    parts = [[cell_fractions(shape, (x[i : i + 7], y[j : j + 9]), spacing) for i in (0, 7, 14)] for j in (0, 9, 18)]
    assert (np.block(parts) == whole).all()


@pytest.mark.parametrize("radius", [0.02, 0.1, 0.2, 0.5, 1.0, 2.0, 6.4])
@pytest.mark.parametrize("center", [(7.0, 7.0, 7.0), (7.3, 6.9, 7.17), (0.0, 7.5, 0.0)])
def test_all_cells_of_a_ball_hold_its_volume(radius, center):
    """Radius in cells; the last one is cut in half by two ends of the domain."""
    shape, centers = Ball(center, radius), (np.arange(14) + 0.5,) * 3
    exact = volume_within(shape, (0.0,) * 3, (14.0,) * 3)
    assert exact == pytest.approx(volume(shape) / 2 ** center.count(0.0), rel=1e-14)
    sampled = cell_fractions(shape, centers, (1.0,) * 3)
    fractions = corrected(sampled, Filled.by(sampled), exact)
    assert fractions.sum() == pytest.approx(exact, rel=1e-9)
    assert fractions.min() >= 0.0
    assert fractions.max() <= 1.0
    assert ((fractions == 1.0) == (sampled == 1.0)).all()


def test_the_volume_that_a_domain_cuts_from_a_shape():
    whole = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    along = Cylinder((0.5, 0.5, -0.5), (0.5, 0.5, 0.5), 0.25, 0.1)
    assert volume_within(along, *whole) == pytest.approx(0.5 * volume(along), rel=1e-14)
    quarter = Cylinder((0.0, 1.0, 0.2), (0.0, 1.0, 0.7), 0.25, 0.0)
    assert volume_within(quarter, *whole) == pytest.approx(0.25 * volume(quarter), rel=1e-14)
    assert volume_within(Box((-1.0, 0.2, 0.5), (0.5, 0.4, 2.0)), *whole) == pytest.approx(0.5 * 0.2 * 0.5, rel=1e-14)
    assert volume_within(Ball((0.1, 0.5, 0.5), 0.2), *whole) is None
    assert volume_within(Ball((-0.5, 0.5, 0.5), 0.2), *whole) == 0.0


# ---- packing ---------------------------------------------------------------------------------------------------------


def nearest(points):
    return cKDTree(points).query(points, k=2)[0][:, 1]


def test_a_box_is_filled_exactly():
    positions, volumes = pack(body(Box((0.1, 0.2), (1.13, 0.7)), 0.1), (0.0, 0.0), (2.0, 2.0))
    assert len(positions) == 10 * 5
    assert volumes.sum() == pytest.approx(1.03 * 0.5, rel=1e-14)
    assert positions.min(axis=0) == pytest.approx([0.1 + 0.0515, 0.25])
    assert positions.max(axis=0) == pytest.approx([1.13 - 0.0515, 0.65])


def test_a_symmetry_plane_cuts_a_box_between_particles():
    positions, volumes = pack(body(Box((-0.5,), (0.5,)), 0.1), (0.0,), (1.0,))
    assert positions[:, 0] == pytest.approx(0.05 + 0.1 * np.arange(5))
    assert volumes.sum() == pytest.approx(0.5, rel=1e-14)


def test_a_plate_in_one_dimension():
    positions, volumes = pack(body(Box((0.0,), (0.01,)), 5e-5), (-0.015,), (0.015,))
    assert positions.shape == (200, 1)
    assert volumes == pytest.approx(np.full(200, 5e-5), rel=1e-13)


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_a_ball_has_its_volume(dimensions):
    ball = Ball((0.1,) * dimensions, 0.53)
    positions, volumes = pack(body(ball, 0.1), (-2.0,) * dimensions, (2.0,) * dimensions)
    assert volumes.sum() == pytest.approx(volume(ball), rel=1e-13)
    assert contains(ball, positions).all()
    assert positions.mean(axis=0) == pytest.approx((0.1,) * dimensions)
    assert nearest(positions) == pytest.approx(np.full(len(positions), 0.1))


@pytest.mark.parametrize("shape", [Ball((0.1, 0.2, 0.3), 0.5), Tube((0.1, 0.2, 0.3), 0.3, 0.5)], ids=["ball", "tube"])
def test_shells_follow_a_round_surface(shape):
    """Half a spacing deep everywhere, of exact volume and mirrored in the planes through the middle; a cap of the
    surface has its share of the outermost shell."""
    positions, volumes = pack(body(shape, 0.05, packing="rings"), (-1.0,) * 3, (1.0,) * 3)
    assert volumes.sum() == pytest.approx(volume(shape), rel=1e-13)
    x = positions - np.array([0.1, 0.2, 0.3])
    r = np.linalg.norm(x, axis=1)
    outer = r > r.max() - 1e-9
    assert r.max() == pytest.approx(0.475) and r[~outer].max() < 0.43
    mirrored = {tuple(row) for row in np.abs(x).round(9)}
    assert len(positions) == 8 * len(mirrored)
    apart = cKDTree(positions).query(positions, k=2)[0][:, 1]
    assert apart.min() > 0.499 * 0.05 and apart.max() < 1.3 * 0.05  # around the middle they lie closest
    for z in (0.0, 0.2, 0.4):
        cap = volumes[outer & (x[:, 2] > z)].sum() / volumes[outer].sum()
        assert cap == pytest.approx(0.5 * (1.0 - z / 0.475), abs=0.03)


def test_a_tube_gets_rings():
    tube = Tube((0.0, 0.0), 0.030, 0.034)
    positions, volumes = pack(body(tube, 0.00025), (-0.08, -0.08), (0.08, 0.08))
    assert volumes.sum() == pytest.approx(volume(tube), rel=1e-13)
    radii = np.hypot(*positions.T)
    rings = np.unique(radii.round(9))
    assert rings == pytest.approx(0.030 + 0.00025 * (np.arange(16) + 0.5))
    for ring in rings:
        count = np.count_nonzero(np.isclose(radii, ring, rtol=1e-6))
        assert count % 4 == 0
        assert 2.0 * math.pi * ring / count == pytest.approx(0.00025, rel=0.01)
    assert nearest(positions).min() > 0.9 * 0.00025


def test_a_quarter_of_a_tube_is_a_quarter():
    tube = body(Tube((0.0, 0.0), 0.030, 0.034), 0.0005)
    whole, _ = pack(tube, (-0.08, -0.08), (0.08, 0.08))
    quarter, volumes = pack(tube, (0.0, 0.0), (0.08, 0.08))
    assert 4 * len(quarter) == len(whole)
    assert volumes.sum() == pytest.approx(volume(tube.shape) / 4.0, rel=1e-13)
    assert quarter.min() > 0.4 * 0.0005 / 2.0


@pytest.mark.parametrize(
    ("point", "normal", "exact"),
    [
        ((0.3, 0.0), (-1.0, 0.0), 0.7 * 2.0),
        ((0.0, 0.5), (1.0, 1.0), 0.125),
        ((0.0, 1.0), (-1.0, 2.0), 1.25),
        ((0.0, 0.0, 1.5), (1.0, 1.0, 1.0), (1.5**3 - 3 * 0.5**3) / 6.0),
    ],
)
def test_a_half_space_is_cut_to_the_domain(point, normal, exact):
    upper = (1.0, 2.0) if len(point) == 2 else (1.0, 1.0, 1.0)
    positions, volumes = pack(body(HalfSpace(point, normal), 0.05), (0.0,) * len(point), upper)
    assert volumes.sum() == pytest.approx(exact, rel=1e-12)
    assert volumes[0] == pytest.approx(0.05 ** len(point), rel=0.12)
    assert contains(HalfSpace(point, normal), positions).all()


def test_nothing_outside_the_domain_is_packed():
    for shape in (Box((2.0, 2.0), (3.0, 3.0)), Ball((5.0, 5.0), 1.0), Tube((5.0, 5.0), 1.0, 2.0)):
        positions, volumes = pack(body(shape, 0.1), (0.0, 0.0), (1.0, 1.0))
        assert positions.shape == (0, 2)
        assert volumes.shape == (0,)


@pytest.mark.parametrize("inner", [0.0, 0.21])
@pytest.mark.parametrize("packing", ["rings", "lattice"])
@pytest.mark.parametrize("end", [(0.0, 0.0, 1.03), (-1.0, 0.2, 0.4)])
def test_a_cylinder_has_its_volume_however_it_is_packed(inner, packing, end):
    cylinder = Cylinder((0.0, 0.0, 0.0), end, 0.43, inner)
    positions, volumes = pack(body(cylinder, 0.1, packing=packing), (-2.0,) * 3, (2.0,) * 3)
    assert volumes.sum() == pytest.approx(volume(cylinder), rel=1e-13)
    assert contains(cylinder, positions).all()
    assert positions.mean(axis=0) == pytest.approx(0.5 * np.asarray(end), abs=1e-12)
    low, high = bounding_box(cylinder)
    assert np.all(positions > low) and np.all(positions < high)
    axis = np.asarray(end) / np.linalg.norm(end)
    radii = np.linalg.norm(positions - np.outer(positions @ axis, axis), axis=1)
    if packing == "rings":
        assert radii.max() == pytest.approx(0.43 - 0.5 * (0.43 - inner) / round((0.43 - inner) / 0.1))
        assert len(np.unique(radii.round(9))) == round((0.43 - inner) / 0.1)


def test_a_quarter_of_a_cylinder_is_a_quarter():
    bar = body(Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.32, 0.0), 0.05)
    positions, volumes = pack(bar, (0.0, 0.0, 0.0), (1.0, 1.0, 2.0))
    assert volumes.sum() == pytest.approx(0.25 * math.pi * 0.32**2, rel=1e-13)


@pytest.mark.parametrize("shape", [Ball((0.1, 0.2), 1.0), Tube((0.1, 0.2), 0.5, 1.0), Box((0.0, 0.0), (1.5, 1.0))])
def test_a_turned_lattice_keeps_the_volume(shape):
    positions, volumes = pack(
        body(shape, 0.05, packing="lattice", lattice_angle=math.pi / 6.0), (-2.0, -2.0), (2.0, 2.0)
    )
    assert volumes.sum() == pytest.approx(volume(shape), rel=1e-13)
    assert nearest(positions) == pytest.approx(np.full(len(positions), 0.05))
    offset = positions[np.argsort(np.linalg.norm(positions - positions[len(positions) // 2], axis=1))[1]]
    direction = offset - positions[len(positions) // 2]
    assert math.degrees(math.atan2(direction[1], direction[0])) % 90.0 == pytest.approx(30.0)


def test_radial_velocities_keep_volumes_in_hollow_bodies_and_stretch_full_ones_evenly():
    at = np.array([[0.6, 0.0], [0.0, 0.9]])
    ring = initial_velocity(body(Tube((0.0, 0.0), 0.5, 1.0), 0.1, radial_velocity=10.0), at)
    assert ring == pytest.approx(np.array([[10.0 * 0.5 / 0.6, 0.0], [0.0, 10.0 * 0.5 / 0.9]]))
    disc = initial_velocity(body(Ball((0.0, 0.0), 1.0), 0.1, radial_velocity=10.0), at)
    assert disc == pytest.approx(10.0 * at)
    pipe = body(Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, 0.5), 0.1, radial_velocity=-10.0)
    assert initial_velocity(pipe, np.array([[0.6, 0.0, 0.3]])) == pytest.approx(np.array([[-10.0 * 0.5 / 0.6, 0, 0]]))
    shell = body(Tube((0.0, 0.0, 0.0), 0.5, 1.0), 0.1, radial_velocity=10.0)
    assert initial_velocity(shell, np.array([[0.0, 0.6, 0.0]])) == pytest.approx(
        np.array([[0.0, 10.0 * (0.5 / 0.6) ** 2, 0.0]])
    )
