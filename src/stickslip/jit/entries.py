"""Functions of the scalar subset, compiled: kernels alike, laws, references and controllers with an address."""

# numba and llvmlite carry no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportMissingTypeStubs=false
# pyright: reportAttributeAccessIssue=false, reportUnknownLambdaType=false, reportUnknownArgumentType=false

from __future__ import annotations

import ast
import functools
import hashlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types
from numba.core.ccallback import CFunc

from stickslip.core.spec import Law
from stickslip.jit.addresses import SIGNATURES, pointer_at
from stickslip.jit.inner import InnerCompiler
from stickslip.jit.kept import cached, decorating, loaded
from stickslip.subset import Layout, law_layouts, lower

NO_ADDRESS: dict[str, Any] = {"no_cfunc_wrapper": True}
"""For functions that nobody calls by address: numba would compile each once more with a C signature."""
INNER: dict[str, Any] = {"no_cpython_wrapper": True, "pipeline_class": InnerCompiler, **NO_ADDRESS}
"""For functions that compiled code alone calls."""


def kernel(*, exact: bool = True, inline: bool = False) -> Callable[[Any], Any]:
    """Compile a function of an engine; it releases the interpreter's lock and is cached.

    ``exact=False`` lets the compiler contract and reassociate by reciprocals (never for laws, whose compiled
    form equals plain Python bit for bit). ``inline=True`` puts the machine code into every caller, which saves
    functions of many arguments a tenth of a microsecond a call.
    """
    fast: Any = False if exact else {"contract", "arcp", "nsz"}

    def decorate(function: Any) -> Any:
        options: dict[str, Any] = {"fastmath": fast, "forceinline": inline, **NO_ADDRESS}
        return cached(numba.njit(function, nogil=True, error_model="numpy", **options), function)

    return decorate


def spliced(function: Any) -> Any:
    """Put a function's text into every kernel that calls it, which may so get records of it: no call returns them."""
    return numba.njit(function, inline="always", error_model="numpy")


def compiled_kernels(
    name: str, entries: Mapping[str, Callable[..., Any]], layouts: Mapping[str, Layout],
    given: Mapping[str, str] | None = None, inline: Iterable[str] = (),
) -> Any:  # fmt: skip
    """Functions of the scalar subset for kernels to call, compiled as kernels are; structures are addresses.

    Parameters
    ----------
    name : str
        Of the file.
    entries, layouts : mapping
        As `stickslip.subset.lower` takes them.
    given : mapping
        Kernels that the text calls: name to the module that has it.
    inline : iterable of str
        Entries whose machine code goes into every caller.
    """
    given = given or {}
    lines = ["import math", "from stickslip.jit import kernel"]
    lines += [f"from {module} import {each} as _{each}" for each, module in given.items()]
    for each, function in lower(entries, layouts, given).items():
        lines += [f"@kernel(inline={each in set(inline)})", ast.unparse(function)]
    text = "\n".join(lines) + "\n"
    return loaded(f"{name}_{hashlib.sha256(text.encode()).hexdigest()[:16]}", text)


class LawPointers(NamedTuple):
    """Addresses of a law's compiled functions; 0 where the law has none."""

    step: int
    rate: int
    guards: int
    switch: int
    steady: int
    sliding: int
    holding: int
    growth: int


LAW = np.dtype([(name, np.int64) for name in LawPointers._fields])
"""The same as a record, for kernels."""

_laws: dict[int, tuple[Law, LawPointers]] = {}


def compiled_law(law: Law) -> LawPointers:
    """Compile a law, or fetch it from the cache.

    Raises
    ------
    LawError
        If a function of the law is outside the scalar subset.
    """
    with decorating:
        if id(law) not in _laws:
            addresses = _compile(law.name, entries_of(law), law_layouts(law))
            _laws[id(law)] = (law, LawPointers(*(addresses.get(name, 0) for name in LawPointers._fields)))
        return _laws[id(law)][1]


_steps: dict[int, tuple[Law, int]] = {}


def compiled_step(law: Law) -> int:
    """Compile a law's step alone, or fetch it from the cache; returns its address.

    Raises
    ------
    LawError
        If the step is outside the scalar subset.
    """
    with decorating:
        if id(law) not in _steps:
            address = _compile(f"{law.name}_step", {"step": law.step}, law_layouts(law))["step"]
            _steps[id(law)] = (law, address)
        return _steps[id(law)][1]


def entries_of(law: Law) -> dict[str, Callable[..., Any]]:
    """The functions of a law that kernels may call."""
    names = ("step", "rate", "guards", "switch", "steady", "holding", "growth")
    entries: dict[str, Callable[..., Any]] = {
        name: function for name in names if (function := getattr(law, name)) is not None
    }
    for choice in law.choices:
        if choice.replaces == "sliding" and (curve := law.option(choice).function) is not None:
            entries["sliding"] = curve
    return entries


