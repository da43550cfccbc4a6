"""Tables of the input of what burns in the fluid: the detonation of an explosive and the afterburn of its products."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from distfsi.laws.law import Afterburn, Burn
from distfsi.scene import description
from distfsi.scene.law_tables import choice
from distfsi.scene.values import Delay, Direction, Mirror, PhaseName, Position, Table


class PointDetonator(Mirror):
    """A detonator at a point."""

    describes = description.PointDetonator
    kind: Literal["point"]
    position: Position = Field(description="where")
    delay: Delay = Field(0.0, description="when, after the start")


class LineDetonator(Mirror):
    """All points of a line at once: a cord."""

    describes = description.LineDetonator
    kind: Literal["line"]
    start: Position = Field(description="where it begins")
    end: Position = Field(description="where it ends")
    delay: Delay = Field(0.0, description="when, after the start")

    @model_validator(mode="after")
    def _has_length(self) -> LineDetonator:
        if self.start == self.end:
            raise ValueError("start and end must differ")
        return self


class PlaneDetonator(Mirror):
    """All points of a plane at once: a plane wave lens. The fronts run to both sides."""

    describes = description.PlaneDetonator
    kind: Literal["plane"]
    point: Position = Field(description="a point of the plane")
    normal: Direction = Field(description="its normal; any length")
    delay: Delay = Field(0.0, description="when, after the start")


DetonatorInput = Annotated[PointDetonator | LineDetonator | PlaneDetonator, Field(discriminator="kind")]


BurnInput: Any = choice(Burn)
AfterburnInput: Any = choice(Afterburn)


class DetonationInput(Table):
    """The detonation of an explosive, a phase whose equation of state is that of its products. Its regions are given
    unburnt, with the density and the pressure before the detonation; all its energy is in the cells from the start."""

    phase: PhaseName = Field(description="the explosive")
    burn: BurnInput = Field(description="how it burns; what it leaves out is the material's, if the phase names one")
    detonators: tuple[DetonatorInput, ...] = Field(
        min_length=1, description="`[[fluid.detonation.detonators]]`: what lights it; the first front counts"
    )
    path: description.DetonationPath = Field(
        "straight", description='of the fronts; "around": solids and all that is no explosive at the start'
    )


class AfterburnSectionInput(Table):
    """The afterburn of the products of an explosive, a phase."""

    phase: PhaseName = Field(description="the products")
    law: AfterburnInput = Field(description="how they burn")
