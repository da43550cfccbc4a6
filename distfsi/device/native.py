"""Drivers in machine code: from the types of a call to a function that Python calls, by LLVM, kept on disk.

The driver of a module text (device/llvm_text.py) gets an entry, which takes the objects of Python as they are, looks
whether they have the types that the text is made for, and releases the GIL while the driver runs.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from distfsi.device.cache import cache_directory, file_name, locked, write_whole
from distfsi.device.fingerprint import fingerprint
from distfsi.device.fold import Bound
from distfsi.device.llvm_text import module_of
from distfsi.device.llvm_types import BOOL, INTEGER, Array, Function, Type, leaf_types, packed_type, type_of

HEAD = object.__basicsize__  # of each object of Python, in bytes
# Where an array of numpy keeps its address, axes, lengths, type and flags, and a type its number: numpy's ABI.
DATA, AXES, LENGTHS, TYPE, FLAGS = HEAD, HEAD + 8, HEAD + 16, HEAD + 40, HEAD + 48
TYPE_NUMBER = HEAD + 12
CONTIGUOUS = 1
CODES = np.typecodes["AllInteger"] + np.typecodes["Float"] + "?"  # of numpy's types; several may be alike
PYTHON = {  # what the entry calls, with the types of its value and arguments
    "PyEval_SaveThread": ("ptr", ()),
    "PyEval_RestoreThread": ("void", ("ptr",)),
    "PyErr_Occurred": ("ptr", ()),
    "PyErr_Clear": ("void", ()),
    "Py_IncRef": ("void", ("ptr",)),
    "PyFloat_AsDouble": ("double", ("ptr",)),
    "PyFloat_FromDouble": ("ptr", ("double",)),
    "PyLong_AsLongLong": ("i64", ("ptr",)),
    "PyLong_FromLongLong": ("ptr", ("i64",)),
    "PyBool_FromLong": ("ptr", ("i64",)),
    "PyObject_IsTrue": ("i32", ("ptr",)),
    "PyTuple_New": ("ptr", ("i64",)),
    "PyTuple_Size": ("i64", ("ptr",)),
    "PyTuple_GetItem": ("ptr", ("ptr", "i64")),
    "PyTuple_SetItem": ("i32", ("ptr", "i64", "ptr")),
}
OBJECTS = {"python_array_type": np.ndarray, "python_none": None, "python_not_implemented": NotImplemented}


class Entry:
    """Writes the function that Python calls: it returns the driver's value, or NotImplemented for other types."""

    def __init__(self, name: str, driver: Function, types: Sequence[Type]):
        self.name, self.driver, self.types = name, driver, types
        self.lines: list[str] = []

    def text(self) -> str:
        """The function and what it needs declared."""
        objects = [f"%o{k}" for k in range(len(self.types))]
        operands = self.unpacked_all(self.types, objects)
        self.go_on_if(self.new(f"icmp eq ptr {self.new('call ptr @PyErr_Occurred()')}, null"))
        state = self.new("call ptr @PyEval_SaveThread()")
        result, kind = "", packed_type(self.driver.returns)
        call = f"call {kind} @{self.driver.name}({', '.join(operands)})"
        if kind == "void":
            self.line(call)
        else:
            result = self.new(call)
        self.line(f"call void @PyEval_RestoreThread(ptr {state})")
        leaves = [] if kind == "void" else [result]
        if kind.startswith("{"):
            count = len(leaf_types(self.driver.returns))
            leaves = [self.new(f"extractvalue {kind} {result}, {k}") for k in range(count)]
        value = self.packed(self.driver.returns, iter(leaves))
        self.line(f"ret ptr {value}")
        self.lines += ["other:", "  call void @PyErr_Clear()", "  call void @Py_IncRef(ptr @python_not_implemented)"]
        self.line("ret ptr @python_not_implemented")
        declared = [f"declare {kind} @{name}({', '.join(given)})" for name, (kind, given) in PYTHON.items()]
        declared += [f"@{name} = external global i8" for name in OBJECTS]
        head = f"define ptr @{self.name}({', '.join(f'ptr {given}' for given in objects)}) {{"
        return "\n".join([*declared, "", head, *self.lines, "}", ""])

    def line(self, text: str) -> None:
        self.lines.append(f"  {text}")

    def new(self, text: str) -> str:
        name = f"%e{len(self.lines)}"
        self.line(f"{name} = {text}")
        return name

    def go_on_if(self, condition: str) -> None:
        label = f"go{len(self.lines)}"
        self.line(f"br i1 {condition}, label %{label}, label %other")
        self.lines.append(f"{label}:")

    def member(self, kind: str, given: str, offset: int) -> str:
        """What stands at an offset in bytes of an object."""
        return self.new(f"load {kind}, ptr {self.new(f'getelementptr i8, ptr {given}, i64 {offset}')}")

    def unpacked_all(self, kinds: Sequence[Type], given: Sequence[str]) -> list[str]:
        return [leaf for kind, one in zip(kinds, given, strict=True) for leaf in self.unpacked(kind, one)]

    def unpacked(self, kind: Type, given: str) -> list[str]:
        """The leaves of an object, with their types."""
        if isinstance(kind, tuple):
            size = self.new(f"call i64 @PyTuple_Size(ptr {given})")
            self.go_on_if(self.new(f"icmp eq i64 {size}, {len(kind)}"))
            parts = [self.new(f"call ptr @PyTuple_GetItem(ptr {given}, i64 {k})") for k in range(len(kind))]
            return self.unpacked_all(kind, parts)
        if isinstance(kind, Array):
            return self.unpacked_array(kind, given)
        if kind == INTEGER:
            return [f"i64 {self.new(f'call i64 @PyLong_AsLongLong(ptr {given})')}"]
        if kind == BOOL:
            truth = self.new(f"call i32 @PyObject_IsTrue(ptr {given})")
            return [f"i1 {self.new(f'icmp ne i32 {truth}, 0')}"]
        value = self.new(f"call double @PyFloat_AsDouble(ptr {given})")
        return [f"double {value}" if kind == "double" else f"float {self.new(f'fptrunc double {value} to float')}"]

    def unpacked_array(self, kind: Array, given: str) -> list[str]:
        self.go_on_if(self.new(f"icmp eq ptr {self.member('ptr', given, HEAD - 8)}, @python_array_type"))
        number = self.member("i32", self.member("ptr", given, TYPE), TYPE_NUMBER)
        same, numbers = "false", {np.dtype(code).num for code in CODES if np.dtype(code).name == kind.element}
        for alike in sorted(numbers):
            same = self.new(f"or i1 {same}, {self.new(f'icmp eq i32 {number}, {alike}')}")
        axes = self.new(f"icmp eq i32 {self.member('i32', given, AXES)}, {kind.axes}")
        flag = self.new(f"and i32 {self.member('i32', given, FLAGS)}, {CONTIGUOUS}")
        same = self.new(f"and i1 {self.new(f'and i1 {same}, {axes}')}, {self.new(f'icmp ne i32 {flag}, 0')}")
        self.go_on_if(same)
        lengths = self.member("ptr", given, LENGTHS)
        return [
            f"ptr {self.member('ptr', given, DATA)}",
            *(f"i64 {self.member('i64', lengths, 8 * axis)}" for axis in range(kind.axes)),
        ]

    def packed(self, kind: Type | None, leaves: Iterator[str]) -> str:
        """The object of Python for a value."""
        if kind is None:
            self.line("call void @Py_IncRef(ptr @python_none)")
            return "@python_none"
        if isinstance(kind, tuple):
            whole = self.new(f"call ptr @PyTuple_New(i64 {len(kind)})")
            for k, part in enumerate(kind):
                self.new(f"call i32 @PyTuple_SetItem(ptr {whole}, i64 {k}, ptr {self.packed(part, leaves)})")
            return whole
        leaf = next(leaves)
        if kind == INTEGER:
            return self.new(f"call ptr @PyLong_FromLongLong(i64 {leaf})")
        if kind == BOOL:
            return self.new(f"call ptr @PyBool_FromLong(i64 {self.new(f'zext i1 {leaf} to i64')})")
        double = leaf if kind == "double" else self.new(f"fpext float {leaf} to double")
        return self.new(f"call ptr @PyFloat_FromDouble(double {double})")


