"""Tables of shapes; each mirrors a class of description.py and builds it. Those made of others: composed_tables.py."""

from __future__ import annotations

from typing import Annotated, Literal, Union

from pydantic import Field, model_validator

from distfsi.scene import description
from distfsi.scene.composed_tables import TABLES
from distfsi.scene.values import (
    Direction,
    Length,
    Mirror,
    Position,
    quantity,
)

# ---- shapes ----------------------------------------------------------------------------------------------------------


class Box(Mirror):
    """Axis-parallel box."""

    describes = description.Box
    kind: Literal["box"]
    lower: Position = Field(description="low corner")
    upper: Position = Field(description="high corner")

    @model_validator(mode="after")
    def _ordered(self) -> Box:
        if any(a >= b for a, b in zip(self.lower, self.upper, strict=False)):
            raise ValueError("lower must lie below upper along every axis")
        return self


class Ball(Mirror):
    """Interval, disc or sphere."""

    describes = description.Ball
    kind: Literal["ball"]
    center: Position = Field(description="center")
    radius: Length = Field(description="radius")


class HalfSpace(Mirror):
    """Everything on the side of a plane that its normal points away from."""

    describes = description.HalfSpace
    kind: Literal["half_space"]
    point: Position = Field(description="a point of the plane")
    normal: Direction = Field(description="normal of the plane, pointing out; any length")


class Tube(Mirror):
    """Ring (2D) or spherical shell (3D)."""

    describes = description.Tube
    kind: Literal["tube"]
    center: Position = Field(description="center")
    inner_radius: Length = Field(description="inner radius")
    outer_radius: Length = Field(description="outer radius")

    @model_validator(mode="after")
    def _hollow(self) -> Tube:
        if self.inner_radius >= self.outer_radius:
            raise ValueError("inner_radius must be smaller than outer_radius")
        return self


class Cylinder(Mirror):
    """Cylinder (3D), full or hollow."""

    describes = description.Cylinder
    kind: Literal["cylinder"]
    start: Position = Field(description="where its axis begins")
    end: Position = Field(description="where its axis ends")
    radius: Length = Field(description="radius")
    inner_radius: quantity("m", ge=0.0) = Field(0.0, description="radius of the hole; 0: none")

    @model_validator(mode="after")
    def _has_an_inside(self) -> Cylinder:
        if len(self.start) != 3:
            raise ValueError("a cylinder needs three dimensions; in two it is a ball, hollow a tube")
        if self.start == self.end:
            raise ValueError("start and end must differ")
        if self.inner_radius >= self.radius:
            raise ValueError("inner_radius must be smaller than radius")
        return self


Shape = Annotated[Union[(Box, Ball, HalfSpace, Tube, Cylinder, *TABLES)], Field(discriminator="kind")]  # noqa: UP007
for table in TABLES:
    table.model_rebuild(_types_namespace={"Shape": Shape})
