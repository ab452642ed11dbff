"""Compilation: the only file that imports numba.

Kernels (the loops of the engines) are compiled once and cached in a folder named after the content of the
package's own kernels, so that a cached kernel is never older than any function it calls. Laws and references
are translated by `stickslip.subset` to a file named after its own content, compiled to functions with one C
signature each, and handed to kernels as addresses: a kernel is compiled once, whatever laws it runs.
"""

# numba and llvmlite carry no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportMissingTypeStubs=false
# pyright: reportAttributeAccessIssue=false, reportUnknownLambdaType=false, reportUnknownArgumentType=false

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
import os
import platform
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.ccallback import CFunc
from numba.core.runtime.nrt import rtsys
from numba.extending import intrinsic

from stickslip import compiling
from stickslip.spec import Law
from stickslip.subset import Layout, law_layouts, lower

__all__ = [
    "LawPointers",
    "call_guarded",
    "call_guards",
    "call_holding",
    "call_profile",
    "call_rate",
    "call_sample",
    "call_step",
    "call_switch",
    "call_value",
    "compiled_guarded",
    "compiled_kernels",
    "compiled_lanes",
    "compiled_law",
    "compiled_notice",
    "compiled_profile",
    "compiled_sample",
    "compiled_step",
    "kernel",
    "loaded",
    "pointer",
    "pointer_at",
]

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
    "profile": types.void(FLOAT, ARRAY, ARRAY),
    "sample": FLOAT(FLOAT, FLOAT, FLOAT, FLOAT, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY),
    "guarded": FLOAT(ARRAY, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY, ARRAY),
}

NO_ADDRESS: dict[str, Any] = {"no_cfunc_wrapper": True}
"""For functions that nobody calls by address: numba would compile each once more with a C signature."""
INNER: dict[str, Any] = {"no_cpython_wrapper": True, **NO_ADDRESS}
"""For functions that compiled code alone calls."""

# ---- where compiled code is kept --------------------------------------------------------------------------


def _kernel_files() -> tuple[Path, ...]:
    """The files that kernels are made of, and those whose constants they hold: all of the rooms that have kernels."""
    package = Path(__file__).parent
    found = (package.glob(f"{room}/**/*.py") for room in ("simulation", "machines", "rigs"))
    return (Path(__file__), *sorted(file for files in found for file in files))


@functools.cache
def cache_folder() -> Path:
    """The folder for compiled code: STICKSLIP_CACHE, else the user's cache folder, else a temporary one."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version} {platform.machine()}".encode())
    for file in _kernel_files():
        digest.update(file.read_bytes())
    home = os.environ.get("STICKSLIP_CACHE") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "stickslip"
    )
    folder = Path(home) / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="stickslip-"))


class _Told(event.Listener):
    """Passes on that a function is compiled, other than read from the cache."""

    def on_start(self, event: Any) -> None:
        compiling.started()

    def on_end(self, event: Any) -> None:
        compiling.ended()


event.register("numba:compile", _Told())


class _Kept(FunctionCache):
    """numba's cache, read without what only compiling needs: its tables of all that it knows, with SciPy, 0.35 s."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            if (found := self._load_overload(sig, target_context)) is not None:
                return found
        return super().load_overload(sig, target_context)


_decorating = threading.RLock()


def _cached(compiled: Any, function: Any) -> Any:
    """Keep what numba compiles of a function in our folder; numba asks for the folder when its cache is made."""
    with _decorating:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(cache_folder())
        try:
            compiled._cache = _Kept(function)
        finally:
            config.CACHE_DIR = before
    return compiled


def kernel(*, exact: bool = True, inline: bool = False) -> Callable[[Any], Any]:
    """Compile a function of an engine; it releases the interpreter's lock and is cached.

    ``exact=False`` lets the compiler contract and reassociate by reciprocals (never for laws, whose compiled
    form equals plain Python bit for bit). ``inline=True`` puts the machine code into every caller, which saves
    functions of many arguments a tenth of a microsecond a call.
    """
    fast: Any = False if exact else {"contract", "arcp", "nsz"}

    def decorate(function: Any) -> Any:
        options: dict[str, Any] = {"fastmath": fast, "forceinline": inline, **NO_ADDRESS}
        return _cached(numba.njit(function, nogil=True, error_model="numpy", **options), function)

    return decorate


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


# ---- calls through addresses ------------------------------------------------------------------------------


def _pointer(typingctx: Any, array: Any, offset: Any) -> Any:
    """The address of ``array[offset]``; the array is contiguous, or an address itself."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
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
call_profile: Any = _caller("profile", 3, False)
call_sample: Any = _caller("sample", 9, True)
call_guarded: Any = _caller("guarded", 9, True)


# ---- laws and references ----------------------------------------------------------------------------------


class LawPointers(NamedTuple):
    """Addresses of a law's compiled functions; 0 where the law has none."""

    step: int
    rate: int
    guards: int
    switch: int
    steady: int
    sliding: int
    holding: int


_laws: dict[int, tuple[Law, LawPointers]] = {}


def compiled_law(law: Law) -> LawPointers:
    """Compile a law, or fetch it from the cache.

    Raises
    ------
    LawError
        If a function of the law is outside the scalar subset.
    """
    with _decorating:
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
    with _decorating:
        if id(law) not in _steps:
            address = _compile(f"{law.name}_step", {"step": law.step}, law_layouts(law))["step"]
            _steps[id(law)] = (law, address)
        return _steps[id(law)][1]


def entries_of(law: Law) -> dict[str, Callable[..., Any]]:
    """The functions of a law that kernels may call."""
    names = ("step", "rate", "guards", "switch", "steady", "holding")
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


def loaded(name: str, text: str) -> Any:
    """Import a generated module, written to a file so that its compiled code can be cached."""
    path = cache_folder() / f"{name}.py"
    if not path.exists():
        # Written aside and renamed, so that no other process or thread reads half a file.
        draft = path.with_suffix(f".{os.getpid()}.{threading.get_ident()}.tmp")
        draft.write_text(text)
        os.replace(draft, path)
    spec = importlib.util.spec_from_file_location(f"stickslip._compiled.{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


# ---- lanes -------------------------------------------------------------------------------------------------

LANES_ALLOW = {"contract", "arcp", "nsz"}
"""What the compiler may do with the arithmetic of lanes: fused operations, reciprocals, unsigned zeros."""


@functools.lru_cache(maxsize=64)
def compiled_lanes(text: str) -> Any:
    """The module of a specialised program of lanes (`stickslip.simulation.many.simd_source`)."""
    return loaded(f"lanes_{hashlib.sha256(text.encode()).hexdigest()[:16]}", text)


def compile_inlined(function: Any) -> Any:
    """Decorator of programs of lanes: a function whose machine code goes into its callers, so that it vectorises."""
    return numba.njit(function, fastmath=LANES_ALLOW, error_model="numpy", forceinline=True)


def compile_lanes(function: Any) -> Any:
    """Decorator of programs of lanes: a function that releases the interpreter's lock and is cached."""
    return _cached(numba.njit(function, nogil=True, fastmath=LANES_ALLOW, error_model="numpy"), function)


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
        entry = _cached(CFunc(function, types_of, {}, {"error_model": "numpy"}), function)
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
