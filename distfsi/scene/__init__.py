"""From an input file to a checked, frozen description of the run."""

from distfsi.scene.loader import load, schema

__all__ = ["load", "schema"]
