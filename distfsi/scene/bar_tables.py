"""Tables of bars in a body."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from distfsi.scene.bars import Bars, Bond
from distfsi.scene.values import Density, Fraction, Length, PositivePressure, Table, quantity

AXES = ("x", "y", "z")


class BondInput(Table):
    """How bars slip in concrete (CEB-FIP): shear stress over slip."""

    strength: PositivePressure = Field(description="largest shear stress; of ribbed bars 2.5 MPa sqrt(f_c/MPa)")
    slips: tuple[Length, Length, Length] = Field(
        (1e-3, 2e-3, 5e-3),
        description="slips where it is reached, where it falls, and where it has fallen (distance of ribs)",
    )
    exponent: quantity("1", gt=0.0, le=1.0) = Field(0.4, description="of its rise with the slip")
    residual: Fraction = Field(0.4, description="part that remains")

    @model_validator(mode="after")
    def _falls(self) -> BondInput:
        if not self.slips[0] <= self.slips[1] <= self.slips[2]:
            raise ValueError("slips must grow")
        return self

    def build(self) -> Bond:
        """The bond."""
        return Bond(self.strength, self.slips, self.exponent, self.residual)


class BarsInput(Table):
    """Parallel bars in a body, elastic and plastic; 2D and 3D."""

    diameter: Length = Field(description="of a bar")
    spacing: Length = Field(description="distance of bars; in 2D across the plane")
    cover: Length = Field(description="from the surface to the axis of a bar, at its ends, too")
    directions: tuple[Literal["x", "y", "z"], ...] = Field(min_length=1, description="axes along which bars lie")
    side: Literal["low", "high"] = Field("high", description="near which face of the axis across them")
    density: Density = Field(7850.0, description="density")
    modulus: PositivePressure = Field(200e9, description="Young's modulus")
    yield_stress: PositivePressure = Field(description="yield stress")
    hardening: quantity("Pa", ge=0.0) = Field(0.0, description="rise of the yield stress per plastic strain")
    failure_strain: quantity("1", gt=0.0) = Field(0.1, description="plastic strain at which a bar is torn")
    bond: BondInput | None = Field(None, description="how it slips; default not at all")
    length: Length | None = Field(None, description="about, of an element; default the spacing of the body's particles")

    def build(self, spacing: float) -> Bars:
        """The bars of a body of particles `spacing` [m] apart."""
        return Bars(
            self.diameter,
            self.spacing,
            self.cover,
            tuple(AXES.index(axis) for axis in dict.fromkeys(self.directions)),
            self.side,
            self.density,
            self.modulus,
            self.yield_stress,
            self.hardening,
            self.failure_strain,
            self.bond.build() if self.bond else None,
            self.length or spacing,
        )
