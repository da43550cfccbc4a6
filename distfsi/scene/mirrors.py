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


Shape = Annotated[Box | Ball | HalfSpace | Tube | Cylinder, Field(discriminator="kind")]


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


class Compaction(Mirror):
    """Concrete, with strength `concrete`: elastic to the crush point, pores closing up to the lock pressure, then dense
    with p = K1 x + K2 x^2 + K3 x^3, x = (rho/rho0 - 1 - lock_strain)/(1 + lock_strain)."""

    describes = description.Compaction
    kind: Literal["compaction"]
    crush_pressure: PositivePressure = Field(description="pressure at which pores begin to close")
    crush_strain: PositiveNumber = Field(description="rho/rho0 - 1 there")
    lock_pressure: PositivePressure = Field(description="pressure at which all pores are closed")
    lock_strain: PositiveNumber = Field(description="rho/rho0 - 1 of the material without pores, at no pressure")
    K1: PositivePressure = Field(description="dense material, first coefficient")
    K2: Pressure = Field(description="second")
    K3: Pressure = Field(description="third")

    @model_validator(mode="after")
    def _crushes_before_it_locks(self) -> Compaction:
        if self.crush_pressure >= self.lock_pressure or self.crush_strain >= self.lock_strain:
            raise ValueError("the crush point must lie below the lock point")
        return self


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


class LinearHardening(Mirror):
    """Yield stress that grows linearly with the plastic strain."""

    describes = description.LinearHardening
    kind: Literal["linear_hardening"]
    shear_modulus: PositivePressure = Field(description="shear modulus G")
    yield_stress: PositivePressure = Field(description="initial yield stress")
    hardening_modulus: quantity("Pa", ge=0.0) = Field(description="its growth with plastic strain")


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


class Concrete(Mirror):
    """Concrete of Holmquist, Johnson & Cook: yield at f_c (A (1 - wear) + B p*^N)(1 + C ln(rate/reference_rate)), at
    most cap f_c. It needs the eos `compaction`; cracks in tension come from a `failure`."""

    describes = description.Concrete
    kind: Literal["concrete"]
    shear_modulus: PositivePressure = Field(description="shear modulus G")
    compressive_strength: PositivePressure = Field(description="uniaxial compressive strength f_c")
    tensile_strength: PositivePressure = Field(description="largest tension T; a `failure` takes its place")
    A: quantity("1", ge=0.0) = Field(description="cohesion")
    B: quantity("1", ge=0.0) = Field(description="hardening by pressure p* = p/f_c")
    N: PositiveNumber = Field(description="its exponent")
    C: quantity("1", ge=0.0) = Field(description="rate coefficient")
    cap: PositiveNumber = Field(7.0, description="largest strength over f_c")
    D1: PositiveNumber = Field(description="wear: failure strain D1 (p* + T*)^D2")
    D2: quantity("1", ge=0.0) = Field(1.0, description="its exponent")
    least_failure_strain: PositiveNumber = Field(description="and its floor")
    reference_rate: quantity("1/s", gt=0.0) = Field(1.0, description="strain rate at which the rate factor is one")


# ---- failure ---------------------------------------------------------------------------------------------------------


class Scatter(Mirror):
    """Weibull's scatter of the failure strain and stress from particle to particle; larger ones fail earlier."""

    describes = description.Scatter
    modulus: PositiveNumber = Field(description="Weibull modulus: the larger, the less scatter")
    size: Length = Field(description="edge of a piece (square, cube) that has the given values on average")
    seed: Annotated[int, Field(strict=True, ge=0)] = Field(0, description="chooses one of the possible specimens")


Energy = quantity("J/m2", ge=0.0)
FRACTURE = "energy that a crack takes per area, at any spacing; 0: failure at once"


class JohnsonCookFailure(Mirror):
    """Fracture strain (D1 + D2 exp(D3 eta))(1 + D4 ln(rate/reference_rate))(1 + D5 T*), eta = mean/von Mises stress."""

    describes = description.JohnsonCookFailure
    kind: Literal["johnson_cook"]
    D1: Number = Field(description="fracture strain at large tension")
    D2: Number = Field(description="its growth towards compression")
    D3: Number = Field(description="exponent; negative, tension positive")
    D4: Number = Field(0.0, description="rate coefficient")
    D5: Number = Field(0.0, description="temperature coefficient")
    reference_rate: quantity("1/s", gt=0.0) = Field(1.0, description="strain rate at which the rate factor is one")
    spall_strength: PositivePressure | None = Field(None, description="principal stress that also breaks it")
    fracture_energy: Energy = Field(0.0, description=FRACTURE)
    scatter: Scatter | None = Field(None, description="Weibull's scatter; default none")


class PrincipalStress(Mirror):
    """A crack opens where the largest principal stress reaches the tensile strength."""

    describes = description.PrincipalStress
    kind: Literal["principal_stress"]
    tensile_strength: PositivePressure = Field(description="principal stress that breaks it")
    fracture_energy: Energy = Field(0.0, description=FRACTURE)
    scatter: Scatter | None = Field(None, description="Weibull's scatter; default none")


Failure = Annotated[JohnsonCookFailure | PrincipalStress, Field(discriminator="kind")]
SolidEos = Annotated[MieGrueneisen | LinearEos | Compaction, Field(discriminator="kind")]


def _word_as_table(value: Any) -> Any:
    return {"kind": value} if isinstance(value, str) else value


StrengthTable = Annotated[
    NoStrength | Elastic | PerfectlyPlastic | LinearHardening | JohnsonCook | Concrete, Field(discriminator="kind")
]
Strength = Annotated[
    StrengthTable, BeforeValidator(_word_as_table, json_schema_input_type=StrengthTable | Literal["none"])
]
