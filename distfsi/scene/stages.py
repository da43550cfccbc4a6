"""`[[stages]]`: runs of fewer dimensions that come before a scene's own, each the start of the next.

A stage has the phases, the method and the times of the scene, and says itself what is another: its domain, regions,
gauges, and when it ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from distfsi.scene.faults import Path

OF_SPACE = ("regions", "inflow", "map", "detonation")  # what the fluid of another domain says anew
OF_RUN = ("maximum_steps", "front")  # what a stage does not take over of when the scene's run ends
OUTPUT = ("history_every", "hdf5", "restart_every")  # what a stage takes over of where results go


def stage_inputs(data: dict[str, Any], stem: str) -> list[dict[str, Any]]:
    """The whole inputs of the stages of an input, which gets the last one to go on from. Empty where a table is none:
    validation tells that."""
    stages, fluid = data.get("stages"), data.get("fluid")
    if not stages or not isinstance(stages, list) or not isinstance(fluid, dict):
        return []
    if not all(isinstance(stage, dict) for stage in stages):
        return []
    output = data.get("output", {})
    tables = [output, data.get("time", {}), fluid.get("map", {})]
    tables += [stage.get(key, {}) for stage in stages for key in ("time", "map")]
    if not all(isinstance(table, dict) for table in tables):
        return []
    directory = output.get("directory") or f"out/{stem}"
    before, inputs = None, []
    for number, stage in enumerate(stages, 1):
        own = f"{directory}-stage-{number}"
        inputs.append(_input(data, stage, number, own, before))
        before = own
    fluid["map"] = {"run": before} | fluid.get("map", {})
    return inputs


def _input(
    data: Mapping[str, Any], stage: Mapping[str, Any], number: int, directory: str, before: str | None
) -> dict[str, Any]:
    fluid = {key: value for key, value in data["fluid"].items() if key not in OF_SPACE}
    if "regions" in stage:
        fluid["regions"] = stage["regions"]
    if isinstance(data["fluid"].get("detonation"), dict):
        fluid["detonation"] = data["fluid"]["detonation"] | {"detonators": stage.get("detonators", ())}
    if before is not None:
        fluid["map"] = {"run": before} | stage.get("map", {})
    output = {key: value for key, value in data.get("output", {}).items() if key in OUTPUT}
    given = {
        "title": f"{data.get('title', '')} (stage {number})".lstrip(),
        "time": {key: value for key, value in data.get("time", {}).items() if key not in OF_RUN}
        | stage.get("time", {}),
        "fluid": fluid,
        "output": output | {"directory": directory},
    }
    return deepcopy(given | {key: stage[key] for key in ("domain", "gauges") if key in stage})


def path_in_stage(number: int, path: Path) -> Path:
    """Where a key of a stage's whole input stands in the scene's."""
    match path:
        case ("fluid", "detonation", "detonators", *rest):
            return ("stages", number, "detonators", *rest)
        case ("fluid", ("regions" | "map") as key, *rest):
            return ("stages", number, key, *rest)
        case (("domain" | "time" | "gauges") as key, *rest):
            return ("stages", number, key, *rest)
    return ("stages", number)
