"""Contracts between parts: what implements a protocol has every member of it, with the same parameters."""

import inspect
import re

import pytest

from distfsi.coupling.cut_cells.cut_cells import CutCells
from distfsi.coupling.immersed_boundary.immersed_boundary import ImmersedBoundary
from distfsi.coupling.protocol import Coupling, ReleasesFluid
from distfsi.device.cpu import Cpu
from distfsi.device.gpu import Gpu, Runtime
from distfsi.device.host import HostRuntime
from distfsi.device.interface import Device
from distfsi.mesh.communicator import Communicator
from distfsi.scene import load
from distfsi.simulation import Simulation
from distfsi.solid.protocol import SolidForm, Structure
from distfsi.solid.solid import Solid
from distfsi.solid.total_lagrangian import TotalLagrangian
from distfsi.solid.updated import UpdatedLagrangian
from launch import ROOT

IMPLEMENTED = [
    (Coupling, CutCells),
    (Coupling, ImmersedBoundary),
    (ReleasesFluid, CutCells),
    (SolidForm, UpdatedLagrangian),
    (SolidForm, TotalLagrangian),
    (Structure, Solid),
    (Device, Cpu),
    (Device, Gpu),
    (Runtime, HostRuntime),
]


def methods_of(protocol):
    """Its methods by name."""
    return {name: member for name, member in vars(protocol).items() if inspect.isfunction(member) and name[0] != "_"}


def attributes_of(protocol):
    """Names of its attributes and properties."""
    properties = {name for name, member in vars(protocol).items() if isinstance(member, property)}
    return properties | set(inspect.get_annotations(protocol))


def parameters_of(function, named):
    """Kind and default of each parameter but self; its name, too, if it is `named`."""
    parameters = [p for p in inspect.signature(function).parameters.values() if p.name != "self"]
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return [
        (p.name if named else None, "positional" if p.kind in positional else p.kind, p.default) for p in parameters
    ]


@pytest.mark.parametrize(("protocol", "kind"), IMPLEMENTED, ids=lambda kind: kind.__name__)
def test_methods_have_the_parameters_of_the_protocol(protocol, kind):
    for name, method in methods_of(protocol).items():
        given = inspect.signature(method).parameters.values()
        named = not any(p.kind is inspect.Parameter.POSITIONAL_ONLY for p in given)
        assert parameters_of(getattr(kind, name), named) == parameters_of(method, named), name


@pytest.mark.parametrize("protocol", dict(IMPLEMENTED), ids=lambda protocol: protocol.__name__)
def test_members_of_a_protocol_are_documented(protocol):
    """Methods and properties where they stand, attributes in the docstring of the class."""
    attributes = inspect.get_annotations(protocol)
    assert not [name for name in attributes if not re.search(rf"\b{name}\b", protocol.__doc__)]
    members = [getattr(protocol, name) for name in {*methods_of(protocol)} | attributes_of(protocol) - set(attributes)]
    assert all(member.__doc__ for member in members)


@pytest.mark.parametrize("scheme", ["cut_cells", "staircase", "immersed_boundary"])
def test_a_coupled_run_has_the_attributes_of_the_protocols(scheme, tmp_path):
    words = ["domain.cells=30", f"coupling.scheme={scheme}", f'output.directory="{tmp_path}"']
    scene = load(ROOT / "inputs/gas_piston.toml", words)
    simulation = Simulation.of(scene, Communicator(), 1)
    simulation.step()
    parts = ((simulation.coupling, Coupling), (simulation.solid, Structure), (simulation.solid.device, Device))
    assert not [name for part, protocol in parts for name in attributes_of(protocol) if not hasattr(part, name)]


def test_a_gpu_has_the_attributes_of_the_protocol():
    assert all(hasattr(Gpu(HostRuntime()), name) for name in attributes_of(Device))
