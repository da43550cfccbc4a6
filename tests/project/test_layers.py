"""The architecture as a test: who may import whom, and what lies at the top of the repository (ARCHITECTURE.md)."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from launch import ROOT

PACKAGE = ROOT / "distfsi"

# From the top down. A folder imports only from those further down; those of one row do not know each other.
LAYERS = (
    {"__main__"},
    {"api"},
    {"commands"},
    {"study", "report"},
    {"resources"},
    {"execution", "sweep"},
    {"simulation", "direct", "memory", "results"},
    {"step", "diagnostics"},
    {"coupling"},
    {"fluid", "solid"},
    {"mesh", "device", "output", "scene"},
    {"gauges", "coordinates"},
    {"laws"},
    {"formulas"},
    {"air_blast", "errors", "interrupts", "narrowing", "__init__"},
)
DEPTH = {name: depth for depth, names in enumerate(LAYERS) for name in names}
ACROSS = {"mesh": "distfsi.device.interface"}

# Inside a folder, at any depth, formulas know formulas and laws only, and kernels these, kernels and their markers.
FORMULAS = ("formulas", "laws")
KERNELS = (*FORMULAS, "kernels")

# What laws are made of, besides: dataclasses with types, found by their files.
LAWS = {"__future__", "collections", "dataclasses", "functools", "importlib", "pkgutil", "typing"}

ONLY_IN = {
    "numba": "device",
    "llvmlite": "device",
    "cupy": "device",
    "mpi4py": "mesh",
    "h5py": "output",
    "matplotlib": "output",
}

TOP_LEVEL = {
    "pyproject.toml", "distfsi", "launch", "tests", "inputs", "README.md", "ARCHITECTURE.md", "docs", ".ci", "LICENSE",
    "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", ".gitignore", ".pre-commit-config.yaml",
}  # fmt: skip


def layer_of(path: Path) -> str:
    """The folder of the package that a file is in, or its own name if it lies at the package's top."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def kind_of(path: Path) -> str:
    """What a file holds: "formulas", "kernels", or "parts" of a simulation and all else."""
    folder, *inner = (word.removesuffix(".py") for word in path.relative_to(PACKAGE).parts)
    words = {folder, *inner} if folder != "study" else set()
    return "formulas" if words & {*FORMULAS} else "kernels" if "kernels" in words else "parts"


def imports_of(path: Path) -> set[str]:
    """Full dotted names of all that a file imports, at any depth of its text."""
    package = path.relative_to(ROOT).parent.parts
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) + 1 - node.level] if node.level else ()
            module = [*start, *([node.module] if node.module else [])]
            names.update(".".join([*module, alias.name]) for alias in node.names)
    return names


def allowed(layer: str, kind: str, name: str) -> bool:
    """Whether files of a `kind` in a `layer` may import `name`."""
    top, *inner = name.split(".")
    if top != "distfsi":
        if kind == "parts":
            return ONLY_IN.get(top, layer) == layer
        return top in ("math", "typing") or (layer == "laws" and top in LAWS)
    if kind == "formulas" and not {*FORMULAS} & {*inner}:
        return False
    if kind == "kernels" and not {*KERNELS} & {*inner}:
        return inner[:2] == ["device", "markers"]
    target = inner[0] if inner and inner[0] in DEPTH else "__init__"
    across = ACROSS.get(layer)
    return target == layer or DEPTH[target] > DEPTH[layer] or (across is not None and name.startswith(across))


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_imports_only_from_the_layers_below(path):
    layer, kind = layer_of(path), kind_of(path)
    assert layer in DEPTH
    assert not {name for name in imports_of(path) if not allowed(layer, kind, name)}


@pytest.mark.parametrize(
    ("layer", "kind", "name", "verdict"),
    [
        ("simulation", "parts", "distfsi.fluid.fluid.Fluid", True),
        ("fluid", "parts", "distfsi.simulation", False),
        ("fluid", "parts", "distfsi.solid.solid.Solid", False),
        ("coupling", "parts", "distfsi.solid.solid.Solid", True),
        ("coupling", "kernels", "distfsi.fluid.kernels.stage.advance_tiles", True),
        ("coupling", "kernels", "distfsi.fluid.fluid.Fluid", False),
        ("solid", "kernels", "distfsi.fluid.kernels.stage.advance_tiles", False),
        ("fluid", "kernels", "distfsi.device.markers.row", True),
        ("fluid", "kernels", "distfsi.device.cpu", False),
        ("fluid", "kernels", "numpy", False),
        ("mesh", "parts", "distfsi.errors.InputError", True),
        ("mesh", "parts", "mpi4py.MPI", True),
        ("fluid", "parts", "mpi4py.MPI", False),
        ("fluid", "formulas", "math.sqrt", True),
        ("mesh", "kernels", "typing.NamedTuple", True),
        ("fluid", "formulas", "numpy", False),
        ("fluid", "formulas", "distfsi.errors", False),
        ("fluid", "formulas", "distfsi.fluid.kernels.stage.advance_tiles", False),
        ("laws", "formulas", "distfsi.formulas.tensors.dot", True),
        ("laws", "formulas", "dataclasses.dataclass", True),
        ("laws", "formulas", "numpy", False),
        ("laws", "formulas", "distfsi.scene.description", False),
        ("fluid", "formulas", "dataclasses.dataclass", False),
    ],
)
def test_the_layer_table(layer, kind, name, verdict):
    assert allowed(layer, kind, name) is verdict


def test_the_top_of_the_repository_holds_what_the_architecture_says():
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    present = {name.split("/")[0] for name in listed if (ROOT / name).exists()}
    assert present <= TOP_LEVEL


def test_a_run_starts_without_what_it_may_not_need():
    """Each takes a third of a second: pictures are drawn at the end, and few scenes need an equation solved."""
    program = "import sys, distfsi.execution; print(*{'matplotlib', 'scipy', 'vtk', 'cupy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, cwd=ROOT)
    assert (done.returncode, done.stdout.split()) == (0, []), done.stderr
