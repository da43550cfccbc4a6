"""Tables of shapes, equations of state and strength models; each mirrors a class of description.py and builds it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from distfsi.scene import description
from distfsi.scene.values import (
    Density,
    Direction,
    Fraction,
    Length,
    Mirror,
    Number,
    Position,
    PositiveNumber,
    PositivePressure,
    Pressure,
    Speed,
    Temperature,
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

    @model_validator(mode="after")
    def _has_direction(self) -> HalfSpace:
        if not any(self.normal):
            raise ValueError("normal must not be zero")
        return self


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


Shape = Annotated[Box | Ball | HalfSpace | Tube, Field(discriminator="kind")]


# ---- fluids ----------------------------------------------------------------------------------------------------------


class IdealGas(Mirror):
    """p = (gamma - 1) rho e."""

    describes, word = description.IdealGas, "eos"
    eos: Literal["ideal_gas"]
    gamma: quantity("1", gt=1.0) = Field(description="ratio of specific heats")


class StiffenedGas(Mirror):
    """p = (gamma - 1) rho e - gamma p_inf."""

    describes, word = description.StiffenedGas, "eos"
    eos: Literal["stiffened_gas"]
    gamma: quantity("1", gt=1.0) = Field(description="exponent")
    p_inf: quantity("Pa", ge=0.0) = Field(description="stiffening pressure")


class Jwl(Mirror):
    """Products of an explosive: p = A(1 - w/(R1 v)) exp(-R1 v) + B(1 - w/(R2 v)) exp(-R2 v) + w rho e, v = rho0/rho."""

    describes, word = description.Jwl, "eos"
    eos: Literal["jwl"]
    rho0: Density = Field(description="density of the explosive")
    A: Pressure = Field(description="first coefficient")
    B: Pressure = Field(description="second coefficient")
    R1: PositiveNumber = Field(description="first exponent")
    R2: PositiveNumber = Field(description="second exponent")
    omega: PositiveNumber = Field(description="Grueneisen coefficient w")


PhaseInput = Annotated[IdealGas | StiffenedGas | Jwl, Field(discriminator="eos")]


# ---- solids ----------------------------------------------------------------------------------------------------------


class MieGrueneisen(Mirror):
    """Shock EOS with U = c0 + s1 u (+ s2, s3) and Grueneisen gamma0 + a mu."""

    describes = description.MieGrueneisen
    kind: Literal["mie_grueneisen"]
    c0: Speed = Field(description="bulk sound speed")
    s1: Number = Field(description="slope of the shock speed")
    s2: Number = Field(0.0, description="second coefficient")
    s3: Number = Field(0.0, description="third coefficient")
    gamma0: Number = Field(description="Grueneisen coefficient")
    a: Number = Field(0.0, description="its change with compression")


class LinearEos(Mirror):
    """p = K (rho/rho0 - 1)."""

    describes = description.LinearEos
    kind: Literal["linear"]
    bulk_modulus: PositivePressure = Field(description="bulk modulus K")


class NoStrength(Mirror):
    """No deviatoric stress."""

    describes = description.NoStrength
    kind: Literal["none"]


class Elastic(Mirror):
    """Hooke's law for the deviatoric stress."""

    describes = description.Elastic
    kind: Literal["elastic"]
    shear_modulus: PositivePressure = Field(description="shear modulus G")


class PerfectlyPlastic(Mirror):
    """Elastic up to a constant yield stress."""

    describes = description.PerfectlyPlastic
    kind: Literal["perfectly_plastic"]
    shear_modulus: PositivePressure = Field(description="shear modulus G")
    yield_stress: PositivePressure = Field(description="yield stress")


class JohnsonCook(Mirror):
    """Yield stress (A + B eps^n)(1 + C ln(rate/reference_rate))(1 - T*^m)."""

    describes = description.JohnsonCook
    kind: Literal["johnson_cook"]
    shear_modulus: PositivePressure = Field(description="shear modulus G")
    A: PositivePressure = Field(description="initial yield stress")
    B: quantity("Pa", ge=0.0) = Field(description="hardening modulus")
    n: PositiveNumber = Field(description="hardening exponent")
    C: quantity("1", ge=0.0) = Field(description="rate coefficient")
    m: PositiveNumber = Field(description="exponent of thermal softening (the paper's k)")
    reference_rate: quantity("1/s", gt=0.0) = Field(1.0, description="strain rate at which the rate factor is one")
    room_temperature: Temperature = Field(description="temperature at the start, without softening")
    melt_temperature: Temperature = Field(description="temperature at which no strength is left")
    heat_capacity: quantity("J/(kg K)", gt=0.0) = Field(description="specific heat capacity")
    taylor_quinney: Fraction = Field(0.9, description="share of plastic work that becomes heat")

    @model_validator(mode="after")
    def _melts_above_room(self) -> JohnsonCook:
        if self.melt_temperature <= self.room_temperature:
            raise ValueError("melt_temperature must be above room_temperature")
        return self


SolidEos = Annotated[MieGrueneisen | LinearEos, Field(discriminator="kind")]


def _word_as_table(value: Any) -> Any:
    return {"kind": value} if isinstance(value, str) else value


StrengthTable = Annotated[NoStrength | Elastic | PerfectlyPlastic | JohnsonCook, Field(discriminator="kind")]
Strength = Annotated[
    StrengthTable, BeforeValidator(_word_as_table, json_schema_input_type=StrengthTable | Literal["none"])
]