@functools.cache
def compiled_profile(name: str, function: Callable[..., Any], layout: Layout) -> int:
    """Compile a reference's ``profile(t, p, out)``; returns its address."""
    motion = Layout(("position", "velocity", "acceleration"))
    return _compile(name, {"profile": function}, {"p": layout, "out": motion})["profile"]


def compiled_sample(name: str, function: Callable[..., Any], layouts: Mapping[str, Layout]) -> int:
    """Compile one sample of a controller, `stickslip.control.composition.sample`; returns its address."""
    return _compile(name, {"sample": function}, layouts)["sample"]


def compiled_guarded(name: str, function: Callable[..., Any], layouts: Mapping[str, Layout]) -> int:
    """Compile one sample of a rig's loop, ``guarded(y, w, b, s, n, m, z, p, u)``; returns its address."""
    return _compile(name, {"guarded": function}, layouts)["guarded"]


_movers: dict[Callable[..., Any], Any] = {}


def compiled_mover(function: Callable[..., Any]) -> int:
    """Compile a machine's way across a sample (`stickslip.simulation.machine.movers`); returns its address."""
    with decorating:
        # Kept, since what is compiled lives no longer than what holds it.
        if function not in _movers:
            _movers[function] = compile_entry("mover")(function)
        return int(_movers[function].address)


def _compile(
    name: str, entries: Mapping[str, Callable[..., Any]], layouts: Mapping[str, Layout]
) -> dict[str, int]:
    """Translate, write to a file named after its content, compile; returns name to address."""
    functions = lower({f"_{entry}_": function for entry, function in entries.items()}, layouts)
    text = _program(functions, entries)
    module = loaded(f"{name.replace('-', '_')}_{hashlib.sha256(text.encode()).hexdigest()[:16]}", text)
    return {entry: int(getattr(module, entry).address) for entry in entries}


def _program(functions: Mapping[str, ast.FunctionDef], entries: Iterable[str]) -> str:
    """The text of a generated file: the functions, each entry under its own name."""
    names = {f"_{entry}_": entry for entry in entries}
    calls = [c.func for f in functions.values() for c in ast.walk(f) if isinstance(c, ast.Call)]
    called = {function.id for function in calls if isinstance(function, ast.Name)}
    lines = ["import math", "from stickslip.jit import compile_entry, compile_inner", ""]
    for name, function in functions.items():
        entry = names.get(name)
        # What no other function calls need not be compiled twice, for itself and for its address.
        if entry is not None and name not in called:
            function.name = entry
            lines += [f"@compile_entry({entry!r})", ast.unparse(function), ""]
            continue
        lines += ["@compile_inner", ast.unparse(function), ""]
        if entry is not None:
            arguments = ", ".join(a.arg for a in function.args.args)
            head = [f"@compile_entry({entry!r})", f"def {entry}({arguments}):"]
            lines += [*head, f"    return {name}({arguments})", ""]
    return "\n".join(lines)


_inner: dict[str, Any] = {}


def compile_inner(function: Any) -> Any:
    """Decorator of generated files: a function that entries call; one that several files hold is compiled once."""
    code, known = function.__code__, function.__globals__
    # By what it calls too, which stands above it: the same text may call another function in another file.
    calls = [
        called.py_func.__qualname__ for name in code.co_names if hasattr(called := known.get(name), "py_func")
    ]
    content = (code.co_code, code.co_consts, code.co_names, code.co_varnames, code.co_argcount, calls)
    name = f"{function.__name__}_{hashlib.sha256(repr(content).encode()).hexdigest()[:16]}"
    if name not in _inner:
        # What the disk keeps of an entry names the functions that it calls by module and name: this module is there in
        # every process, a file of another law is not.
        function.__module__, function.__qualname__ = __name__, name
        _inner[name] = numba.njit(function, error_model="numpy", **INNER)
    return _inner[name]


def compile_entry(name: str) -> Callable[[Any], Any]:
    """Decorator of generated files: a function with a C signature and an address."""

    def decorate(function: Any) -> Any:
        signature = SIGNATURES[name]
        types_of = (signature.args, signature.return_type)
        entry = cached(CFunc(function, types_of, {}, {"error_model": "numpy"}), function)
        entry.compile()
        return entry

    return decorate


def flat(values: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return a contiguous array with at least one element, so that its address exists."""
    array = np.ascontiguousarray(values, dtype=np.float64)
    return array if array.size else np.zeros(1)


def compiled_notice(cell: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
    """Compile ``void notice(int number)``, which stores its number in ``cell[0]`` and does nothing else.

    A signal's handler may do no more, in whatever thread it is called. Returns what holds its ``address``; it and the
    cell must outlive its use.
    """
    place = int(cell.ctypes.data)

    def notice(number: Any) -> None:
        pointer_at(place)[0] = number

    return numba.cfunc(types.void(types.int32))(notice)
