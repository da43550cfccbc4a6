"""The command line: one file per command, help that comes at once, examples that travel with the package."""

import re
import shlex
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from distfsi.commands import line
from distfsi.commands.line import COMMANDS, main, parser
from distfsi.commands.study import STUDIES
from distfsi.errors import InputError
from distfsi.scene import load
from distfsi.scene.packing import pack
from distfsi.scene.shipped import examples, shipped_inputs
from launch import ROOT

SHARED = {"__init__", "line", "ranks", "words"}  # by several commands
EXAMPLES = {example.name: example for example in examples()}
HEAVY = ("numpy", "scipy", "numba", "mpi4py", "pydantic", "h5py", "matplotlib")


# ---- commands --------------------------------------------------------------------------------------------------------


def test_each_command_is_a_file():
    assert {path.stem for path in Path(line.__file__).parent.glob("*.py")} == {*COMMANDS} | SHARED


def test_the_console_command_is_the_command_line():
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    module, function = scripts["distfsi"].split(":")
    assert getattr(import_module(module), function) is line.command
    assert len((ROOT / "distfsi" / "__main__.py").read_text().split('"""')[2].strip().splitlines()) == 4


def test_help_imports_nothing_that_computes():
    script = (
        "import sys\n"
        "from distfsi.commands.line import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit: pass\n"
        f"sys.exit(' '.join(name for name in {HEAVY} if name in sys.modules) or 0)\n"
    )
    for words in (["--help"], ["--version"], ["study"], *([name, "--help"] for name in COMMANDS)):
        ended = subprocess.run([sys.executable, "-c", script, *words], cwd=ROOT, capture_output=True, text=True)
        assert ended.stdout and ended.returncode == 0, (words, ended.stderr)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_in_the_help_are_valid(name):
    text = import_module(f"distfsi.commands.{name}").__doc__
    summary, blank = text.splitlines()[:2]
    assert re.fullmatch(r"[A-Z].*\.", summary) and not blank
    shown = re.findall(rf"^  (?:mpiexec -n 4 |mpiexec -n 2 )?distfsi ({name}\b.*)$", text, re.MULTILINE)
    assert shown
    for words in shown:
        words = re.split(r" {3,}| > ", words)[0]  # what follows explains it, or is the shell's
        assert parser().parse_args(shlex.split(words)).execute is import_module(f"distfsi.commands.{name}").execute


def test_the_word_run_may_be_left_out(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit):
        main(["missing.toml"])
    assert "missing.toml: cannot be read" in capsys.readouterr().err


def test_studies_are_listed_and_each_has_a_quick_size(capsys):
    main(["study"])
    assert [text.split("  ")[0] for text in capsys.readouterr().out.splitlines()] == list(STUDIES)
    for name in STUDIES:
        module = import_module(f"distfsi.study.{name.replace(' ', '_')}")
        assert callable(module.main) and callable(module.quick)
    with pytest.raises(InputError, match="no such study"):
        main(["study", "nothing"])


# ---- examples --------------------------------------------------------------------------------------------------------


def test_all_inputs_are_examples(capsys):
    main(["examples"])
    text = capsys.readouterr().out
    assert {*EXAMPLES} == {path.stem for path in (ROOT / "inputs").glob("*.toml")}
    for example in EXAMPLES.values():
        assert f"{example.name:17}{example.description}\n" in text
        assert len(example.description) <= 100 and example.description.endswith(".")
    assert shipped_inputs() == ROOT / "inputs"


def cells_text(scene) -> str:
    return " x ".join(map(str, scene.domain.cells)) + " cells"


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_says_how_large_it_is(name):
    """Cells, particles in all, and a rough time on one core."""
    scene = load(EXAMPLES[name].file)
    bodies = scene.solid.bodies if scene.solid else ()
    count = sum(len(pack(body, scene.domain.lower, scene.domain.upper)[0]) for body in bodies)
    parts = ([cells_text(scene)] if scene.fluid else []) + ([f"{count} particles"] if count else [])
    size, time = EXAMPLES[name].size.split("; ")
    assert size == ", ".join(parts)
    assert re.fullmatch(r"about (a|\d+) (second|seconds|minute|minutes|hour|hours) on one core\.", time)


def test_examples_are_copied(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    main(["examples", "sod"])
    main(["examples", "sod", "panel", "--to", "new/scenes"])
    assert capsys.readouterr().out.split() == ["sod.toml", "new/scenes/sod.toml", "new/scenes/panel.toml"]
    for path in tmp_path.rglob("*.toml"):
        assert load(path) == load(EXAMPLES[path.stem].file)
        assert "#:schema" not in path.read_text()


def test_a_copy_overwrites_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sod.toml").write_text("mine")
    with pytest.raises(InputError) as error:
        main(["examples", "sod", "panle", "noh"])
    assert error.value.faults == ["panle: no such example; did you mean 'panel'?", "sod.toml: exists"]
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]
