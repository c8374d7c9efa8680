"""What becomes of a kernel: machine code for Python, intermediate code for the kernels that call it.

Numba makes machine code and two wrappers of each function, also of those which only other compiled functions
call. For a tree of a hundred kernels that is more than half of the time to compile it. So a kernel has two
forms. `Kernel` is what Python calls. Where another kernel calls it, Numba is given its `InnerKernel`, which
stops at LLVM's intermediate code. The outermost kernel is optimised and translated as a whole.

This builds on parts of Numba which it does not document. tests/compilation/test_dispatchers.py fails when one
of them disappears, and pyproject.toml bounds Numba's versions to those that were tested.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from numba.core import compiler, errors, sigutils, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

from entropy_explore_env.compilation.cache import KernelCache
from entropy_explore_env.compilation.stamps import forget_parts

_WRAPPERS = {"no_cfunc_wrapper": True}
_NO_WRAPPERS = {"no_cfunc_wrapper": True, "no_cpython_wrapper": True}


class _Compiling(NamedTuple):
    """A kernel that is being compiled, and what its symbols are to be called."""

    function: Callable[..., Any]
    name: str | None


class _Stack(threading.local):
    """What this thread is compiling, the innermost last."""

    def __init__(self) -> None:
        self.kernels: list[_Compiling] = []


_stack = _Stack()


@contextmanager
def _compiling(function: Callable[..., Any], cache: KernelCache, sig: Any, target: Any) -> Iterator[None]:  # noqa: ANN401
    """While a kernel is compiled, its symbols bear the name of the file in the cache.

    Numba numbers functions as they come, so that code from another process may bear the number of another
    function of this one. The name of the file is never that of other code.

    Raises:
        numba.core.errors.TypingError: The kernel calls itself.
    """
    outermost = not _stack.kernels
    if outermost:
        forget_parts()
    if any(compiling.function is function for compiling in _stack.kernels):
        raise errors.TypingError(f"kernel {function.__qualname__} calls itself; Numba's own njit allows that")
    _stack.kernels.append(_Compiling(function, cache.name_of(sig, target)))
    collecting = outermost and gc.isenabled()
    # A compiler makes many objects and few cycles: looking for them takes an eighth of its time.
    if collecting:
        gc.disable()
    try:
        yield
    finally:
        _stack.kernels.pop()
        if collecting:
            if not gc.get_freeze_count():  # what is left joins the oldest objects unexamined
                gc.freeze()
                gc.unfreeze()
            gc.enable()


class KernelCompiler(compiler.Compiler):
    """Numba's compiler; the symbols get the name of the file in the cache."""

    def define_pipelines(self) -> list[PassManager]:
        """Numba's pipeline."""
        name = _stack.kernels[-1].name
        if name is not None:
            self.state.func_id.unique_id = name
        return super().define_pipelines()


class InnerKernelCompiler(KernelCompiler):
    """The same, up to the intermediate code."""

    def define_pipelines(self) -> list[PassManager]:
        """Numba's pipeline, with another end."""
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            steps = [
                (InnerLowering if step is NativeLowering else step, text) for step, text in pipeline.passes
            ]
            pipeline.passes = steps
            pipeline._finalized = False
            pipeline.finalize()
        return pipelines


class InnerLibrary(JITCodeLibrary):
    """The intermediate code of an inner kernel and of all that it calls: not translated.

    It is simplified function by function, and optimised with the outermost kernel. Inlined kernels, the
    innermost loops, are optimised before that, too: code that was optimised once traces rays 10 % slower.
    """

    optimised = False
    """Whether it is an inlined kernel."""

    def enable_object_caching(self) -> None:
        """There is no object code."""

    def _optimize_final_module(self) -> None:
        if self.optimised:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """What is kept of it."""
        return self.serialize_using_bitcode()

    @classmethod
    def from_bitcode(cls, codegen: Any, state: tuple[str, str, bytes]) -> InnerLibrary:  # noqa: ANN401
        """What `serialize_using_object_code` gave, ready to be linked."""
        name, _, bitcode = state
        library = cls(codegen, name)
        library._final_module = llvm.parse_bitcode(bitcode)
        library._finalize_final_module()
        return library