class Compiler:
    """LLVM for the cores of this machine, and what it has made or loaded in this process.

    made    drivers compiled; those found on disk do not count
    listener  told of `made` when another one is about to be compiled
    """

    def __init__(self):
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
        target = llvm.Target.from_triple(llvm.get_process_triple())
        reloc = "static" if target.name.startswith("x86") else "default"
        options = {"cpu": cpu, "features": features, "opt": 3, "reloc": reloc, "codemodel": "jitdefault", "jit": True}
        self.identity = f"llvmlite {llvmlite.__version__} {cpu} {features}"  # what else machine code depends on
        self.machine = target.create_target_machine(**options)
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target.create_target_machine(**options))
        for name in PYTHON:
            llvm.add_symbol(name, ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value)
        for name, value in OBJECTS.items():
            llvm.add_symbol(name, id(value))
        self._addresses: dict[str, int] = {}
        self.made = 0
        self.listener: Callable[[int], None] = lambda made: None

    def optimised(self, text: str) -> llvm.ModuleRef:
        """A module after all passes."""
        module = llvm.parse_assembly(text)
        module.triple, module.data_layout = self.machine.triple, str(self.machine.target_data)
        module.verify()
        options = llvm.create_pipeline_tuning_options(speed_level=3)
        options.loop_vectorization, options.slp_vectorization = True, False
        builder = llvm.create_pass_builder(self.machine, options)
        builder.getModulePassManager().run(module, builder)
        return module

    def knows(self, name: str) -> bool:
        """Whether the function `name` is loaded or on disk."""
        return name in self._addresses or _path(name).exists()

    def compile(self, name: str, text: str) -> None:
        """Put the machine code of a module on disk under the name of its entry, unless it is there."""
        with locked(_path(name)):
            if not self.knows(name):
                self.made += 1
                self.listener(self.made)
                write_whole(_path(name), self.machine.emit_object(self.optimised(text)))

    def address(self, name: str) -> int:
        """Where the function `name` is, loaded from disk."""
        if name not in self._addresses:
            self._engine.add_object_file(llvm.ObjectFileRef.from_path(str(_path(name))))
            self._engine.finalize_object()
            self._addresses[name] = self._engine.get_function_address(name)
        return self._addresses[name]


