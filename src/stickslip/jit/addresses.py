"""Calls through addresses: one C signature for each function of a law, a reference or a controller."""

# numba and llvmlite carry no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportMissingTypeStubs=false
# pyright: reportAttributeAccessIssue=false, reportUnknownLambdaType=false, reportUnknownArgumentType=false

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

FLOAT = types.float64
ARRAY = types.CPointer(types.float64)
SIGNATURES = {
    "step": FLOAT(FLOAT, FLOAT, FLOAT, ARRAY, ARRAY, ARRAY),
    "rate": FLOAT(FLOAT, ARRAY, ARRAY, ARRAY, ARRAY),
    "guards": types.void(FLOAT, ARRAY, ARRAY, ARRAY, ARRAY),
    "switch": types.void(FLOAT, ARRAY, ARRAY, ARRAY, ARRAY),
    "steady": FLOAT(FLOAT, ARRAY),
    "sliding": FLOAT(FLOAT, ARRAY),
    "holding": FLOAT(FLOAT, ARRAY, ARRAY, ARRAY),
    "growth": FLOAT(FLOAT, FLOAT, ARRAY),
    "mover": FLOAT(*[ARRAY] * 10, FLOAT, FLOAT, FLOAT, FLOAT),
    "profile": types.void(FLOAT, ARRAY, ARRAY),
    "sample": FLOAT(FLOAT, FLOAT, FLOAT, FLOAT, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY),
    "guarded": FLOAT(ARRAY, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY),
}


def _pointer(typingctx: Any, array: Any, offset: Any) -> Any:
    """The address of ``array[offset]``; the array is contiguous, an address itself, or a record of numbers."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if isinstance(array, types.Record):
            return builder.gep(builder.bitcast(arguments[0], ir.DoubleType().as_pointer()), [arguments[1]])
        if isinstance(array, types.CPointer):
            return builder.gep(arguments[0], [arguments[1]])
        struct = context.make_array(signature.args[0])(context, builder, arguments[0])
        return builder.gep(struct.data, [arguments[1]])

    return ARRAY(array, types.intp), generate


pointer: Any = intrinsic(_pointer)


def _pointer_at(typingctx: Any, address: Any) -> Any:
    """The pointer to an address that Python knows: what costs an array per call to unbox need not be passed."""

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.DoubleType().as_pointer())

    return ARRAY(types.int64), generate


pointer_at: Any = intrinsic(_pointer_at)


def _record_at(typingctx: Any, address: Any, kind: Any) -> Any:
    """The record of a NumPy structure at an address: its numbers by name, at the price of by index.

    An array of structures itself would cost 10 µs at every call from Python, where numba asks for its type.
    """
    record = kind.dtype

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], context.get_value_type(record))

    return record(address, kind), generate


record_at: Any = intrinsic(_record_at)


def _caller(name: str, count: int, returns: bool) -> Any:
    """Build an intrinsic that calls the function at an address with the signature `name`."""
    signature = SIGNATURES[name]
    result: Any = ir.DoubleType() if returns else ir.VoidType()
    kinds = [ir.DoubleType() if a is FLOAT else ir.DoubleType().as_pointer() for a in signature.args]

    def generate(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        function = builder.inttoptr(arguments[0], ir.FunctionType(result, kinds).as_pointer())
        out = builder.call(function, arguments[1:])
        return out if returns else context.get_dummy_value()

    typed = signature.return_type(types.intp, *signature.args)
    names = ", ".join(f"a{i}" for i in range(count))
    scope: dict[str, Any] = {"typed": typed, "generate": generate}
    exec(f"def call(typingctx, address, {names}):\n    return typed, generate", scope)
    return intrinsic(scope["call"])


call_step: Any = _caller("step", 6, True)
call_rate: Any = _caller("rate", 5, True)
call_guards: Any = _caller("guards", 5, False)
call_switch: Any = _caller("switch", 5, False)
call_value: Any = _caller("steady", 2, True)
call_holding: Any = _caller("holding", 4, True)
call_growth: Any = _caller("growth", 3, True)
call_mover: Any = _caller("mover", 14, True)
call_profile: Any = _caller("profile", 3, False)
call_sample: Any = _caller("sample", 9, True)
call_guarded: Any = _caller("guarded", 9, True)
