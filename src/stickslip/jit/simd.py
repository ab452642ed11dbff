"""Lanes: programs whose cases stand side by side in vectors, functions without branches for them, sums in vectors."""

# numba and llvmlite carry no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportMissingTypeStubs=false
# pyright: reportAttributeAccessIssue=false, reportUnknownLambdaType=false, reportUnknownArgumentType=false

from __future__ import annotations

import functools
import hashlib
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from stickslip.jit.addresses import FLOAT
from stickslip.jit.kept import cached, loaded

LANES_ALLOW = {"contract", "arcp", "nsz"}
"""What the compiler may do with the arithmetic of lanes: fused operations, reciprocals, unsigned zeros."""


@functools.lru_cache(maxsize=64)
def compiled_lanes(text: str) -> Any:
    """Return the module of a specialised program of lanes (`stickslip.simulation.recorded_input.segments`)."""
    return loaded(f"lanes_{hashlib.sha256(text.encode()).hexdigest()[:16]}", text)


def compile_inlined(function: Any) -> Any:
    """Decorator of programs of lanes: a function whose machine code goes into its callers, so that it vectorises."""
    return numba.njit(function, fastmath=LANES_ALLOW, error_model="numpy", forceinline=True)


def compile_lanes(function: Any) -> Any:
    """Decorator of programs of lanes: a function that releases the interpreter's lock and is cached."""
    return cached(numba.njit(function, nogil=True, fastmath=LANES_ALLOW, error_model="numpy"), function)


def _select(typingctx: Any, condition: Any, one: Any, other: Any) -> Any:
    """One value or the other, both computed: `if` may become a branch, which does not vectorise."""

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.select(arguments[0], arguments[1], arguments[2])

    return FLOAT(types.boolean, FLOAT, FLOAT), generate


select: Any = intrinsic(_select)


def _two_to(typingctx: Any, shifted: Any) -> Any:
    """2**k, with k + 1.5 2**52 given: the sum's last bits are k."""

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        whole = ir.IntType(64)
        bits = builder.shl(builder.bitcast(arguments[0], whole), ir.Constant(whole, 52))
        return builder.bitcast(builder.add(bits, ir.Constant(whole, 1023 << 52)), ir.DoubleType())

    return FLOAT(types.float64), generate


two_to: Any = intrinsic(_two_to)


@compile_inlined
def less_one(x: float, shifted: float) -> float:
    """exp(r) - 1, where x = k ln 2 + r and `shifted` holds k: the series to the twelfth power."""
    k = shifted - 6755399441055744.0
    r = x - k * 6.93147180369123816490e-01
    r = r - k * 1.90821492927058770002e-10
    # By Estrin's scheme: twelve terms one after another take three times as long, as each waits for the last.
    r2 = r * r
    r4 = r2 * r2
    low = (1.0 + 0.5 * r) + r2 * (1.0 / 6.0 + r * (1.0 / 24.0))
    middle = (1.0 / 120.0 + r * (1.0 / 720.0)) + r2 * (1.0 / 5040.0 + r * (1.0 / 40320.0))
    high = (1.0 / 362880.0 + r * (1.0 / 3628800.0)) + r2 * (1.0 / 39916800.0 + r * (1.0 / 479001600.0))
    return r * (low + r4 * (middle + r4 * high))


@compile_inlined
def exponential(x: float) -> float:
    """exp(x) to 1e-15 of its value, without a branch; beyond +-700 that of +-700.

    x = k ln 2 + r with |r| <= ln(2) / 2, and the series of exp(r) to the twelfth power.
    """
    x = select(x > -700.0, x, -700.0)
    x = select(x < 700.0, x, 700.0)
    shifted = x * 1.4426950408889634 + 6755399441055744.0
    return (1.0 + less_one(x, shifted)) * two_to(shifted)


@compile_inlined
def exponential_less_one(x: float) -> float:
    """exp(x) - 1 to 1.1e-15 of its value, also near 0, as `exponential`."""
    x = select(x > -700.0, x, -700.0)
    x = select(x < 700.0, x, 700.0)
    shifted = x * 1.4426950408889634 + 6755399441055744.0
    power = two_to(shifted)
    return power * less_one(x, shifted) + (power - 1.0)


WIDTH = 16
"""Numbers of a column that `columns_times` sums."""


def _columns_times(typingctx: Any, columns: Any, factors: Any, count: Any, out: Any) -> Any:
    """Write the sum of `count` columns of `WIDTH` numbers that lie one behind another, each times its factor.

    All are addresses. Every number is summed from the first column to the last, as a loop over one row would, but all
    rows at once, in vectors.
    """
    vector = ir.VectorType(ir.DoubleType(), WIDTH)
    none = ir.Constant(vector, ir.Undefined)
    first = ir.Constant(ir.IntType(32), 0)
    same = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        columns, factors, count, out = arguments
        whole, before = count.type, builder.block
        loop, done = builder.append_basic_block("column"), builder.append_basic_block("done")
        builder.branch(loop)
        builder.position_at_end(loop)
        place, total = builder.phi(whole), builder.phi(vector)
        at = builder.gep(columns, [builder.mul(place, ir.Constant(whole, WIDTH))])
        column = builder.load(builder.bitcast(at, vector.as_pointer()), align=8)
        factor = builder.insert_element(none, builder.load(builder.gep(factors, [place])), first)
        more = builder.fadd(total, builder.fmul(column, builder.shuffle_vector(factor, none, same)))
        following = builder.add(place, ir.Constant(whole, 1))
        place.add_incoming(ir.Constant(whole, 0), before)
        place.add_incoming(following, loop)
        total.add_incoming(ir.Constant(vector, [0.0] * WIDTH), before)
        total.add_incoming(more, loop)
        builder.cbranch(builder.icmp_signed("<", following, count), loop, done)
        builder.position_at_end(done)
        builder.store(more, builder.bitcast(out, vector.as_pointer()), align=8)
        return context.get_dummy_value()

    address = types.CPointer(FLOAT)
    return types.void(address, address, types.intp, address), generate


columns_times: Any = intrinsic(_columns_times)