def _path(name: str) -> Path:
    return cache_directory() / f"{name}.o"


@cache
def compiler() -> Compiler:
    """The compiler of this process."""
    return Compiler()


class Native:
    """A driver, specialised for a scene, for Python to call: compiled for each list of types that it is called with.

    A number is made one of the type that its parameter has, if it can be: an integer may stand for a real.
    """

    def __init__(self, driver: Callable, constants: Mapping[str, object], bindings: Mapping[str, Bound], real: str):
        self.driver, self.constants, self.bindings, self.real = driver, constants, bindings, real
        self._entries: dict[tuple[Type, ...], Callable] = {}
        self._latest: Callable = lambda *arguments: NotImplemented
        self._lock = threading.Lock()

    def __call__(self, *arguments):
        """Raises NotInSubset, and TypeError for what no kernel takes."""
        result = self._latest(*arguments)
        return self._call_for_types(arguments) if result is NotImplemented else result

    def _call_for_types(self, arguments: Sequence[object]):
        types = tuple(map(type_of, arguments))
        with self._lock:
            if types not in self._entries:
                self._entries[types] = self._entry(types)
            self._latest = self._entries[types]
        return self._entries[types](*arguments)

    def module(self, types: tuple[Type, ...]) -> tuple[str, str]:
        """The name of the entry for arguments of such types, and the text of its module."""
        module, driver = module_of(self.driver, self.constants, self.bindings, self.real, types)
        text = module.text() + Entry("ENTRY", driver, types).text()
        name = file_name(self.driver.__name__, f"; {compiler().identity}\n{text}")
        return name, text.replace("@ENTRY(", f"@{name}(", 1)

    def _compiled(self, types: tuple[Type, ...]) -> str:
        """The name of the entry for arguments of such types, compiled."""
        key = fingerprint(self.driver, self.constants, self.bindings, self.real, types, compiler().identity)
        known = cache_directory() / f"{self.driver.__name__}_{key}.name"
        name = known.read_text() if known.exists() else ""
        if not (name and compiler().knows(name)):
            name, text = self.module(types)
            compiler().compile(name, text)
            write_whole(known, name.encode())
        return name

    def _entry(self, types: tuple[Type, ...]) -> Callable:
        prototype = ctypes.PYFUNCTYPE(ctypes.py_object, *[ctypes.py_object] * len(types))
        entry = prototype(compiler().address(self._compiled(types)))
        entry.compiler = compiler()  # which owns the machine code
        return entry
