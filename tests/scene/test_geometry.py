"""Composed shapes: volumes against Monte Carlo and exact ones, distances, files of surfaces and particles, packings."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from distfsi.errors import InputError
from distfsi.laws.solid.eos.linear import LinearEos
from distfsi.laws.solid.strength.none import NoStrength
from distfsi.mesh.communicator import Communicator
from distfsi.scene import description as d
from distfsi.scene import load
from distfsi.scene.cloud import Cloud
from distfsi.scene.composed import Difference, Intersection, Placed, Similarity, Union, placed
from distfsi.scene.description import Ball, Body, Box, Cylinder, HalfSpace
from distfsi.scene.fractions import cell_fractions
from distfsi.scene.packing import pack
from distfsi.scene.sections import Polygon, extruded, revolved
from distfsi.scene.shapes import bounding_box, contains, dimensions, distance, has_true_distance, volume
from distfsi.scene.surface import Mesh
from distfsi.scene.turns import rotation
from distfsi.simulation import Simulation
from mpi_coupling import Coupled, gas
from mpi_coupling import body as rigid_body

HEAVY, OPEN = 1e15, ("outflow", "outflow")

I_BEAM = ((0, 0), (10, 0), (10, 1), (5.5, 1), (5.5, 9), (10, 9), (10, 10), (0, 10), (0, 9), (4.5, 9), (4.5, 1), (0, 1))
STIFFENED = Union((Box((0.0, 0.0, 0.0), (1.0, 0.5, 0.1)), Box((0.4, 0.0, 0.1), (0.5, 0.5, 0.6))))


def turned(shape, angle=0.7, axis=(1.0, 2.0, -0.5), about=(0.2, 0.1, 0.3)):
    D = dimensions(shape)
    return placed(shape, Similarity.about(about[:D], rotation(D, angle, axis)))


def body(shape, spacing, **more):
    rest = (0.0,) * dimensions(shape)
    return Body("body", shape, spacing, 1000.0, rest, LinearEos(1e9), NoStrength(), None, **more)


def everywhere(dimensions):
    return (-10.0,) * dimensions, (10.0,) * dimensions


def box_file(path, lower=(25.0, 50.0, 100.0), upper=(125.0, 100.0, 300.0)):
    trimesh.creation.box(bounds=np.array([lower, upper])).export(path)
    return str(path)


# ---- volumes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "exact", "tolerance"),
    [
        (STIFFENED, 0.05 + 0.025, 1e-14),
        (turned(STIFFENED), 0.075, 1e-13),
        (Union(tuple(map(turned, STIFFENED.shapes))), 0.075, 1e-5),  # two that touch along no axis
        (Difference(Box((0, 0), (1, 1)), (Box((0.2, 0.3), (0.6, 2.0)),)), 1.0 - 0.4 * 0.7, 1e-14),
        (Difference(Box((0, 0), (1, 1)), (Ball((0.5, 0.5), 0.3),)), 1.0 - 0.09 * math.pi, 2e-5),
        (Intersection((Ball((0, 0, 0), 1.0), Ball((1, 0, 0), 1.0))), 5.0 * math.pi / 12.0, 2e-5),
        (Intersection((Ball((0, 0, 0), 1.0), HalfSpace((0, 0, 0), (1, 1, 0)))), 2.0 * math.pi / 3.0, 2e-5),
        (Polygon(I_BEAM), 28.0, 1e-14),
        (turned(Polygon(I_BEAM)), 28.0, 1e-13),
        (extruded(Polygon(I_BEAM), 1, -1.0, 2.0), 84.0, 1e-14),
        (revolved(Box((0.0, 0.0), (2.0, 3.0)), 2, (1.0, 1.0, 1.0)), 12.0 * math.pi, 1e-14),
        (revolved(Polygon(((0, 0), (2, 0), (0, 3))), 0, (0, 0, 0)), 4.0 * math.pi, 1e-14),
        (revolved(Ball((2.0, 0.0), 0.5), 1, (0, 0, 0)), math.pi**2, 1e-14),
        (placed(Box((0, 0), (1, 2)), Similarity.about((5, 5), rotation(2, 0.1), 3.0)), 18.0, 1e-13),
    ],
    ids=lambda value: type(value).__name__,
)
def test_volumes_are_exact(shape, exact, tolerance):
    assert volume(shape) == pytest.approx(exact, rel=tolerance)


def cuboid(draw, D):
    lower = np.array([draw(st.floats(-1.0, 0.6)) for _ in range(D)])
    size = np.array([draw(st.floats(0.2, 1.0)) for _ in range(D)])
    return Box(tuple(lower), tuple(lower + size)), lambda x: np.all((x > lower) & (x < lower + size), axis=1)


def ball(draw, D):
    center, radius = np.array([draw(st.floats(-0.8, 0.8)) for _ in range(D)]), draw(st.floats(0.2, 0.8))
    return Ball(tuple(center), radius), lambda x: ((x - center) ** 2).sum(axis=1) < radius**2


@st.composite
def trees(draw, D, depth=2):
    """A boolean tree, and by other means whether points are in it."""
    kind = draw(st.sampled_from(("union", "intersection", "difference", "turn"))) if depth else "leaf"
    if kind == "leaf":
        return draw(st.sampled_from((cuboid, ball)))(draw, D)
    (first, in_first) = draw(trees(D, depth - 1))
    if kind == "turn":
        turn, by = rotation(D, draw(st.floats(0.1, 3.0)), (1.0, 0.5, 2.0)), np.full(D, draw(st.floats(-0.3, 0.3)))
        motion = Similarity(tuple(map(tuple, turn)), tuple(by))
        return placed(first, motion), lambda x: in_first(np.linalg.solve(turn, (x - by).T).T)
    (second, in_second) = draw(trees(D, depth - 1))
    if kind == "union":
        return Union((first, second)), lambda x: in_first(x) | in_second(x)
    if kind == "intersection":
        return Intersection((first, second)), lambda x: in_first(x) & in_second(x)
    return Difference(first, (second,)), lambda x: in_first(x) & ~in_second(x)


@pytest.mark.parametrize("D", [2, 3])
@settings(max_examples=12, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_trees_of_shapes_have_the_volume_of_the_points_in_them(D, data):
    shape, inside = data.draw(trees(D))
    points = np.random.default_rng(1).uniform(-3.0, 3.0, (40_000, D))
    found = inside(points)
    assert np.array_equal(contains(shape, points), found)
    lower, upper = map(np.asarray, bounding_box(shape))
    assert np.all((points[found] >= lower) & (points[found] <= upper))
    if np.any(upper <= lower):
        assert volume(shape) == 0.0 and not found.any()
        return
    points = np.random.default_rng(2).uniform(lower, upper, (40_000, D))
    share = inside(points).mean()
    error = 5.0 * math.sqrt(share * (1.0 - share) / len(points)) + 2e-4
    assert volume(shape) / np.prod(upper - lower) == pytest.approx(share, abs=error)


@pytest.mark.parametrize("D", [2, 3])
@settings(max_examples=12, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_a_distance_is_a_bound_from_below(D, data):
    """No point inside and none outside are nearer to each other than either is told to be to the surface."""
    shape, _ = data.draw(trees(D))
    points = np.random.default_rng(3).uniform(-2.0, 2.0, (3000, D))
    signed = distance(shape, points)
    for side in (signed < 0.0, signed > 0.0):
        if side.any() and not side.all():
            gap, _ = cKDTree(points[~side]).query(points[side])
            assert np.all(np.abs(signed[side]) <= gap + 1e-12)


@pytest.mark.parametrize(
    "shape",
    [
        Box((0, 0, 0), (1, 2, 0.5)),
        Cylinder((0, 0, 0), (0.5, 0.5, 1), 0.6, 0.2),
        turned(Box((0, 0, 0), (1, 2, 0.5))),
        extruded(Polygon(tuple((0.1 * x, 0.1 * y) for x, y in I_BEAM)), 2, 0.0, 0.7),
        Union((Ball((-1, 0, 0), 0.4), Box((0, 0, 0), (1, 1, 1)))),
        "mesh",
    ],
    ids=lambda shape: shape if isinstance(shape, str) else type(shape).__name__,
)
def test_a_true_distance_leads_to_the_surface(shape, tmp_path):
    """A step of its length against its gradient ends on the surface, within and without, beside edges too."""
    if shape == "mesh":
        shape = Mesh(box_file(tmp_path / "box.ply", (0, 0, 0), (1, 2, 1)), "m")
    assert has_true_distance(shape)
    points = np.random.default_rng(4).uniform(-1.5, 2.5, (400, 3))
    d = distance(shape, points)
    step = 1e-6
    slope = np.stack([(distance(shape, points + e) - distance(shape, points - e)) / 2 / step for e in step * np.eye(3)])
    smooth = np.abs(np.linalg.norm(slope, axis=0) - 1.0) < 1e-6  # not where two places are equally near
    assert smooth.mean() > 0.9
    assert np.abs(distance(shape, points - (d * slope).T))[smooth].max() < 1e-5


def test_shapes_that_only_bound_the_distance_say_so():
    assert not has_true_distance(Difference(Box((0.0,), (1.0,)), (Ball((0.5,), 0.1),)))
    assert not has_true_distance(STIFFENED)


def test_regions_of_composed_shapes_fill_cells_by_their_volume():
    centers, h = ((np.arange(20) + 0.5) / 10.0 - 0.5,) * 3, (0.1,) * 3
    for shape in (turned(STIFFENED), Difference(Ball((0.5, 0.5, 0.5), 0.45), (Box((0.5, 0.5, 0.5), (2, 2, 2)),))):
        fractions = cell_fractions(shape, centers, h)
        assert fractions.sum() * 1e-3 == pytest.approx(volume(shape), rel=4e-3)
        parts = [cell_fractions(shape, (centers[0][n : n + 7], *centers[1:]), h) for n in (0, 7, 14)]
        assert np.array_equal(np.concatenate(parts, axis=2), fractions)


# ---- packings --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.3])
@pytest.mark.parametrize(
    ("shape", "spacing"),
    [
        (STIFFENED, 0.025),
        (extruded(Polygon(tuple((0.1 * x, 0.1 * y) for x, y in I_BEAM)), 0, 0.0, 0.5), 0.05),
        (Difference(Box((0, 0, 0), (1, 1, 0.2)), (Cylinder((0.5, 0.5, -1), (0.5, 0.5, 1), 0.3, 0.0),)), 0.04),
        (Union(tuple(Ball((0.5 * n, 0.0, 0.0), 0.2) for n in range(3))), 0.03),
    ],
    ids=["boxes", "beam", "hole", "balls"],
)
def test_mass_of_a_turned_body_of_many_shapes(shape, spacing, angle):
    """As many particles as its volume asks for, of which the mass is then exact."""
    shape = turned(shape, angle)
    positions, volumes = pack(body(shape, spacing), *everywhere(3))
    assert volumes.sum() == pytest.approx(volume(shape), rel=1e-13)
    assert contains(shape, positions).all()
    lattice = isinstance(shape, Placed | Union) or angle == 0.0
    nearest = cKDTree(positions).query(positions, k=2)[0][:, 1]
    assert nearest.min() > 0.7 * spacing and lattice
    assert np.abs(distance(shape, positions)).min() > 0.24 * spacing


def test_lattices_fit_between_faces():
    positions, volumes = pack(body(STIFFENED, 0.027), *everywhere(3))
    assert volumes.sum() == pytest.approx(0.075, rel=1e-14)
    assert len(np.unique(positions[:, 2].round(9))) == 4 + 19
    assert distance(STIFFENED, positions).max() == pytest.approx(-0.5 * 0.1 / 4, rel=0.2)


def test_a_relaxed_packing_is_even_and_keeps_off_the_surface():
    shape = Difference(Box((0, 0), (1, 1)), (Ball((0.5, 0.5), 0.3),))
    raw = volume(shape) / 0.02**2
    positions, volumes = pack(body(shape, 0.02), *everywhere(2))
    assert len(positions) == pytest.approx(raw, rel=1e-3) and volumes.sum() == pytest.approx(volume(shape), rel=1e-14)
    nearest = cKDTree(positions).query(positions, k=2)[0][:, 1] / 0.02
    assert nearest.min() > 0.8 and nearest.mean() > 0.95
    depth = -distance(shape, positions) / 0.02
    assert depth.min() > 0.45
    outermost = depth[depth < 0.9]
    assert abs(outermost.mean() - 0.5) < 0.02 and outermost.std() < 0.03


def test_a_symmetry_plane_cuts_a_composed_body():
    shape = Difference(Ball((0, 0), 1.0), (Box((-0.3, -0.3), (0.3, 0.3)),))
    positions, volumes = pack(body(shape, 0.05), (0.0, -2.0), (2.0, 2.0))
    assert volumes.sum() == pytest.approx(volume(shape) / 2.0, rel=1e-4)
    assert positions[:, 0].min() > 0.3 * 0.05


# ---- bodies that move ------------------------------------------------------------------------------------------------

T = Union((Box((0.3, 0.3), (0.7, 0.4)), Box((0.45, 0.4), (0.55, 0.7))))


def test_a_turned_body_of_two_shapes_flies_freely_and_rests_in_gas():
    """With its gas, so that both are the same; nothing of the state changes."""
    for velocity in ((1.0, 0.5), (0.0, 0.0)):
        flying = rigid_body(turned(T, 0.6, about=(0.5, 0.5, 0.0)), 0.025, HEAVY, velocity, stiffness=1.0)
        still = [(gas(1.4, 1.0, velocity), None)]
        case = Coupled([flying], still, (0.0,) * 2, (1.0,) * 2, (20,) * 2, (OPEN,) * 2, scheme="cut_cells")
        start = case.solid.columns["position"].copy()
        for _ in range(6):
            case.step()
        open_cells = case.grid_of(case.coupling.fluid_volume.host())[0] > 0.0
        W = np.array(case.fluid.model.formula("primitives")(tuple(case.grid_of(case.fluid.state))))[:, open_cells]
        assert np.abs(W[3] - 1.0).max() < 1e-12 and np.abs(W[1:3] - np.array(velocity)[:, None]).max() < 1e-12
        moved = case.solid.columns["position"] - start
        assert np.abs(moved - case.simulation.time * np.array(velocity)).max() < 1e-12


def test_an_impact_does_not_depend_on_how_bodies_are_turned():
    """A block hits a T; energies and speeds, in a frame that turns along."""
    answers = []
    for angle in (0.0, 0.5):
        forward = rotation(2, angle)
        shapes = (turned(shape, angle, about=(0.5, 0.5, 0.0)) for shape in (T, Box((0.4, 0.1), (0.6, 0.28))))
        speeds = ((0.0, 0.0), tuple(forward @ (0.0, 3.0)))
        bodies = [
            replace(rigid_body(shape, 0.025, 1.0, speed, stiffness=50.0), name=name)
            for name, shape, speed in zip("ab", shapes, speeds, strict=True)
        ]
        scene = d.Scene(
            "impact",
            d.Domain((-1.0,) * 2, (2.0,) * 2, (8, 8), (OPEN,) * 2),
            d.Time(1e9, 0.4, None),
            None,
            d.Solid(tuple(bodies), 1.3, 1.0, 2.0),
            d.Output("", 0.0, 1),
            d.Performance((8, 8), (8, 8)),
        )
        simulation = Simulation.of(scene, Communicator(), 1)
        while simulation.time < 0.03:
            simulation.step()
        totals = simulation.solid.totals()
        momenta = [simulation.solid.body_totals(b)["momentum"] @ forward for b in (0, 1)]
        answers.append([totals["kinetic"], totals["internal"], *momenta[0], *momenta[1]])
    aligned, oblique = np.array(answers)
    assert aligned[1] > 0.02 * aligned[0]  # something has happened
    assert np.abs(oblique - aligned).max() < 1e-2 * aligned.max()


# ---- files -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply"])
def test_a_box_from_a_file_has_the_bits_of_the_box(tmp_path, suffix):
    box, mesh = Box((0.025, 0.05, 0.1), (0.125, 0.1, 0.3)), Mesh(box_file(tmp_path / f"box.{suffix}"), "mm")
    assert mesh.surface.open_edges == 0
    for a, b in zip(pack(body(box, 0.01), *everywhere(3)), pack(body(mesh, 0.01), *everywhere(3)), strict=True):
        assert np.array_equal(a, b)
    centers, h = ((np.arange(10) + 0.5) * 0.03,) * 3, (0.03,) * 3
    assert np.array_equal(cell_fractions(box, centers, h), cell_fractions(mesh, centers, h))


def test_a_turned_mesh_of_a_box_is_filled_as_the_turned_box(tmp_path):
    box, mesh = Box((0.025, 0.05, 0.1), (0.125, 0.1, 0.3)), Mesh(box_file(tmp_path / "box.stl"), "mm")
    a, b = (pack(body(turned(shape), 0.01), *everywhere(3)) for shape in (box, mesh))
    assert np.allclose(a[0], b[0], rtol=0.0, atol=1e-15) and a[1] == pytest.approx(b[1], rel=1e-13)


def test_distance_to_a_mesh_of_a_ball(tmp_path):
    trimesh.creation.icosphere(subdivisions=3, radius=1.0).export(tmp_path / "ball.stl")
    mesh = Mesh(str(tmp_path / "ball.stl"), "m")
    points = np.random.default_rng(5).uniform(-1.5, 1.5, (2000, 3))
    assert distance(mesh, points) == pytest.approx(np.linalg.norm(points, axis=1) - 1.0, abs=6e-3)
    assert volume(mesh) == pytest.approx(4.0 / 3.0 * math.pi, rel=1e-2)


def test_an_open_surface_still_has_an_inside(tmp_path):
    """A ball that lacks two triangles, and one that is inside out."""
    whole = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    trimesh.Trimesh(whole.vertices, whole.faces[2:]).export(tmp_path / "open.ply")
    trimesh.Trimesh(whole.vertices, whole.faces[:, ::-1]).export(tmp_path / "inverted.ply")
    opened, inverted = (Mesh(str(tmp_path / f"{name}.ply"), "m") for name in ("open", "inverted"))
    assert opened.surface.open_edges > 0 and inverted.surface.open_edges == 0
    assert volume(opened) == pytest.approx(whole.volume, rel=5e-3)
    assert volume(inverted) == pytest.approx(whole.volume, rel=1e-7)  # the file has single precision
    center = np.zeros((1, 3))
    assert contains(opened, center) and contains(inverted, center)
    (tmp_path / "scene.toml").write_text(SCENE.replace("SHAPE", '{ kind = "mesh", file = "open.ply", unit = "mm" }'))
    (note,) = load(tmp_path / "scene.toml").notes
    assert "fluid.regions.1.shape" in note and "not watertight" in note


def test_particles_from_files(tmp_path):
    points = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0), indexing="ij"), -1).reshape(-1, 2) * 2.0
    (tmp_path / "plain.csv").write_text("\n".join(f"{x},{y}" for x, y in points))
    (tmp_path / "named.csv").write_text("y,volume,x\n" + "\n".join(f"{y},3.0,{x}" for x, y in points))
    plain, named = (Cloud(str(tmp_path / f"{name}.csv"), "mm", None, 2) for name in ("plain", "named"))
    for cloud, each in ((plain, 4e-6), (named, 3e-6)):
        positions, volumes = pack(body(cloud, 1.0), *everywhere(2))
        assert np.array_equal(positions, np.array([[float(f"{x / 1e3:.3f}"), y / 1e3] for x, y in points]))
        assert volumes == pytest.approx(np.full(12, each))
    inside = contains(plain, np.array([[0.0031, 0.0009], [0.0071, 0.0], [-0.0009, 0.0]]))
    assert inside.tolist() == [True, False, True]


def test_particles_from_vtk(tmp_path):
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import numpy_to_vtk

    points = np.random.default_rng(6).random((20, 3))
    data, container = vtk.vtkPolyData(), vtk.vtkPoints()
    container.SetData(numpy_to_vtk(points, deep=True))
    data.SetPoints(container)
    writer = vtk.vtkXMLPolyDataWriter()
    writer.SetFileName(str(tmp_path / "points.vtp"))
    writer.SetInputData(data)
    writer.Write()
    positions, _ = pack(body(Cloud(str(tmp_path / "points.vtp"), "m", 0.1, 3), 0.1), *everywhere(3))
    assert np.array_equal(positions, points)


# ---- the input -------------------------------------------------------------------------------------------------------

SCENE = """
[domain]
lower = [-1.0, -1.0, -1.0]
upper = [1.0, 1.0, 1.0]
cells = [10, 10, 10]
[time]
end = 1.0
[fluid.phases.air]
eos = "ideal_gas"
gamma = 1.4
[[fluid.regions]]
phase = "air"
density = 1.2
pressure = 1e5
[[fluid.regions]]
phase = "air"
density = 2.4
pressure = 1e5
shape = SHAPE
"""


def shape_of(folder, text):
    (folder / "scene.toml").write_text(SCENE.replace("SHAPE", text))
    return load(folder / "scene.toml").fluid.regions[1].shape


BOX = '{ kind = "box", lower = [0, 0, 0], upper = ["10 cm", 0.2, 0.3] }'


@pytest.mark.parametrize(
    ("text", "exact"),
    [
        (f'{{ kind = "translate", shape = {BOX}, by = [0.1, 0.0, 0.0] }}', 0.006),
        (f'{{ kind = "rotate", shape = {BOX}, angle = "30 deg", axis = [0, 0, 1] }}', 0.006),
        (f'{{ kind = "scale", shape = {BOX}, factor = 2.0 }}', 0.048),
        (f'{{ kind = "mirror", shape = {BOX}, point = [0, 0, 0], normal = [1, 1, 0] }}', 0.006),
        (f'{{ kind = "line_pattern", shape = {BOX}, count = 3, step = [0.2, 0, 0] }}', 0.018),
        (f'{{ kind = "circle_pattern", shape = {BOX}, count = 4, center = [-0.5, 0, 0], axis = [0, 0, 1] }}', 0.024),
        (f'{{ kind = "union", shapes = [{BOX}, {BOX}] }}', 0.006),
        (f'{{ kind = "intersection", shapes = [{BOX}, {{ kind = "half_space", point = [0.05, 0, 0], normal = [1, 0, 0] }}] }}', 0.003),  # noqa: E501
        (f'{{ kind = "difference", shape = {BOX}, removed = [{{ kind = "translate", shape = {BOX}, by = [0.05, 0, 0] }}] }}', 0.003),  # noqa: E501
        ('{ kind = "extrude", axis = "x", lower = 0, upper = 0.5, section = { kind = "polygon", points = [[0, 0], [0.2, 0], [0, 0.2]] } }', 0.01),  # noqa: E501
        ('{ kind = "revolve", axis = "z", center = [0, 0, 0], section = { kind = "box", lower = [0.1, 0], upper = [0.2, 0.1] } }', 0.003 * math.pi),  # noqa: E501
        ('{ kind = "mesh", file = "box.stl", unit = "mm" }', 0.001),
        ('{ kind = "particles", file = "points.csv", unit = "m", spacing = 0.1 }', 0.002),
    ],
)  # fmt: skip
def test_shapes_of_the_input(tmp_path, text, exact):
    box_file(tmp_path / "box.stl")
    (tmp_path / "points.csv").write_text("x,y,z\n0,0,0\n0.3,0,0\n")
    assert volume(shape_of(tmp_path, text)) == pytest.approx(exact, rel=1e-12)


def test_what_keeps_its_kind_when_it_moves_does():
    quarter = Similarity.about((0, 0, 0), rotation(3, math.pi / 2.0, (0, 0, 1)))
    assert placed(Box((1.0, 0.0, 0.0), (2.0, 0.5, 1.0)), quarter) == Box((-0.5, 1.0, 0.0), (0.0, 2.0, 1.0))
    assert isinstance(turned(Ball((0, 0, 0), 1.0)), Ball)
    assert isinstance(extruded(Ball((0, 0), 1.0), 2, 0.0, 1.0), Cylinder)


def extrude(section, axis="x", lower=0, upper=1):
    return f'{{ kind = "extrude", axis = "{axis}", lower = {lower}, upper = {upper}, section = {{ {section} }} }}'


DISC = 'kind = "ball", center = [0, 0], radius = 1'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f'{{ kind = "rotate", shape = {BOX}, angle = 1.0 }}', "shape (line 19): an axis is needed"),
        ('{ kind = "union", shapes = [] }', "shape.shapes"),
        (f'{{ kind = "translate", shape = {BOX}, by = [0.1, 0.0] }}', "shape.by (line 19): [0.1, 0.0] has 2 entries"),
        (
            '{ kind = "translate", shape = { kind = "blob" }, by = [0, 0, 0] }',
            'shape.shape.kind (line 19): "blob"; expected',
        ),
        (extrude(DISC, axis="w"), "shape.axis"),
        (extrude(DISC, lower=2), "lower must lie below upper"),
        (extrude('kind = "ball", center = [0, 0, 0], radius = 1'), "needs 2"),
        (extrude('kind = "polygon", points = [[0, 0], [1, 1], [1, 0], [0, 1]]'), "edges that cross"),
        ('{ kind = "mesh", file = "none.stl", unit = "mm" }', "does not exist"),
        ('{ kind = "mesh", file = "box.stl", unit = "s" }', "needs one of length"),
        ('{ kind = "mesh", file = "box.stl" }', "shape.unit (line 19): is missing"),
        ('{ kind = "mesh", file = "bad.stl", unit = "m" }', "shape"),
        ('{ kind = "mesh", file = "scene.toml", unit = "m" }', "is none of .stl"),
        ('{ kind = "particles", file = "bad.csv", unit = "m" }', "has no column z"),
        ('{ kind = "particles", file = "twice.csv", unit = "m" }', "two particles at one place"),
    ],
)
def test_faults_of_shapes_are_told(tmp_path, text, words):
    box_file(tmp_path / "box.stl")
    (tmp_path / "bad.stl").write_bytes(b"no surface at all")
    (tmp_path / "bad.csv").write_text("x,y\n0,0\n")
    (tmp_path / "twice.csv").write_text("x,y,z\n0,0,0\n0,0,0\n")
    with pytest.raises(InputError) as caught:
        shape_of(tmp_path, text)
    assert words in str(caught.value) and "fluid.regions.1.shape" in str(caught.value)
