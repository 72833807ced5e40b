"""How Numba compiles kernels and their parts, with less work than it does by itself.

Numba compiles each function that a kernel calls as if Python could call it, too: it optimises it,
with all that it calls in turn, and makes machine code of it. Here such a *part* is only translated;
it is optimised and becomes machine code once, inside of the kernel.

What was compiled is kept on disk such that processes which compile at the same time cannot mistake
the code of one signature, or of an older source, for another.
"""

from __future__ import annotations

import gc
import hashlib
from typing import Any

from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core import cgutils, typed_passes, types, untyped_passes
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.lowering import Lower
from numba.core.runtime.nrt import rtsys
from numba.core.typed_passes import NativeLowering

__all__ = ["KernelCache", "KernelCompiler", "PartCompiler"]

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


class _Kernel(JITCodeLibrary):
    """Code of a kernel.

    Numba is told of the machine code while LLVM makes it. An exception that comes up there, such as
    that of Ctrl-C, is dropped, and the code with it; then it is made again.
    """

    def _get_compiled_object(self) -> Any:
        if self._compiled_object is None:
            self._compiled_object = self._codegen._tm.emit_object(self._final_module)  # noqa: SLF001
        return self._compiled_object


class _Part(JITCodeLibrary):
    """Code of a part, not for the processor: it is optimised, and linked to others, in a kernel."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class KernelCompiler(CompilerBase):
    """Numba's own way, without a search for garbage, and with records loaded field by field.

    Nearly all that a compilation makes is in use until its end: to look it through again and again
    is a tenth of the time.
    """

    _library: type[JITCodeLibrary] = _Kernel

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.state.flags = _Flags(self.state.flags)

    def define_pipelines(self) -> list[Any]:
        """Steps of a compilation: Numba's without those that a lean function has no use for."""
        steps = DefaultPassBuilder.define_nopython_pipeline(self.state)
        made = PassManager(steps.pipeline_name)
        for step, said in steps.passes:
            if self.state.flags.nrt or step not in _NEEDLESS:
                made.add_pass(self._translation() if step is NativeLowering else step, said)
        made.finalize()
        return [made]

    def _translation(self) -> type[NativeLowering]:
        return _KernelLowering

    def compile_extra(self, func: Any) -> Any:
        """Compile a function; as Numba's."""
        codegen = self.state.targetctx.codegen()
        self.state.library = self._library(codegen, func.__qualname__)
        self.state.library.enable_object_caching()
        collecting = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collecting:
                gc.enable()


class PartCompiler(KernelCompiler):
    """Compile a function that only kernels call, without making machine code of it."""

    _library = _Part

    def _translation(self) -> type[NativeLowering]:
        return _PartLowering


class _Lower(Lower):
    """Translation into the language of LLVM, shorter where records hold many arrays."""

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        """Translate an expression; of a record that is kept in memory only the field is loaded."""
        if expr.op == "getattr" and expr.value.name not in self._blk_local_varmap:
            record: Any = self.typeof(expr.value.name)
            if isinstance(record, types.NamedTuple | types.NamedUniTuple):
                index = record.fields.index(expr.attr)
                where = cgutils.gep_inbounds(self.builder, self.getvar(expr.value.name), 0, index)
                field = self.builder.load(where)
                self.incref(record[index], field)
                return self.context.cast(self.builder, field, record[index], resty)
        return super().lower_expr(resty, expr)


@register_pass(mutates_CFG=True, analysis_only=False)
class _KernelLowering(NativeLowering):
    _name = "surefix_kernel_lowering"

    @property
    def lowering_class(self) -> Any:
        return _Lower


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(_KernelLowering):
    """Translate a part, and tell the compiler where those that call it find the code."""

    _name = "surefix_part_lowering"

    def run_pass(self, state: Any) -> bool:
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


class KernelCache(FunctionCache):
    """What was compiled of a kernel, kept on disk for processes that compile side by side.

    Raises
    ------
    RuntimeError
        There is no folder that can be written to.
    """

    _cache_file: _CacheFile

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        base, stamp = f"{self._impl.filename_base}.own", self._impl.locator.get_source_stamp()
        self._cache_file = _CacheFile(self._cache_path, base, stamp)  # not a file of Numba's

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load what was compiled; what the compiler has to know (.15 s) only if it compiles."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def empty(self) -> bool:
        """Tell whether nothing was compiled yet."""
        return not self._cache_file.index()


class _CacheFile(IndexDataCacheFile):
    """Where the machine code of a kernel is kept.

    Numba gives the files numbers, two processes the same to different signatures, and writes the
    index first, so that for a moment it names a file that an older source left. Here the name
    follows from the signature and the file tells what it holds; the index, of which processes may
    overwrite entries, only says that there is something.
    """

    def index(self) -> dict[Any, str]:
        """Names of the files of what there is."""
        found: dict[Any, str] = self._load_index()
        return found

    def save(self, key: Any, data: Any) -> None:
        """Save code; ``key`` is its signature, the processor and the source of the kernel."""
        name = self._name(key)
        self._save_data(name, (self._source_stamp, key, data))
        self._save_index(self.index() | {key: name})

    def load(self, key: Any) -> Any:
        """What was saved under this key, or nothing."""
        try:
            stamp, of, data = self._load_data(self._name(key))
        except OSError:
            return None
        return data if (stamp, of) == (self._source_stamp, key) else None

    def _name(self, key: Any) -> str:
        digest = hashlib.sha256(repr(key[:2]).encode()).hexdigest()
        return str(self._data_name(int(digest[:12], 16)))
