"""Tables of shapes that are made of others or read from files; scene/mirrors.py knows all shapes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, PrivateAttr, ValidationInfo, WrapValidator, model_validator

from distfsi.scene import composed, description
from distfsi.scene.cloud import Cloud
from distfsi.scene.composed import Similarity, placed
from distfsi.scene.sections import Polygon as PolygonShape
from distfsi.scene.sections import extruded, revolved
from distfsi.scene.shapes import dimensions, support
from distfsi.scene.surface import Mesh
from distfsi.scene.turns import reflection, rotation
from distfsi.scene.values import Count, Direction, Length, Position, Table, quantity

if TYPE_CHECKING:
    from distfsi.scene.mirrors import Shape

Axis = Literal["x", "y", "z"]
AXES = ("x", "y", "z")


class Composed(Table):
    """A table from which `build` makes a shape; what is wrong with that is a fault of the table."""

    kind: str

    @model_validator(mode="after")
    def _checked(self, info: ValidationInfo) -> Self:
        given, wanted = dimensions(self.build()), (info.context or {}).get("dimensions")
        if wanted not in (None, given):
            raise ValueError(f"'{self.kind}' has {given} dimensions here, needs {wanted}")
        return self

    def build(self) -> description.Shape:
        """The shape. Raises ValueError."""
        raise NotImplementedError


def _in_a_plane(value: Any, handler: Callable[[Any], Any], info: ValidationInfo) -> Any:
    """Vectors of a section have two entries, whatever the domain has."""
    context = info.context if info.context is not None else {}
    domain = context.get("dimensions")
    context["dimensions"] = 2
    try:
        return handler(value)
    finally:
        context["dimensions"] = domain


Section = Annotated["Shape", WrapValidator(_in_a_plane)]


def _needs(shape: description.Shape, count: int, what: str) -> None:
    if dimensions(shape) != count:
        raise ValueError(f"{what} needs {count} dimensions")


# ---- sets ------------------------------------------------------------------------------------------------------------


class Union(Composed):
    """What lies in any of some shapes."""

    kind: Literal["union"]
    shapes: tuple[Shape, ...] = Field(min_length=1, description="the shapes")

    def build(self) -> description.Shape:
        return composed.Union(tuple(shape.build() for shape in self.shapes))


class Intersection(Composed):
    """What lies in all of some shapes."""

    kind: Literal["intersection"]
    shapes: tuple[Shape, ...] = Field(min_length=1, description="the shapes")

    def build(self) -> description.Shape:
        return composed.Intersection(tuple(shape.build() for shape in self.shapes))


class Difference(Composed):
    """A shape without others."""

    kind: Literal["difference"]
    shape: Shape = Field(description="the whole")
    removed: tuple[Shape, ...] = Field(min_length=1, description="what is taken away from it")

    def build(self) -> description.Shape:
        return composed.Difference(self.shape.build(), tuple(shape.build() for shape in self.removed))


# ---- motions and copies ----------------------------------------------------------------------------------------------


class Translate(Composed):
    """A shape moved."""

    kind: Literal["translate"]
    shape: Shape = Field(description="the shape")
    by: Position = Field(description="how far")

    def build(self) -> description.Shape:
        shape = self.shape.build()
        return placed(shape, _shift(dimensions(shape), self.by))


def _shift(dimensions: int, by: Sequence[float]) -> Similarity:
    return Similarity(tuple(map(tuple, np.eye(dimensions).tolist())), tuple(by))


class Rotate(Composed):
    """A shape turned, in 2D or 3D."""

    kind: Literal["rotate"]
    shape: Shape = Field(description="the shape")
    angle: quantity("rad") = Field(description="counterclockwise, seen from the tip of the axis")
    axis: Direction | None = Field(None, description="direction of the axis; 3D only, and needed there")
    about: Position | None = Field(None, description="a point that stays where it is; default the origin")

    def build(self) -> description.Shape:
        return _turned(self.shape.build(), self.angle, self.axis, self.about)


def _turned(
    shape: description.Shape, angle: float, axis: Sequence[float] | None, about: Sequence[float] | None
) -> description.Shape:
    D = dimensions(shape)
    if D == 1:
        raise ValueError("nothing turns in one dimension")
    if (axis is None) != (D == 2):
        raise ValueError("an axis is needed" if D == 3 else "there is no axis in two dimensions")
    return placed(shape, Similarity.about(about or (0.0,) * D, rotation(D, angle, axis or ())))


class Scale(Composed):
    """A shape made larger or smaller."""

    kind: Literal["scale"]
    shape: Shape = Field(description="the shape")
    factor: quantity("1", gt=0.0) = Field(description="new size over old size")
    about: Position | None = Field(None, description="a point that stays where it is; default the origin")

    def build(self) -> description.Shape:
        shape = self.shape.build()
        D = dimensions(shape)
        return placed(shape, Similarity.about(self.about or (0.0,) * D, np.eye(D), self.factor))


class Mirror(Composed):
    """The mirror image of a shape at a plane; with `union` both are there."""

    kind: Literal["mirror"]
    shape: Shape = Field(description="the shape")
    point: Position = Field(description="a point of the plane")
    normal: Direction = Field(description="normal of the plane, of any length")

    def build(self) -> description.Shape:
        return placed(self.shape.build(), Similarity.about(self.point, reflection(self.normal)))


class LinePattern(Composed):
    """Copies of a shape along a line."""

    kind: Literal["line_pattern"]
    shape: Shape = Field(description="the first one")
    count: Count = Field(description="how many in all")
    step: Position = Field(description="from each to the next")

    def build(self) -> description.Shape:
        shape = self.shape.build()
        steps = (_shift(dimensions(shape), [n * s for s in self.step]) for n in range(self.count))
        return composed.Union(tuple(placed(shape, step) for step in steps))


class CirclePattern(Composed):
    """Copies of a shape around an axis, each turned with its place; 2D or 3D."""

    kind: Literal["circle_pattern"]
    shape: Shape = Field(description="the first one")
    count: Count = Field(description="how many in all")
    center: Position = Field(description="center, or a point of the axis")
    axis: Direction | None = Field(None, description="direction of the axis; 3D only, and needed there")
    step: quantity("rad") | None = Field(None, description="angle from each to the next; default all around")

    def build(self) -> description.Shape:
        shape, step = self.shape.build(), 2.0 * math.pi / self.count if self.step is None else self.step
        return composed.Union(tuple(_turned(shape, n * step, self.axis, self.center) for n in range(self.count)))


# ---- sections --------------------------------------------------------------------------------------------------------


class Polygon(Composed):
    """Polygon, in 2D and as a section."""

    kind: Literal["polygon"]
    points: tuple[Position, ...] = Field(min_length=3, description="its corners, in order around it")

    def build(self) -> description.Shape:
        if any(len(point) != 2 for point in self.points):
            raise ValueError("a polygon needs two dimensions; in three it is a section of `extrude` or `revolve`")
        polygon = PolygonShape(self.points)
        if any(a == b for a, b in polygon.edges()):
            raise ValueError("has two corners at one place, one after the other")
        if polygon.crosses_itself():
            raise ValueError("has edges that cross")
        return polygon


class Extrude(Composed):
    """A section drawn out along an axis (3D)."""

    kind: Literal["extrude"]
    section: Section = Field(description="shape in 2D: in the plane of the other two axes, in their order")
    axis: Axis = Field(description="along which it is drawn out")
    lower: quantity("m") = Field(description="where it begins on the axis")
    upper: quantity("m") = Field(description="where it ends")

    def build(self) -> description.Shape:
        if self.lower >= self.upper:
            raise ValueError("lower must lie below upper")
        section = self.section.build()
        _needs(section, 2, "a section")
        return extruded(section, AXES.index(self.axis), self.lower, self.upper)


class Revolve(Composed):
    """A section turned about an axis (3D)."""

    kind: Literal["revolve"]
    section: Section = Field(
        description="shape in 2D: distance from the axis, and height above `center` along it; what lies at negative "
        "distances is cut off"
    )
    axis: Axis = Field(description="direction of the axis")
    center: Position = Field(description="a point of the axis")

    def build(self) -> description.Shape:
        section = self.section.build()
        _needs(section, 2, "a section")
        if len(self.center) != 3:
            raise ValueError("needs three dimensions")
        if support(section, np.array([1.0, 0.0])) <= 0.0:
            raise ValueError("no part of the section lies at positive distances from the axis")
        return revolved(section, AXES.index(self.axis), self.center)


# ---- files -----------------------------------------------------------------------------------------------------------


def _beside_the_input(value: str, info: ValidationInfo) -> str:
    return str(Path((info.context or {}).get("folder", "")) / value)


FileName = Annotated[str, AfterValidator(_beside_the_input)]
Unit = Annotated[
    str, Field(description='unit of its lengths, which the file itself does not know: "m", "mm", "in" ...')
]


class MeshFile(Composed):
    """The inside of a closed surface of triangles (3D)."""

    kind: Literal["mesh"]
    file: FileName = Field(description="STL, OBJ or PLY; a relative path counts from the input's folder")
    unit: Unit

    def build(self) -> description.Shape:
        mesh = Mesh(self.file, self.unit)
        if mesh.volume() <= 0.0:  # reads it
            raise ValueError(f"'{self.file}' has no inside")
        return mesh


class ParticleFile(Composed):
    """Particles given one by one; as a region they are cubes."""

    kind: Literal["particles"]
    file: FileName = Field(
        description="CSV with columns x, y, z and, if it knows them, volume; or points of VTK (.vtk .vtu .vtp "
        ".vtkhdf), which needs the package vtk; a relative path counts from the input's folder"
    )
    unit: Unit
    spacing: Length | None = Field(
        None, description="width of their cubes; default the middle one of all distances to nearest neighbours"
    )
    _coordinates: int = PrivateAttr(3)

    @model_validator(mode="after")
    def _checked(self, info: ValidationInfo) -> Self:
        self._coordinates = (info.context or {}).get("dimensions") or 3
        self.build()
        return self

    def build(self) -> description.Shape:
        cloud = Cloud(self.file, self.unit, self.spacing, self._coordinates)
        cloud.volume()  # reads it
        return cloud


TABLES = (
    *(Union, Intersection, Difference),
    *(Translate, Rotate, Scale, Mirror, LinePattern, CirclePattern),
    *(Polygon, Extrude, Revolve),
    *(MeshFile, ParticleFile),
)
