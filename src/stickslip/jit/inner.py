"""Functions that compiled code alone calls: made for linking into what calls them, and for nothing else.

numba makes machine code of every function that it compiles. That of an inner one would never run, since every entry
holds what it calls: it is left as the compiler's own text.
"""

# numba and llvmlite carry no types.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportMissingTypeStubs=false
# pyright: reportUnknownArgumentType=false

from __future__ import annotations

from typing import Any, Literal

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering


class Linked(JITCodeLibrary):
    """Code to be linked into other code; it has no address of its own."""

    def _optimize_final_module(self) -> None:
        # As part of what calls it, it is optimised there.
        pass

    def _finalize_final_module(self) -> None:
        # numba's puts it into its engine here, which makes machine code of it.
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class InnerLowering(NativeLowering):
    """numba's last pass, for a function that lies in the code of those that call it."""

    _name = "inner_lowering"

    def run_pass(self, state: Any) -> Literal[True]:
        """Lower, and let other functions find it."""
        codegen = state.targetctx.codegen()
        state.library = Linked(codegen, state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        # By this numba finds a function again: something of C that nobody else has, and that is not called.
        key = [].append
        state.targetctx.insert_user_function(key, state["cr"].fndesc, [state.library])
        state["cr"] = state["cr"]._replace(cfunc=key)
        return True


class InnerCompiler(Compiler):
    """numba's compiler, but for that pass."""

    def define_pipelines(self) -> list[Any]:
        """Its passes."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.passes = [
            (InnerLowering if step is NativeLowering else step, words) for step, words in pipeline.passes
        ]
        pipeline.finalize()
        return [pipeline]