@register_pass(mutates_CFG=True, analysis_only=False)
class InnerLowering(NativeLowering):
    """Lowers into an `InnerLibrary`."""

    _name = "inner_lowering"

    def run_pass(self, state: Any) -> bool:  # noqa: ANN401 - Numba's bag of everything
        """Lower, and give the result an entry point that is only a name for it."""
        state.library = InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.optimised = state.flags.forceinline
        state.flags.no_compile = True
        super().run_pass(state)
        state.library._ensure_finalized()
        state.reload_init.extend(getattr(state.library, "_reload_init", ()))  # since Numba 0.62
        state.cr = state.cr._replace(cfunc=object())
        return True


def _rebuild_inner(target_context: Any, reduced: tuple[Any, ...]) -> compiler.CompileResult:  # noqa: ANN401
    """The inverse of `CompileResult._reduce` for an inner kernel."""
    library, fndesc, environment, signature, objectmode, lifted, annotation, reload_init, environments = (
        reduced
    )
    for function in reload_init:
        function()
    return compiler.CompileResult(
        typing_context=target_context.typing_context,
        target_context=target_context,
        entry_point=object(),
        typing_error=None,
        type_annotation=annotation,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        fndesc=fndesc,
        library=InnerLibrary.from_bitcode(target_context.codegen(), library),
        call_helper=None,
        environment=environment,
        metadata=None,
        reload_init=reload_init,
        referenced_envs=environments,
    )


def _rebuild_outer(target_context: Any, reduced: tuple[Any, ...]) -> compiler.CompileResult:  # noqa: ANN401
    return compiler.CompileResult._rebuild(target_context, *reduced)


class InnerKernel(CPUDispatcher):
    """A kernel as other kernels call it."""

    _compiler: Any

    def __init__(self, kernel: Kernel) -> None:
        options = {**kernel.targetoptions, **_NO_WRAPPERS}
        super().__init__(kernel.py_func, {}, options, InnerKernelCompiler)
        kept = not options.get("forceinline", False)
        self._cache: KernelCache = KernelCache(kernel, "inner", _rebuild_inner, kept=kept)

    @property
    def is_compiling(self) -> bool:
        """Never said: Numba would begin to resolve a recursion, which intermediate code cannot hold."""
        return False

    def compile(self, sig: Any) -> object:  # noqa: ANN401 - types of arguments, or a signature
        """As Numba's, without timers: those of a whole tree of calls would be told of every call of LLVM."""
        with global_compiler_lock, self._compiling_counter:
            args, return_type = sigutils.normalize_signature(sig)
            known = self.overloads.get(tuple(args))
            if known is not None:
                return known.entry_point
            with _compiling(self.py_func, self._cache, sig, self.targetctx):
                result = self._cache.load_overload(sig, self.targetctx)
                if result is None:
                    result = self._compile(args, return_type)
                    self._cache.save_overload(sig, result)
            self.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
            self.overloads[tuple(result.signature.args)] = result
            return result.entry_point

    def _compile(self, args: Any, return_type: Any) -> compiler.CompileResult:  # noqa: ANN401
        try:
            return self._compiler.compile(args, return_type)
        except errors.ForceLiteralArg as request:
            fold = self._compiler.fold_argument_types
            raise request.bind_fold_arguments(lambda args, kws: fold(args, kws)[1]) from None


class Kernel(CPUDispatcher):
    """A kernel as Python calls it; as a dispatcher that `njit` makes.

    It cannot call itself, nor be a callback: it has no wrapper for C.
    """

    def __init__(
        self,
        py_func: Any,  # noqa: ANN401
        locals: dict[str, Any] | None = None,
        targetoptions: dict[str, Any] | None = None,
        pipeline_class: type[compiler.CompilerBase] = KernelCompiler,
    ) -> None:
        super().__init__(py_func, locals or {}, {**(targetoptions or {}), **_WRAPPERS}, pipeline_class)
        self._cache: KernelCache = KernelCache(self, "outer", _rebuild_outer, kept=True)
        self.inner = InnerKernel(self)
        self.typingctx._remove_global(self)  # Numba takes a dispatcher for one that calls itself
        self.typingctx.insert_global(self, self._numba_type_)

    @property
    def _numba_type_(self) -> types.Type:
        """What other kernels take it for: the inner form."""
        return self.inner._numba_type_

    def compile(self, sig: Any) -> object:  # noqa: ANN401
        """See Numba's `Dispatcher.compile`."""
        with global_compiler_lock, _compiling(self.py_func, self._cache, sig, self.targetctx):
            return super().compile(sig)

    def add_overload(self, cres: compiler.CompileResult) -> None:
        """As Numba's; tells the machine code where the environments of inner kernels are."""
        for environment in cres._find_referenced_environments():
            cres.codegen.set_env(environment.env_name, environment)
        super().add_overload(cres)
