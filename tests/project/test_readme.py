"""What the README shows is true."""

import re

from distfsi.scene import load
from launch import ROOT

BLOCKS = dict(re.findall(r"^```(\w+)\n(.*?)^```", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL))


def test_the_two_commands_come_first_and_name_files_and_extras_that_exist():
    run, test = BLOCKS["bash"].splitlines()
    assert run == "pip install -e '.[mpi]' && mpiexec -n 2 python -m distfsi inputs/steel_tube.toml"
    assert test == "pip install -e '.[test]' && pytest"
    assert (ROOT / "inputs" / "steel_tube.toml").exists()


def test_the_input_example_is_valid(tmp_path):
    path = tmp_path / "example.toml"
    path.write_text(BLOCKS["toml"])
    scene = load(path)
    assert [phase.name for phase in scene.fluid.phases] == ["tnt", "air"]
    assert [body.name for body in scene.solid.bodies] == ["block"]
    assert len(BLOCKS["toml"].splitlines()) <= 25
