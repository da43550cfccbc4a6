"""NVIDIA's run-time compiler: CUDA C -> machine code of one GPU architecture. It needs no GPU and no driver.

The library comes with CUDA, with the package cupy-cuda12x[ctk], or as nvidia-cuda-nvrtc-cu12 or nvidia-cuda-nvrtc.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib.util
import os
import re
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

from distfsi.device.cache import file_name, kernel_cache, locked, write_whole

# No contraction of a * b + c, IEEE division and roots, no flushing of denormals: the bits are those of the CPU.
FLAGS = ("--std=c++20", "--fmad=false", "--prec-div=true", "--prec-sqrt=true", "--ftz=false", "--ptxas-options=-v")
# What a host shim defines otherwise (device/host.h).
PROLOGUE = "#define DYNAMIC_SHARED(name) extern __shared__ __align__(16) char name[]\n"


class CompileError(Exception):
    """The compiler refuses a text, or there is no compiler."""


@cache
def library() -> ctypes.CDLL:
    """The compiler's library. Raises CompileError when there is none."""
    for name in candidates():
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    raise CompileError("NVRTC is not found; pip install nvidia-cuda-nvrtc-cu12, or set CUDA_PATH")


def candidates() -> list[str]:
    """Where the library may be, packages of Python first."""
    found: list[Path] = []
    spec = importlib.util.find_spec("nvidia")
    for root in (spec.submodule_search_locations if spec else None) or ():
        found += sorted(Path(root).glob("*/lib/libnvrtc.so.*"), reverse=True)
    cuda = os.environ.get("CUDA_PATH", "/usr/local/cuda")
    found += sorted(Path(cuda).glob("lib64/libnvrtc.so*"))
    named = ctypes.util.find_library("nvrtc")
    return [str(path) for path in found if ".alt." not in path.name] + ([named] if named else [])


def version() -> str:
    """The compiler's version."""
    major, minor = ctypes.c_int(), ctypes.c_int()
    library().nvrtcVersion(ctypes.byref(major), ctypes.byref(minor))
    return f"{major.value}.{minor.value}"


def compile_text(text: str, architecture: str) -> tuple[bytes, str]:
    """Machine code for an architecture ("sm_90"), and what the compiler says of it. Raises CompileError."""
    nvrtc, program = library(), ctypes.c_void_p()
    nvrtc.nvrtcCreateProgram(ctypes.byref(program), (PROLOGUE + text).encode(), b"kernel.cu", 0, None, None)
    flags = [flag.encode() for flag in (*FLAGS, f"--gpu-architecture={architecture}")]
    failed = nvrtc.nvrtcCompileProgram(program, len(flags), (ctypes.c_char_p * len(flags))(*flags))
    log = _taken(nvrtc.nvrtcGetProgramLogSize, nvrtc.nvrtcGetProgramLog, program).decode().rstrip("\0")
    code = b"" if failed else _taken(nvrtc.nvrtcGetCUBINSize, nvrtc.nvrtcGetCUBIN, program)
    nvrtc.nvrtcDestroyProgram(ctypes.byref(program))
    if failed:
        raise CompileError(log)
    return code, log


def _taken(size_of: Callable[..., int], take: Callable[..., int], program: ctypes.c_void_p) -> bytes:
    size = ctypes.c_size_t()
    size_of(program, ctypes.byref(size))
    buffer = ctypes.create_string_buffer(size.value)
    take(program, buffer)
    return buffer.raw


def cubin(name: str, text: str, architecture: str) -> Path:
    """A file with the machine code of a text, kept on disk. Raises CompileError."""
    stem = file_name(name, "\n".join([version(), *FLAGS, PROLOGUE, text]))
    path = kernel_cache() / f"{stem}.{architecture}.cubin"
    if not path.exists():
        with locked(path):
            write_whole(path, compile_text(text, architecture)[0])
    return path


INSTRUCTIONS = {  # of the machine, by the first letters of their names
    "float64": ("DADD", "DMUL", "DFMA", "DSETP", "DMNMX"),
    "float32": ("FADD", "FMUL", "FFMA", "FSETP", "FMNMX", "FCHK"),
    "roots and reciprocals": ("MUFU",),
    "selects": ("FSEL", "SEL"),
    "global memory": ("LDG", "STG", "LD.", "ST."),
    "shared memory": ("LDS", "STS"),
    "local memory": ("LDL", "STL"),
    "moves": ("MOV", "IMAD.MOV", "UMOV"),
    "integers": ("IMAD", "IADD", "ISETP", "LEA", "LOP3", "SHF", "IABS", "UIMAD", "UIADD", "USHF", "ULEA", "ULOP3"),
    "branches": ("BRA", "CALL", "RET", "BSSY", "BSYNC", "EXIT", "BAR"),
}


def instructions(code: bytes) -> dict[str, int]:
    """How many instructions of each class machine code holds, loops counted once. Raises CompileError."""
    with tempfile.NamedTemporaryFile(suffix=".cubin") as file:
        file.write(code)
        file.flush()
        done = subprocess.run([_disassembler(), "-c", file.name], capture_output=True, text=True)
    if done.returncode:
        raise CompileError(done.stderr)
    names = re.findall(r"/\*[0-9a-f]{4,}\*/\s+(?:@!?U?P\w+\s+)?([A-Z][\w.]*)", done.stdout)
    names = [name for name in names if name != "NOP"]  # fills the last line of code
    kinds = [next((k for k, first in INSTRUCTIONS.items() if name.startswith(first)), "others") for name in names]
    counted = Counter(kinds)
    return {kind: counted[kind] for kind in (*INSTRUCTIONS, "others")}


def _disassembler() -> str:
    spec = importlib.util.find_spec("nvidia")
    for root in (spec.submodule_search_locations if spec else None) or ():
        for path in Path(root).glob("*/bin/nvdisasm"):
            return str(path)
    found = shutil.which("nvdisasm")
    if found is None:
        raise CompileError("nvdisasm is not found; pip install nvidia-cuda-nvdisasm")
    return found


def usage(log: str) -> dict[str, int]:
    """What the compiler says of a kernel: its registers, and the bytes that it spills or keeps on its stack."""
    numbers = re.findall(r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads", log)
    stack, stores, loads = map(int, numbers[-1])
    return {
        "registers": int(re.findall(r"Used (\d+) registers", log)[-1]),
        "stack": stack,
        "spill stores": stores,
        "spill loads": loads,
    }
