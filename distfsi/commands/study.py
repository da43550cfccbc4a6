"""Compare computations with exact solutions, experiments and other codes.

Without a name: list the studies. A full study takes minutes to hours; --quick takes seconds to a minute and only shows
that the study works. Tables are printed; figures and CSV files go into out/study_NAME.

examples:
  distfsi study
  distfsi study exact cases --quick
  mpiexec -n 2 distfsi study shock_bubble
"""

from __future__ import annotations

import argparse
from importlib import import_module

from distfsi.commands.ranks import reported_once, start_ranks
from distfsi.commands.words import add_overrides
from distfsi.errors import InputError

STUDIES = {  # modules of distfsi.study, with blanks for underscores
    "exact cases": "shock tubes, point blasts and others beside their exact solutions",
    "shock_bubble": "a shock that hits a cylinder of helium beside the experiment",
    "shock_bubble_speed": "time steps per second of the same case at four resolutions",
    "air_blast": "TNT in free air, on the ground and before a wall beside the curves of Kingery and Bulmash",
    "undex_2d": "an underwater explosion in the plane beside a radial computation",
    "undex_sphere": "a charge in water beside radial computations and Cole's similitude, and its bubble",
    "steel_tube": "a steel tube burst by TNT beside one-dimensional computations",
    "steel_tube fragments": "the same with failure: width, thickness and speed of the fragments",
    "tube_alone": "the steel tube under a given pressure: when it fails and into what",
    "fragments": "fragments of an expanding ring against strain rate, beside two theories",
    "liftoff": "a cylinder that a shock lifts off the floor, beside body-fitted meshes",
    "frontier fluid": "error against time of every method of the fluid",
    "frontier solid": "error against time of the forms and viscosities of the solid",
    "frontier coupling": "error against time of the coupling schemes",
    "stability fluid": "where each method of the fluid survives",
    "stability solid": "where each form of the solid survives",
    "stability coupling": "where each coupling scheme survives",
    "kernels": "registers, spills and instructions of each kernel compiled for GPUs; needs NVRTC",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes."""
    parser.add_argument("name", nargs="*", help="which study")
    parser.add_argument("--quick", action="store_true", help="a small size that only shows that the study works")
    add_overrides(parser)


def execute(arguments: argparse.Namespace) -> None:
    """Run the study, or list all."""
    name = " ".join(arguments.name)
    if not name:
        print("\n".join(f"{study:22}{what}" for study, what in STUDIES.items()))
        return
    if name not in STUDIES:
        raise InputError([f"study {name}: no such study; expected one of {', '.join(STUDIES)}"])
    module = import_module(f"distfsi.study.{name.replace(' ', '_')}")
    communicator = start_ranks()
    with reported_once(communicator):
        (module.quick if arguments.quick else module.main)(communicator, arguments.set)
