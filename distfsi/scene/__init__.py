"""From an input file to a checked, frozen description of the run: `load`, and what it will cost: `report`."""

from distfsi.scene.estimate import report
from distfsi.scene.loader import load, schema

__all__ = ["load", "report", "schema"]
