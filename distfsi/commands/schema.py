"""Print the JSON schema of the input, with which editors complete and check inputs.

Write it beside a scene and name it in the scene's first line:

  distfsi schema > distfsi.schema.json
  #:schema distfsi.schema.json
"""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The command takes nothing."""


def execute(arguments: argparse.Namespace) -> None:
    """Print the schema."""
    from distfsi.scene.reference import json_schema

    print(json_schema(), end="")
