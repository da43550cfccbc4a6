"""Damaged and hostile restart files are refused with the reason, before anything is touched, or give the same bits."""

from __future__ import annotations

import shutil
from hashlib import sha256
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from distfsi.errors import InputError
from distfsi.execution import run
from distfsi.mesh.communicator import Communicator
from distfsi.output.checksum import BYTES, add_checksum
from distfsi.output.restart import Restart
from distfsi.scene import load
from launch import ROOT
from results import results

SCENE = ROOT / "inputs" / "gas_piston.toml"
TINY = ("domain.cells=32", "output.restart_every=1 ns", "output.fields_every=0", "output.history_every=1")
FLIPS, HOSTILE = 200, 60


def go(directory: Path, steps: int, restart: str | None = None) -> None:
    """Run the scene, with a restart file after each step."""
    settings = (*TINY, f"output.directory={directory}", f"time.maximum_steps={steps}")
    run(load(SCENE, settings), Communicator(), 1, restart)


@pytest.fixture(scope="module")
def origin(tmp_path_factory):
    """The directory of a run of three steps."""
    directory = tmp_path_factory.mktemp("origin")
    go(directory, 3)
    return directory


@pytest.fixture(scope="module")
def extended(origin, tmp_path_factory):
    """The results of the same, extended to four."""
    directory = tmp_path_factory.mktemp("extended")
    shutil.copytree(origin, directory, dirs_exist_ok=True)
    go(directory, 4, "auto")
    return digests(directory)


def digests(directory: Path) -> dict[str, str]:
    """The results in a directory by name."""
    return {name: sha256(content).hexdigest() for name, content in results(directory).items()}


def files_of(directory: Path) -> dict[str, bytes]:
    """All files of a directory."""
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def refused_or_same(directory: Path, origin: Path, extended: dict[str, str], spoil) -> str:
    """Go on from a copy of a run whose newest restart file is spoilt, named or by itself; the refusal, if it is one."""
    if not directory.exists():
        shutil.copytree(origin, directory)
    newest = directory / "restart-00000003.h5"
    newest.write_bytes((origin / newest.name).read_bytes())
    spoil(newest)
    before = files_of(directory)
    told = ""
    try:
        go(directory, 4, str(newest))
    except InputError as error:
        told = str(error)
    if told:
        assert files_of(directory) == before
        assert told.startswith(str(newest)) or "no valid state" in told
    else:
        assert digests(directory) == extended
        shutil.rmtree(directory)
    return told


def test_flips_of_one_bit(origin, extended, tmp_path):
    """All over the file, its structure and its checksum; each is refused."""
    size = (origin / "restart-00000003.h5").stat().st_size
    random = np.random.default_rng(20251129)
    places = {*random.integers(0, size, FLIPS - 20).tolist(), *range(8), *range(size - 12, size)}

    def flip(path: Path) -> None:
        content = bytearray(path.read_bytes())
        content[place] ^= 1 << int(random.integers(8))
        path.write_bytes(content)

    for place in places:
        told = refused_or_same(tmp_path / "out", origin, extended, flip)
        assert "is no complete restart file: it" in told, place


