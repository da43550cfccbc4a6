"""What emitted numba modules import: the decorators behind the markers, and raw loads and stores.

Fast rows need two things numba does not do by itself: arguments that do not alias (a compile option it has inside but
does not show) and indexing without wrap-around. Both are held by tests/test_vectorised.py. Fast math stays off: NaN
checks stay valid and results do not depend on how a loop was vectorised.
"""

from __future__ import annotations

from llvmlite import ir
from numba import literal_unroll, njit, types
from numba.core.options import TargetOptions
from numba.core.registry import cpu_target
from numba.extending import intrinsic

from distfsi.device.exponential import EXPONENTIALS, Exponential

VERSION = "4"

_OPTIONS = cpu_target.options
if not hasattr(_OPTIONS, "noalias"):
    _OPTIONS.noalias = TargetOptions.Mapping("noalias")

# Only drivers are called from Python; without wrappers the others compile a fifth faster.
_INSIDE = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
formula = njit(forceinline=True, **_INSIDE)
helper = njit(forceinline=True, **_INSIDE)
row = njit(noalias=True, **_INSIDE)
driver = njit(error_model="numpy", nogil=True, cache=True)


@formula
def min_(a, b):
    """a if a < b else b, as on every device (numba's own min treats NaN otherwise)."""
    return a if a < b else b


@formula
def max_(a, b):
    """a if a > b else b, as on every device."""
    return a if a > b else b


@intrinsic
def load(typing_context, array, index):
    """array.flat[index] of a contiguous array: no wrap-around, no bounds check."""

    def code(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.load(builder.gep(data, [arguments[1]], inbounds=True))

    return array.dtype(array, types.intp), code


@intrinsic
def store(typing_context, array, index, value):
    """array.flat[index] = value of a contiguous array: no wrap-around, no bounds check."""

    def code(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        builder.store(arguments[2], builder.gep(data, [arguments[1]], inbounds=True))
        return context.get_dummy_value()

    return types.void(array, types.intp, array.dtype), code


@intrinsic
def _two_to_the(typing_context, shifted):
    """2^n, where `shifted` is n plus 1.5 times 2 to the number of mantissa bits: n then stands in the lowest bits."""

    def code(context, builder, signature, arguments):
        bits, mantissa, bias = (64, 52, 1023) if signature.args[0] == types.float64 else (32, 23, 127)
        integer = ir.IntType(bits)
        n = builder.bitcast(arguments[0], integer)
        exponent = builder.add(builder.shl(n, ir.Constant(integer, mantissa)), ir.Constant(integer, bias << mantissa))
        return builder.bitcast(exponent, arguments[0].type)

    return shifted(shifted), code


def _exponential(numbers: Exponential):
    """The exponential in arithmetic that vectorises (device/exponential.py)."""
    lowest, highest, shift, per_two = numbers.lowest, numbers.highest, numbers.shift, numbers.per_two
    high, low, coefficients = numbers.high, numbers.low, numbers.coefficients
    one = type(high)(1.0)

    @formula
    def exponential(x):
        x = lowest if x < lowest else x
        x = highest if x > highest else x
        shifted = x * per_two + shift
        n = shifted - shift
        r = (x - n * high) - n * low
        total = coefficients[0] * one
        for k in literal_unroll(coefficients[1:]):
            total = total * r + k
        return total * _two_to_the(shifted)

    return exponential


exp_float64 = _exponential(EXPONENTIALS["float64"])
exp_float32 = _exponential(EXPONENTIALS["float32"])
