"""The cache of kernels holds what is executed: it is looked at first, and nobody else may write there."""

import os
import sys

import numpy as np
import pytest

from distfsi.device import cache
from distfsi.device.markers import driver
from distfsi.device.native import Native
from distfsi.errors import InputError


@driver
def halves_of(A, B):  # noqa: N803
    """Halves of numbers."""
    for i in range(len(B)):
        B[i] = 0.5 * A[i]


def half_of(number):
    """By a kernel that is read from disk anew; its module's name."""
    kernel, found = Native(halves_of, {}, {}, "float64"), np.zeros(1)
    sys.modules.pop(f"distfsi_kernels.{kernel.name}", None)
    kernel(np.array([number]), found)
    return found[0], kernel.name


@pytest.mark.parametrize(
    "spoilt",
    [
        lambda text: text.replace("return", "raise SystemExit(1)\n    return"),
        lambda text: text + "raise SystemExit(1)\n",
        lambda text: "",
        lambda text: text.replace("NUMBERS = ()", "NUMBERS = (1,)"),
    ],
)
def test_a_text_that_was_changed_is_not_executed(tmp_path, monkeypatch, spoilt):
    """It is written anew, and so is the machine code that belongs to it."""
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path))
    _, name = half_of(3.0)
    module = tmp_path / f"{name}.py"
    text = module.read_text()
    module.write_text(spoilt(text))
    assert module.read_text() != text
    assert half_of(5.0) == (2.5, name)
    assert module.read_text() == text


def test_a_name_that_leads_elsewhere_is_not_followed(tmp_path, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path / "cache"))
    half_of(3.0)
    (tmp_path / "outside.py").write_text("raise SystemExit(1)\n")
    for note in (tmp_path / "cache").glob("*.name"):
        note.write_text("../outside")
    assert half_of(5.0)[0] == 2.5


@pytest.mark.parametrize("folder", ["", "__pycache__"])
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o1777])
def test_a_folder_that_others_can_write_is_refused(tmp_path, monkeypatch, folder, mode):
    """With the folder and what to do; nothing in it is executed."""
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path))
    (tmp_path / folder).mkdir(exist_ok=True)
    (tmp_path / folder).chmod(mode)
    with pytest.raises(InputError, match="can be written by others: .*DISTFSI_CACHE.*chmod go-w"):
        half_of(3.0)


def test_a_folder_of_another_user_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path))
    monkeypatch.setattr(os, "getuid", lambda: 4711)

    if os.geteuid() == 0:
        os.chown(tmp_path, 4712, -1)
        with pytest.raises(InputError, match="belongs to another user"):
            cache.kernel_cache()
        os.chown(tmp_path, 0, -1)


def test_a_new_folder_is_for_its_owner_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("DISTFSI_CACHE", str(tmp_path / "new" / "cache"))
    assert cache.kernel_cache().stat().st_mode & 0o077 == 0