def test_auto_takes_the_older_one_and_names_both(origin, tmp_path, capsys):
    """And goes on as if the run had been stopped there."""
    go(tmp_path / "undisturbed", 4)
    directory = tmp_path / "out"
    shutil.copytree(origin, directory)
    newest = directory / "restart-00000003.h5"
    content = bytearray(newest.read_bytes())
    content[len(content) // 2] ^= 1
    newest.write_bytes(content)
    go(directory, 4, "auto")
    told = capsys.readouterr().out
    assert f"{newest}: is no complete restart file: its bytes are not those that were written" in told
    assert f"going on from {directory / 'restart-00000002.h5'}" in told
    assert results(directory) == results(tmp_path / "undisturbed")


def edits(file: h5py.File, draw) -> None:
    """Change a restart file as somebody might who knows HDF5."""
    names: list[str] = []
    file.visit(names.append)
    names.sort()
    sets = [name for name in names if isinstance(file[name], h5py.Dataset)]
    name = draw(st.sampled_from(names))
    match draw(
        st.sampled_from(["remove", "no rows", "type", "shape", "time", "step", "nan", "far", "scene", "attribute"])
    ):
        case "remove":
            del file[name]
        case "no rows":
            name = draw(st.sampled_from([s for s in sets if file[s].ndim]))
            values = file[name][:0]
            del file[name]
            file[name] = values
        case "type":
            name = draw(st.sampled_from([s for s in sets if file[s].dtype.kind == "f"]))
            values = file[name][()].astype(draw(st.sampled_from(["f4", "i4", "S8"])))
            del file[name]
            file[name] = values
        case "shape":
            name = draw(st.sampled_from([s for s in sets if file[s].ndim]))
            values = np.concatenate([file[name][()]] * 2, axis=-1)
            del file[name]
            file[name] = values
        case "time":
            file["simulation/values/time"][()] = draw(st.sampled_from([-1.0, np.nan, np.inf, -1e300]))
        case "step":
            file["simulation/values/steps"][()] = draw(st.sampled_from([-1, 2**62, 4]))
        case "nan":
            file["fluid/cells/state"][..., 3] = draw(st.sampled_from([np.nan, np.inf]))
        case "far":
            file["solid/particles/position"][:] = draw(st.sampled_from([1e300, -1e300, np.nan, np.inf]))
        case "scene":
            del file["scene"]
            file["scene"] = draw(st.sampled_from(["", "{", "[]", "1", '{"domain.cells": "(7,)"}', "\xff"]))
        case "attribute":
            name = draw(st.sampled_from(["format", "step", "run"]))
            file.attrs[name] = draw(st.sampled_from([0, -1, "x", b"\xff", 1e300, [1, 2], 2**63 - 1]))


@settings(
    max_examples=HOSTILE,
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
@given(data=st.data())
def test_hostile_files(origin, extended, tmp_path, data):
    """Bytes overwritten, cut off, added; and what HDF5 finds in order: groups without rows, other types, times, places,
    texts, also where the checksum was made anew."""

    def spoil(path: Path) -> None:
        content = path.read_bytes()
        how = data.draw(st.sampled_from(["overwrite", "cut", "add", "zeros", "edit", "edit and sum", "edit and sum"]))
        start = data.draw(st.integers(0, len(content) - 1))
        match how:
            case "overwrite":
                new = data.draw(st.binary(min_size=1, max_size=64))
                path.write_bytes((content[:start] + new + content[start + len(new) :])[: len(content)])
            case "cut":
                path.write_bytes(content[:start])
            case "add":
                path.write_bytes(content[:start] + data.draw(st.binary(min_size=1, max_size=64)) + content[start:])
            case "zeros":
                path.write_bytes(content[:start] + bytes(len(content) - start))
            case _:
                path.write_bytes(content[:-BYTES])
                with h5py.File(path, "r+") as file:
                    edits(file, data.draw)
                if how == "edit and sum":
                    add_checksum(path, Communicator())

    refused_or_same(tmp_path / "out", origin, extended, spoil)


def test_what_was_seen_to_go_on_is_refused(origin, extended, tmp_path):
    """A missing group, no rows, time -1, positions of 1e300: with a checksum as if a run had written them."""

    def edited(change):
        def spoil(path: Path) -> None:
            path.write_bytes(path.read_bytes()[:-BYTES])
            with h5py.File(path, "r+") as file:
                change(file)
            add_checksum(path, Communicator())

        return refused_or_same(tmp_path / "out", origin, extended, spoil)

    def without_rows(file):
        for name, dataset in list(file["solid/particles"].items()):
            values = dataset[:0]
            del file[f"solid/particles/{name}"]
            file[f"solid/particles/{name}"] = values

    def put(file, name, value):
        file[name][...] = value

    assert "holds no 'fluid'" in edited(lambda file: file.pop("fluid"))
    assert "holds no 'budget'" in edited(lambda file: file.pop("budget"))
    assert "solid/particles/id is int64 (0,)" in edited(without_rows)
    assert "holds the state at t = -1.0 s" in edited(lambda file: put(file, "simulation/values/time", -1.0))
    assert "nowhere near the domain" in edited(lambda file: put(file, "solid/particles/position", 1e300))
    assert "no valid state" in edited(lambda file: put(file, "solid/particles/energy", np.nan))


def test_files_of_earlier_versions_are_told_as_such(origin, tmp_path):
    path = tmp_path / "restart-00000003.h5"
    path.write_bytes((origin / path.name).read_bytes()[:-BYTES])
    with pytest.raises(InputError, match="it has no checksum at its end: .*an earlier version"):
        Restart(path)
