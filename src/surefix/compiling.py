"""How Numba compiles kernels and their parts, with less work than it does by itself.

Numba compiles each function that a kernel calls as if Python could call it, too: it optimises it,
with all that it calls in turn, and makes machine code of it. Here such a *part* is only translated;
it is optimised and becomes machine code once, inside of the kernel.
"""

from __future__ import annotations

import gc
from typing import Any

from numba import _dynfunc
from numba.core import typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering

__all__ = ["KernelCompiler", "PartCompiler"]

# They look for closures, comprehensions and expressions of whole arrays, which would allocate.
_NEEDLESS = {
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.RewriteDynamicRaises,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.InlineInlinables,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.InlineOverloads,
    typed_passes.NopythonRewrites,
}


class _Flags(Flags):
    """Flags of a compilation, quickly compared: Numba does it for each call in the source."""

    def __hash__(self) -> int:
        return hash(_Flags)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, _Flags):
            return bool(self._values == other._values)
        return NotImplemented


class KernelCompiler(CompilerBase):
    """Numba's own way, without a search for garbage.

    Nearly all that a compilation makes is in use until its end: to look it through again and again
    is a tenth of the time.
    """

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.state.flags = _Flags(self.state.flags)

    def define_pipelines(self) -> list[Any]:
        """Steps of a compilation: Numba's without those that a lean function has no use for."""
        steps = DefaultPassBuilder.define_nopython_pipeline(self.state)
        if not self.state.flags.nrt:
            return _with_steps(steps, [each for each in steps.passes if each[0] not in _NEEDLESS])
        return [steps]

    def compile_extra(self, func: Any) -> Any:
        """Compile a function; as Numba's."""
        collecting = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collecting:
                gc.enable()


class PartCompiler(KernelCompiler):
    """Compile a function that only kernels call, without making machine code of it."""

    def define_pipelines(self) -> list[Any]:
        """Steps of a compilation, the last but one replaced."""
        (steps,) = super().define_pipelines()
        swapped = {NativeLowering: _PartLowering}
        return _with_steps(steps, [(swapped.get(step, step), said) for step, said in steps.passes])


def _with_steps(pipeline: Any, steps: list[Any]) -> list[Any]:
    pipeline.passes = steps
    pipeline._finalized = False
    pipeline.finalize()
    return [pipeline]


class _Part(JITCodeLibrary):
    """Code of a part and of the parts that it calls, not optimised and not for the processor."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    """Translate a part, and tell the compiler where those that call it find the code."""

    _name = "surefix_part_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        made = state["cr"]
        name = made.fndesc.qualname.split(".")[-1]
        doc = f"part of kernels, {made.fndesc.qualname!r}"
        handle = _dynfunc.make_function(
            made.fndesc.lookup_module(), name, doc, 0, made.env, (state.library,)
        )
        state.targetctx.insert_user_function(handle, made.fndesc, [state.library])
        state["cr"] = made._replace(cfunc=handle)
        return True
