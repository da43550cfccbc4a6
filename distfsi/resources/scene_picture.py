"""What a scene looks like before it runs: `distfsi check --picture`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from distfsi.narrowing import present
from distfsi.output.scales import scaled
from distfsi.output.sections import Section, draw_sections, draw_view
from distfsi.scene.description import Region, Scene
from distfsi.scene.packing import pack
from distfsi.scene.shapes import bounding_box, contains, distance

AXES = ("x", "y", "z")
PIXELS = 300  # along the longer edge of a section
POINTS = 64  # along the longest edge of the domain, for the regions of a view
BAND = 0.2  # height over length of a scene in one dimension


def draw_scene(scene: Scene, path: Path) -> Iterator[Path]:
    """Draw sections of `scene` into the file `path` and, of one in 3D that has things in it, where vtk is installed, a
    view beside it; the files one by one. Sections lie in the middle of all bodies or, without any, of the domain."""
    domain = scene.domain
    bodies = scene.solid.bodies if scene.solid else ()
    particles = {body.name: pack(body, domain.lower, domain.upper)[0] for body in bodies}
    regions = [_label(scene, region) for region in _regions(scene)]
    planes = [Plane.across(scene, normal) for normal in {1: (1,), 2: (2,), 3: (2, 1, 0)}[domain.dimensions]]
    yield draw_sections(path, scene.title, [_section(scene, plane, particles) for plane in planes], regions)
    shaped = bodies or any(region.shape for region in _regions(scene))
    if domain.dimensions == 3 and shaped and find_spec("vtk") is not None:
        spheres = {body.name: (particles[body.name], body.spacing) for body in bodies}
        view = path.with_name(f"{path.stem}-view{path.suffix}")
        yield draw_view(view, (domain.lower, domain.upper), spheres, list(_surfaces(scene)))


def _regions(scene: Scene) -> tuple[Region, ...]:
    return scene.fluid.regions if scene.fluid else ()


def _label(scene: Scene, region: Region) -> str:
    size, unit = scaled("Pa", abs(region.state.pressure))
    return f"{present(scene.fluid).phases[region.state.phase].name}, {region.state.pressure / size:.4g} {unit}"


def _middle(scene: Scene) -> np.ndarray:
    """(D,) [m]"""
    lower, upper = np.asarray(scene.domain.lower), np.asarray(scene.domain.upper)
    boxes = [bounding_box(body.shape) for body in (scene.solid.bodies if scene.solid else ())]
    if not boxes:
        return 0.5 * (lower + upper)
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    return 0.5 * (np.maximum(low, lower) + np.minimum(high, upper))


@dataclass(frozen=True)
class Plane:
    """A plane through a scene; a band about a scene in one dimension.

    axes    the horizontal and, but in one dimension, the vertical one
    normal  the axis that it lies across, in 3D
    spans   horizontal and vertical, low and high end [m]
    through  (D,) [m] a point of it
    """

    axes: tuple[int, ...]
    normal: int | None
    spans: tuple[tuple[float, float], tuple[float, float]]
    through: np.ndarray

    @classmethod
    def across(cls, scene: Scene, normal: int) -> Plane:
        """The plane across an axis; of fewer than three dimensions all there is."""
        domain, D = scene.domain, scene.domain.dimensions
        axes = tuple(axis for axis in range(D) if axis != normal)
        spans = [(domain.lower[axis], domain.upper[axis]) for axis in axes]
        spans += [(0.0, BAND * (spans[0][1] - spans[0][0]))] * (D == 1)
        return cls(axes, normal if D == 3 else None, (spans[0], spans[1]), _middle(scene))

    def points(self) -> tuple[np.ndarray, tuple[int, int]]:
        """Points (n, D) [m] of a grid on it, and how many rows and columns they have."""
        longest = max(b - a for a, b in self.spans)
        counts = [max(8, math.ceil(PIXELS * (b - a) / longest)) for a, b in self.spans]
        steps = [a + (np.arange(n) + 0.5) * (b - a) / n for (a, b), n in zip(self.spans, counts, strict=True)]
        vertical, horizontal = np.meshgrid(*reversed(steps), indexing="ij")
        points = np.tile(self.through, (vertical.size, 1))
        for axis, values in zip(self.axes, (horizontal, vertical), strict=False):
            points[:, axis] = values.ravel()
        return points, (counts[1], counts[0])

    def flat(self, points: np.ndarray, reach: float = math.inf) -> np.ndarray:
        """Those of `points` (n, D) that are no farther than `reach` [m] from it, on it, (k, 2) [m]."""
        if self.normal is not None:
            points = points[np.abs(points[:, self.normal] - self.through[self.normal]) <= reach]
        columns = [points[:, axis] for axis in self.axes]
        return np.stack([*columns, *[np.full(len(points), np.mean(self.spans[1]))] * (len(columns) == 1)], axis=1)


def _section(scene: Scene, plane: Plane, particles: Mapping[str, np.ndarray]) -> Section:
    points, shape = plane.points()
    bodies = scene.solid.bodies if scene.solid else ()
    region = np.zeros(len(points), dtype=int)
    for number, part in enumerate(_regions(scene)):
        if part.shape is not None:
            region[contains(part.shape, points)] = number
    given = {name: gauge.positions().values() for name, gauge in scene.gauges.items()}
    whole = {name: [list(point.values()) for point in points] for name, points in given.items()}
    return Section(
        tuple(AXES[axis] for axis in plane.axes),
        (*plane.spans[0], *plane.spans[1]),
        "" if plane.normal is None else f"{AXES[plane.normal]} = {plane.through[plane.normal]:.4g} m",
        region.reshape(shape) if scene.fluid else None,
        {body.name: distance(body.shape, points).reshape(shape) for body in bodies},
        {body.name: plane.flat(particles[body.name], 0.5 * body.spacing) for body in bodies},
        {
            name: plane.flat(np.array(points))
            for name, points in whole.items()
            if points and len(points[0]) == scene.domain.dimensions
        },
    )


def _surfaces(scene: Scene) -> Iterator[tuple[int, np.ndarray]]:
    """Number of each region with a shape, and signed distances [m] of a grid over the domain, (z, y, x)."""
    lower, upper = np.asarray(scene.domain.lower), np.asarray(scene.domain.upper)
    counts = np.maximum(np.ceil(POINTS * (upper - lower) / (upper - lower).max()), 4).astype(int)
    axes = [np.linspace(a, b, n) for a, b, n in zip(lower, upper, counts, strict=True)]
    grid = np.meshgrid(*reversed(axes), indexing="ij")
    points = np.stack([g.ravel() for g in reversed(grid)], axis=1)
    for number, region in enumerate(_regions(scene)):
        if region.shape is not None:
            yield number, distance(region.shape, points).reshape(grid[0].shape)
