"""Tables of rigid parts: obstacles, which stand or go as told, and rigid bodies, which forces move."""

from __future__ import annotations

import itertools

import numpy as np
from pydantic import Field, model_validator

from distfsi.scene import description
from distfsi.scene.mirrors import Shape
from distfsi.scene.values import (
    Density,
    Direction,
    Length,
    Position,
    PositivePressure,
    Table,
    Velocity,
    quantity,
    turn,
    vector,
)


class MotionInput(Table):
    """How an obstacle goes over time: a table, between whose rows speeds are constant; then it stands."""

    times: tuple[quantity("s", ge=0.0), ...] = Field(min_length=2, description="times of the rows, the first 0")
    displacements: tuple[Position, ...] | None = Field(None, description="how far it has gone then; default not at all")
    angles: tuple[quantity("rad"), ...] | None = Field(None, description="how far it has turned; default not at all")
    about: Position | None = Field(None, description="a point of the axis at the start; default the origin")
    axis: Direction | None = Field(None, description="direction of the axis; 3D only, and needed there to turn")

    @model_validator(mode="after")
    def _whole(self) -> MotionInput:
        rows = len(self.times)
        if self.times[0] != 0.0 or any(a >= b for a, b in itertools.pairwise(self.times)):
            raise ValueError("times must begin with 0 and grow")
        for name in ("displacements", "angles"):
            given = getattr(self, name)
            if given is not None and len(given) != rows:
                raise ValueError(f"{name} has {len(given)} rows, times {rows}")
            if given is not None and np.any(np.asarray(given[0])):
                raise ValueError(f"{name} must begin with 0: the shape is where the obstacle is at the start")
        return self


class ObstacleInput(Table):
    """A rigid part that no force moves: it stands or goes as told, and costs no steps of particles."""

    shape: Shape = Field(description="what it fills; a half_space is cut to the domain")
    spacing: Length = Field(description="distance between the points of its wall; at most 0.75 of a cell, better 0.5")
    packing: description.Packing | None = Field(None, description="as of a body")
    motion: MotionInput | None = Field(None, description="how it goes; default it stands")


class SupportInput(Table):
    """A spring and a dashpot between the ground and a point of a rigid body, along each axis; a bolt is one
    that fails."""

    at: Position | None = Field(None, description="the point at the start; default the center of mass")
    stiffness: vector("N/m") | None = Field(None, description="force per displacement along each axis; default none")
    damping: vector("N s/m") | None = Field(None, description="force per velocity along each axis; default none")
    strength: quantity("N", gt=0.0) | None = Field(
        None, description="when its force has once exceeded this it is gone; default it holds"
    )


class RigidInput(Table):
    """A rigid body that forces move: of the fluid, of gravity, of what it meets, of its supports."""

    shape: Shape = Field(description="what it fills")
    spacing: Length = Field(description="distance between the points of its wall; at most 0.75 of a cell, better 0.5")
    packing: description.Packing | None = Field(None, description="as of a body")
    density: Density | None = Field(None, description="mean density; or give its mass")
    mass: quantity("kg", gt=0.0) | None = Field(None, description="mass, in 1D and 2D per area or length")
    inertia: turn("kg m2") | None = Field(
        None, description="moments of inertia: in 2D one, in 3D about x, y and z; default those of the shape"
    )
    velocity: Velocity | None = Field(None, description="initial velocity of the center of mass; default at rest")
    spin: turn("rad/s") | None = Field(
        None, description="initial angular velocity: in 2D a number, in 3D a vector; default 0"
    )
    modulus: PositivePressure | None = Field(
        None,
        description="how stiffly it meets other bodies and walls; default as the stiffest body that deforms, or a "
        "hundred times the highest pressure of the fluid at the start",
    )
    supports: tuple[SupportInput, ...] = Field(
        (), description="`[[solid.rigid.NAME.supports]]`: springs, dashpots, bolts"
    )

    @model_validator(mode="after")
    def _weighs_something(self) -> RigidInput:
        if (self.density is None) == (self.mass is None):
            raise ValueError("expected `density` or `mass`, one of them")
        return self
