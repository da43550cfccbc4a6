"""Where compiled modules are kept, and how they are found again."""

import subprocess
import sys

import pytest

import emitted
from distfsi.device import cpu
from distfsi.device.fingerprint import fingerprint
from distfsi.device.llvm_types import Array
from distfsi.device.native import Native
from distfsi.device.source import Bound
from emitted import constants_are_folded, cubed, exponentials_of, material, scaled, text_of, two_materials
from launch import ROOT, SUPPORT


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path_factory.getbasetemp() / "kernels"))


def test_the_module_is_named_by_its_text():
    names = [Native(scaled, {"GAMMA": gamma}, {}, "float64").module.__name__ for gamma in (1.4, 1.4, 1.5, 0.0)]
    assert names[0] == names[1] == names[2] != names[3]
    assert Native(scaled, {"GAMMA": 1.4}, {}, "float32").module.__name__ != names[0]


def test_the_text_names_the_source():
    text = text_of(material, {"GAMMA": 1.4})
    for function in (material, scaled):
        place = f"; emitted.py, line {function.__code__.co_firstlineno}\n"
        assert f"{place}define internal double @{function.__name__}.0(" in text


def test_two_scenes_live_side_by_side():
    """What a scene measures is given to one module at run time; a number that is 0 is folded away."""
    assert text_of(scaled, {"GAMMA": 1.4}) == text_of(scaled, {"GAMMA": 1.5}) != text_of(scaled, {"GAMMA": 0.0})
    values = [cpu.build([scaled], {"GAMMA": gamma}).scaled(1.0) for gamma in (1.4, 1.5, 1.4)]
    assert values == [1.4, 1.5, 1.4]


def test_a_text_made_before_is_found_without_folding(monkeypatch):
    assert cpu.build([scaled], {"GAMMA": 1.25}).scaled(2.0) == 2.5
    monkeypatch.setattr(Native, "_module_text", None)
    assert cpu.build([scaled], {"GAMMA": 1.25, "N": 3}).scaled(2.0) == 2.5


def test_the_fingerprint_tells_all_that_a_text_depends_on(monkeypatch):
    first, second = Bound(material, {"GAMMA": 3.0}), Bound(scaled, {"GAMMA": 5.0})
    bindings = {"first_material": first, "second_material": second}
    before = fingerprint(two_materials, {"GAMMA": 1.0}, bindings, "float64")
    other_number = bindings | {"first_material": Bound(material, {"GAMMA": 4.0})}
    assert before == fingerprint(two_materials, {"GAMMA": 1.0}, other_number, "float64")
    assert before == fingerprint(two_materials, {"GAMMA": 2.0, "N": 2}, bindings, "float64")  # neither is looked at
    others = [
        fingerprint(two_materials, {}, bindings | {"first_material": Bound(material, {"GAMMA": 0.0})}, "float64"),
        fingerprint(two_materials, {"GAMMA": 1.0}, bindings, "float32"),
        fingerprint(two_materials, {"GAMMA": 1.0}, bindings | {"first_material": second}, "float64"),
        fingerprint(two_materials, {"GAMMA": 1.0}, bindings | {"second_material": Bound(scaled)}, "float64"),
    ]
    monkeypatch.setattr(emitted, "scaled", cubed)  # which `material` calls
    others.append(fingerprint(two_materials, {"GAMMA": 1.0}, bindings, "float64"))
    plain_number = fingerprint(constants_are_folded, {}, {}, "float64")
    monkeypatch.setattr(emitted, "HALF", 0.25)
    assert len({before, *others}) == 1 + len(others)
    assert fingerprint(constants_are_folded, {}, {}, "float64") != plain_number


PROGRAM = """
import sys
import numpy as np
from distfsi.device import cpu
from distfsi.device.native import compilation
from emitted import exponentials_of
B = np.zeros(1)
cpu.build([exponentials_of], {}).exponentials_of(np.zeros(1), B)
print(B[0], compilation.made)
"""


def test_a_second_process_finds_the_compiled_module(tmp_path, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}:{SUPPORT}")
    runs = [
        subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=120, check=True).stdout
        for _ in range(2)
    ]
    assert [run.split() for run in runs] == [["1.0", "1"], ["1.0", "0"]]
    assert len(list(tmp_path.glob("exponentials_of_*.py"))) == 1


def test_bodies_of_other_types_have_other_names_in_every_process():
    """Processes leave machine code for each other; what is called alike there would be taken for one function."""
    kernel = Native(exponentials_of, {}, {}, "float64")
    doubles, floats = ((Array(element, 1),) * 2 for element in ("float64", "float32"))
    names = [kernel.body(types)[0] for types in (doubles, floats, doubles)]
    assert names[0] == names[2] != names[1]
