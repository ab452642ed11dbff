"""Compilation: the only package that imports numba.

Kernels (the loops of the engines) are compiled once and cached in a folder named after the content of the
package's own kernels, so that a cached kernel is never older than any function it calls. Laws and references
are translated by `stickslip.subset` to a file named after its own content, compiled to functions with one C
signature each, and handed to kernels as addresses: a kernel is compiled once, whatever laws it runs.
"""

from stickslip.jit.addresses import (
    call_growth,
    call_guarded,
    call_guards,
    call_holding,
    call_profile,
    call_rate,
    call_sample,
    call_step,
    call_switch,
    call_value,
    pointer,
    pointer_at,
    record_at,
)
from stickslip.jit.entries import (
    LAW,
    LawPointers,
    compile_entry,
    compile_inner,
    compiled_guarded,
    compiled_kernels,
    compiled_law,
    compiled_notice,
    compiled_profile,
    compiled_sample,
    compiled_step,
    entries_of,
    flat,
    kernel,
    spliced,
)
from stickslip.jit.kept import cache_folder, loaded
from stickslip.jit.simd import (
    WIDTH,
    columns_times,
    compile_inlined,
    compile_lanes,
    compiled_lanes,
    exponential,
    exponential_less_one,
    select,
)

__all__ = [
    "LAW",
    "WIDTH",
    "LawPointers",
    "cache_folder",
    "call_growth",
    "call_guarded",
    "call_guards",
    "call_holding",
    "call_profile",
    "call_rate",
    "call_sample",
    "call_step",
    "call_switch",
    "call_value",
    "columns_times",
    "compile_entry",
    "compile_inlined",
    "compile_inner",
    "compile_lanes",
    "compiled_guarded",
    "compiled_kernels",
    "compiled_lanes",
    "compiled_law",
    "compiled_notice",
    "compiled_profile",
    "compiled_sample",
    "compiled_step",
    "entries_of",
    "exponential",
    "exponential_less_one",
    "flat",
    "kernel",
    "loaded",
    "pointer",
    "pointer_at",
    "record_at",
    "select",
    "spliced",
]
