"""What kernel modules import (device/native.py): numba compiles a driver around the LLVM IR that is written for it.

numba unpacks what Python calls the driver with, releases the GIL, optimises the whole and keeps the machine code on
disk; its own reading, typing and lowering of Python, of which most of the time to the first step would go, sees one
call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic

from distfsi.device.llvm_types import BOOL, INTEGER, REALS, SHORT, Array, Type, leaf_types
from distfsi.narrowing import of_kind

VERSION = "1"
WRITERS: dict[str, Callable[[tuple[Type, ...]], tuple[str, str, Type | None]]] = {}

driver: Callable[[Callable[..., Any]], Any] = njit(  # type: ignore[call-overload] # numba has more words than its types
    error_model="numpy", nogil=True, cache=True, no_cfunc_wrapper=True
)

_NUMBERS: dict[str, types.Type] = {
    INTEGER: types.int64,
    SHORT: types.int32,
    BOOL: types.boolean,
    "double": types.float64,
    "float": types.float32,
}
_LEAVES = {"ptr": ir.PointerType(), INTEGER: ir.IntType(64), SHORT: ir.IntType(32), BOOL: ir.IntType(1)}
_LEAVES |= {"double": ir.DoubleType(), "float": ir.FloatType()}


def body_of(module: str) -> Callable[..., Any]:
    """The body of a driver, to be called with all its arguments in one tuple: `WRITERS[module]` gives for their types
    the name of a function, the text that defines it, and the type that it returns."""

    @intrinsic
    def body(typing_context: Any, arguments: Any) -> Any:
        name, text, returns = WRITERS[module](tuple(map(_type_of, arguments.types)))

        def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            leaves: list[Any] = []
            for k, kind in enumerate(arguments.types):
                leaves += _leaves(context, builder, kind, builder.extract_value(given[0], k))
            context.active_code_library.add_linking_library(_Written(text, context.codegen()))
            kinds = [_LEAVES[leaf] for leaf in ([] if returns is None else leaf_types(returns))]
            result = ir.VoidType() if not kinds else kinds[0] if len(kinds) == 1 else ir.LiteralStructType(kinds)
            function_type = ir.FunctionType(result, [leaf.type for leaf in leaves])
            called = builder.call(cgutils.get_or_insert_function(builder.module, function_type, name), leaves)
            if not kinds:
                return context.get_dummy_value()
            parts = [called] if len(kinds) == 1 else [builder.extract_value(called, k) for k in range(len(kinds))]
            return _whole(context, builder, signature.return_type, iter(parts))

        return _numba_type(returns)(arguments), code

    return body


def _whole(context: Any, builder: Any, kind: types.Type, leaves: Iterator[ir.Value]) -> ir.Value:
    """A value of numba made of its leaves, tuples in it one behind the other."""
    if not isinstance(kind, types.BaseTuple):
        return next(leaves)
    return context.make_tuple(builder, kind, [_whole(context, builder, part, leaves) for part in _parts(kind)])


def _parts(kind: Any) -> Sequence[types.Type]:
    """The types in a tuple of numba's."""
    return kind.types


class _Written:
    """A text as a library that numba links: into the module of a driver, before that is optimised."""

    def __init__(self, text: str, codegen: Any):
        self._module = llvm.parse_assembly(text)
        self._module.triple, self._module.data_layout = llvm.get_process_triple(), str(codegen.target_data)
        self._reload_init: set[str] = set()

    def _ensure_finalized(self) -> None:
        """It needs no machine code of its own."""

    def _get_module_for_linking(self) -> llvm.ModuleRef:
        return self._module


def _type_of(kind: types.Type) -> Type:
    """A type of numba as one of device/llvm_types.py. Raises TypingError for what no kernel takes."""
    if isinstance(kind, types.Array):
        if kind.layout != "C":
            raise TypingError("kernels take contiguous arrays")
        return Array(str(kind.dtype) if kind.dtype is not types.boolean else "bool", kind.ndim)
    if isinstance(kind, types.BaseTuple):
        return tuple(map(_type_of, _parts(kind)))
    if isinstance(kind, types.Integer):
        return INTEGER
    if isinstance(kind, types.Boolean):
        return BOOL
    if isinstance(kind, types.Float):
        return REALS[kind.name]
    raise TypingError(f"kernels take no {kind}")


def _numba_type(kind: Type | None) -> types.Type:
    """The type of numba of what a driver returns."""
    if kind is None:
        return types.none
    return (
        types.Tuple([_numba_type(part) for part in kind]) if isinstance(kind, tuple) else _NUMBERS[of_kind(str, kind)]
    )


def _leaves(context: Any, builder: Any, kind: types.Type, value: Any) -> Sequence[Any]:
    """The leaves of a value of numba, as device/llvm_types.py orders them."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        return [array.data, *cgutils.unpack_tuple(builder, array.shape, kind.ndim)]
    if isinstance(kind, types.BaseTuple):
        parts = [builder.extract_value(value, k) for k in range(len(_parts(kind)))]
        return [
            leaf for part, own in zip(parts, _parts(kind), strict=True) for leaf in _leaves(context, builder, own, part)
        ]
    if isinstance(kind, types.Integer):
        return [context.cast(builder, value, kind, types.int64)]
    return [value]
