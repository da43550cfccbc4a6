"""Tables of the input that may name a material instead of giving all its numbers (scene/materials.py fills them)."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from distfsi.scene.law_tables import PhaseInput


class NamedPhase(BaseModel):
    """A material by its name, as `distfsi materials` lists them. Keys of its equation of state beside the name change
    them."""

    model_config = ConfigDict(extra="allow")

    material: str = Field(description="name of a gas, a liquid or an explosive")


def _without_name(value: Any) -> Any:
    return {key: each for key, each in value.items() if key != "material"} if isinstance(value, dict) else value


NamedPhaseInput = Annotated[PhaseInput, BeforeValidator(_without_name, json_schema_input_type=PhaseInput | NamedPhase)]


def from_material(*keys: str) -> ConfigDict:
    """Of a table, in whose schema `keys` are not needed: a material with a name gives them."""

    def change(schema: dict[str, Any]) -> None:
        schema["required"] = [key for key in schema["required"] if key not in keys]
        schema["from_material"] = [*keys]

    return ConfigDict(json_schema_extra=change)
