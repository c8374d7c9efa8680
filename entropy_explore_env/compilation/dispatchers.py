"""What becomes of a kernel: machine code for Python, intermediate code for the kernels that call it.

Numba makes machine code and two wrappers of each function, also of those which only other compiled functions
call. For a tree of a hundred kernels that is more than half of the time to compile it. So a kernel has two
forms. `Kernel` is what Python calls. Where another kernel calls it, Numba is given its `InnerKernel`, which
stops at LLVM's intermediate code. The outermost kernel is optimised and translated as a whole.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import IO, Any

from entropy_explore_env.compilation import announcement, cache, second_process
from entropy_explore_env.compilation.folder import ClaimedError, claim, kernel_folder, release
from entropy_explore_env.compilation.libraries import InnerLowering, OuterLowering, rebuilt_inner
from entropy_explore_env.compilation.numba_parts import (
    UNUSED_PASSES,
    AnalysisPass,
    CPUDispatcher,
    NativeLowering,
    NopythonTypeInference,
    PassManager,
    compiler,
    errors,
    global_compiler_lock,
    register_pass,
    sigutils,
    type_inference_stage,
    types,
)
from entropy_explore_env.compilation.shortcuts import general_type, shortcuts
from entropy_explore_env.compilation.stamps import forget_digests

_WRAPPERS = {"no_cfunc_wrapper": True}
_NO_WRAPPERS = {"no_cfunc_wrapper": True, "no_cpython_wrapper": True}
_WORTH_DIVIDING = 20
"""Trees of at least this many kernels are compiled by two processes: to divide the work costs time, too.

None is divided within an inference, such as that of a function that `njit` made: until the outermost one
ends, Numba keeps what a survey could not resolve.
"""


class _Compiling:
    """A kernel that is being compiled for some types."""

    def __init__(self, form: _Form, sig: Any) -> None:  # noqa: ANN401 - types or a signature
        self.form, self.sig = form, sig
        self.name, self.tree_size = form.disk.name_of(sig, form.targetctx)
        """The digest in the name of its file, which its symbols bear too: Numba numbers functions as they
        come, so that code from another process may bear the number of another function of this one."""
        self.path = form.disk.path_of(self.name)
        self.claim: IO[bytes] | None = None
        self.callees_only = False
        self.inferred: tuple[Any, Any] | None = None
        """The kernel in Numba's form and its types, once a survey has found that all it calls is ready."""
        self.waits = True
        """Whether to wait while another process compiles it."""


class _State(threading.local):
    """What this thread is compiling, the innermost last, and the calls that a survey found."""

    def __init__(self) -> None:
        self.kernels: list[_Compiling] = []
        self.waits = True
        """Whether what is compiled next waits while another process compiles it."""
        self.found: dict[tuple[InnerKernel, tuple[types.Type, ...]], None] | None = None


_state = _State()


class _CompiledElsewhereError(Exception):
    """Another process has just compiled the kernel; holds what it wrote."""


class _CalleesCompiledError(Exception):
    """What a kernel calls is compiled, and no more was asked for."""


@contextmanager
def _compiling(form: _Form, sig: Any) -> Iterator[_Compiling]:  # noqa: ANN401 - types or a signature
    """Note what is being compiled, and keep the collector of garbage away meanwhile.

    Raises:
        numba.core.errors.TypingError: The kernel calls itself.
    """
    outermost = not _state.kernels
    if outermost:
        forget_digests()
        form.targetctx.refresh()
    if _calls_itself(form):
        raise errors.TypingError(
            f"kernel {form.py_func.__qualname__} calls itself; Numba's own njit allows that"
        )
    compiling = _Compiling(form, sig)
    compiling.waits, _state.waits = _state.waits, True  # said of this kernel alone
    _state.kernels.append(compiling)
    collecting = outermost and gc.isenabled()
    # A compiler makes many objects and few cycles: looking for them takes an eighth of its time.
    if collecting:
        gc.disable()
    try:
        with shortcuts(form.targetctx, _infer_once) if outermost else nullcontext():
            yield compiling
    finally:
        _state.kernels.pop()
        release(compiling.claim)
        if collecting:
            gc.enable()


def _calls_itself(form: _Form) -> bool:
    """Return whether a kernel is being compiled already, for the kernel that was asked for last."""
    for compiling in reversed(_state.kernels):
        if compiling.form.py_func is form.py_func:
            return True
        if compiling.callees_only:
            return False
    return False


class KernelCompiler(compiler.Compiler):
    """Numba's compiler; other kernels that it calls come first, and symbols get the name of the file."""

    lowering: type[NativeLowering] = OuterLowering

    def define_pipelines(self) -> list[PassManager]:
        """Return Numba's passes and one more."""
        name = _state.kernels[-1].name
        if name is not None:
            self.state.func_id.unique_id = name
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = list(self.passes_from(pipeline.passes))
            pipeline._finalized = False
            pipeline.finalize()
        return pipelines

    def passes_from(self, passes: list[tuple[Any, str]]) -> Iterator[tuple[Any, str]]:
        """Yield the passes, each with a text."""
        for step, text in passes:
            if step is NopythonTypeInference:
                yield CalleesFirst, "compile what it calls"
            yield (self.lowering if step is NativeLowering else step), text


class InnerKernelCompiler(KernelCompiler):
    """The same, up to the intermediate code, without passes that lean kernels have no use for."""

    lowering = InnerLowering

    def passes_from(self, passes: list[tuple[Any, str]]) -> Iterator[tuple[Any, str]]:
        """Yield the passes, each with a text."""
        lean = not self.state.flags.nrt
        for step, text in super().passes_from(passes):
            if not (lean and step.__name__ in UNUSED_PASSES):
                yield step, text


@register_pass(mutates_CFG=False, analysis_only=True)
class CalleesFirst(AnalysisPass):
    """Compiles the kernels that one calls, and then claims it, so that processes share the work.

    Another process may be at any of them. Then this one goes on with the next, in the end with what the other
    kernels call that were asked for, and comes back. Only what is left then is waited for.
    """

    _name = "callees_first"

    def __init__(self) -> None:
        """Numba makes one object of each pass."""
        super().__init__()

    def run_pass(self, state: Any) -> bool:  # noqa: ANN401 - Numba's bag of everything
        """Compile the kernels that are called, last those that another process is compiling."""
        compiling = _state.kernels[-1]
        within = len(state.typingctx.callstack) > 0
        if second_process.shared() and compiling.tree_size >= _WORTH_DIVIDING and not within:
            left = _compile_callees(state, waits=False)
            if len(_state.kernels) == 1 and not compiling.callees_only:
                for kernel, args in second_process.not_begun():
                    if kernel is not compiling.form:
                        kernel.compile_callees(args)
            if left and not compiling.waits:
                raise ClaimedError
            if left:
                _compile_callees(state, waits=True)
        if compiling.callees_only:
            raise _CalleesCompiledError
        if compiling.path is not None:
            compiling.claim = claim(compiling.path, waits=compiling.waits)
            written = cache.load(compiling.path, compiling.sig)
            if written is not None:
                raise _CompiledElsewhereError(written)
        return False


def _compile_callees(state: Any, *, waits: bool) -> bool:  # noqa: ANN401 - as above
    """Compile the kernels that are called with known types, again while there are new ones.

    Returns:
        Whether some are left, because another process compiles them and this one is not to wait.
    """
    tried, left = set(), False
    while calls := [call for call in _survey(state) if call not in tried]:
        tried.update(calls)
        for kernel, args in reversed(calls) if second_process.serves() else calls:
            _state.waits = waits
            try:
                kernel.compile(args)
            except errors.NumbaError:  # the types may not be the last word; if they are, it is met again
                continue
            except ClaimedError:
                left = True
            finally:
                _state.waits = True
    return left


def _survey(state: Any) -> list[tuple[InnerKernel, tuple[types.Type, ...]]]:  # noqa: ANN401 - as above
    """Return calls of other kernels, neither compiled nor on disk, whose types follow from what is known."""
    _state.found, asked = {}, (state.args, state.return_type, state.locals)
    try:
        inferred = type_inference_stage(
            state.typingctx, state.targetctx, state.func_ir, *asked, raise_errors=False
        )
        unknown = inferred.return_type is None or types.unknown in inferred.typemap.values()
        if not (_state.found or unknown or inferred.typing_errors):
            _state.kernels[-1].inferred = state.func_ir, inferred
    except errors.NumbaError:
        pass
    finally:
        found, _state.found = _state.found, None
    return list(found)


def _infer_once(typing_context: Any, target_context: Any, function: Any, *asked: Any, **options: Any) -> Any:  # noqa: ANN401
    """Infer types as Numba does, unless the latest survey has."""
    inferred = _state.kernels[-1].inferred
    if inferred is not None and inferred[0] is function:
        return inferred[1]
    return type_inference_stage(typing_context, target_context, function, *asked, **options)


class _Form(CPUDispatcher):
    """A kernel in one of its two forms; compiled once for each combination of types, by one process."""

    _compiler: Any
    disk: cache.KernelCache

    def compile(self, sig: Any) -> object:  # noqa: ANN401 - types of arguments, or a signature
        """As Numba's, without timers: those of a whole tree of calls would be told of every call of LLVM."""
        with global_compiler_lock, self._compiling_counter:
            args, return_type = sigutils.normalize_signature(sig)
            known = self.overloads.get(tuple(args))
            if known is not None:
                return known.entry_point
            with _compiling(self, sig) as compiling:
                written = cache.load(compiling.path, sig)
                if written is None:
                    result = self._result(compiling, args, return_type)
                else:
                    result = self._rebuilt(written)
            self._keep(result)
            return result.entry_point

    def _result(self, compiling: _Compiling, args: Any, return_type: Any) -> compiler.CompileResult:  # noqa: ANN401
        try:
            result = self._compiler.compile(args, return_type)
        except _CompiledElsewhereError as found:
            return self._rebuilt(found.args[0])
        cache.save(compiling.path, compiling.sig, result)
        return result

    def is_ready(self, args: tuple[types.Type, ...]) -> bool:
        """Whether it is compiled for these types, here or on disk: then it is taken from there."""
        if args in self.overloads:
            return True
        reduced = cache.load(self.disk.path_of(self.disk.name_of(args, self.targetctx)[0]), args)
        if reduced is not None:
            self._keep(self._rebuilt(reduced))
        return reduced is not None

    def _rebuilt(self, reduced: tuple[Any, ...]) -> compiler.CompileResult:
        """Return a result of compiling from what its `_reduce` gave; each form defines it."""
        raise NotImplementedError

    def _keep(self, result: compiler.CompileResult) -> None:
        """Make a result known to those that call this form; each form defines it."""
        raise NotImplementedError


class InnerKernel(_Form):
    """A kernel as other kernels call it."""

    def __init__(self, kernel: Kernel) -> None:
        """Make the inner form of a kernel."""
        options = {**kernel.targetoptions, **_NO_WRAPPERS}
        super().__init__(kernel.py_func, {}, options, InnerKernelCompiler)
        self.disk = cache.KernelCache(kernel, "inner", kept=not options.get("forceinline", False))

    @property
    def is_compiling(self) -> bool:
        """Never said: Numba would begin to resolve a recursion, which intermediate code cannot hold."""
        return False

    def get_call_template(self, args: Any, kws: Any) -> Any:  # noqa: ANN401 - types of arguments
        """As Numba's, for general types; a survey only notes what would have to be compiled."""
        args, kws = tuple(map(general_type, args)), {name: general_type(kind) for name, kind in kws.items()}
        if _state.found is not None and len(self.typingctx.callstack) == 1:
            folded = tuple(self._compiler.fold_argument_types(args, kws)[1])
            if not self.is_ready(folded):
                _state.found[self, folded] = None
                raise errors.TypingError("not compiled yet")
        return super().get_call_template(args, kws)

    def _rebuilt(self, reduced: tuple[Any, ...]) -> compiler.CompileResult:
        return rebuilt_inner(self.targetctx, reduced)

    def _keep(self, result: compiler.CompileResult) -> None:
        self.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
        self.overloads[tuple(result.signature.args)] = result


class Kernel(_Form):
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
        """Make both forms; nothing is compiled yet."""
        super().__init__(py_func, locals or {}, {**(targetoptions or {}), **_WRAPPERS}, pipeline_class)
        self.disk = cache.KernelCache(self, "outer", kept=True)
        self.inner = InnerKernel(self)
        self.typingctx._remove_global(self)  # Numba takes a dispatcher for one that calls itself
        self.typingctx.insert_global(self, self._numba_type_)

    @property
    def _numba_type_(self) -> types.Type:
        """What other kernels take it for: the inner form."""
        return self.inner._numba_type_

    def compile_callees(self, args: tuple[types.Type, ...]) -> None:
        """Compile the kernels that this one calls for some types, as far as they are not on disk."""
        failures = suppress(Exception)  # whoever compiles the kernel itself meets them
        with global_compiler_lock, failures, _compiling(self, args) as compiling:
            compiling.callees_only, compiling.waits = True, False
            if cache.load(compiling.path, args) is None:
                self._compiler.compile(args, None)

    def _result(self, compiling: _Compiling, args: Any, return_type: Any) -> compiler.CompileResult:  # noqa: ANN401
        """As of every form; says so, and lets the helper take part."""
        second_process.send([(self, tuple(args))])
        with announcement.compiling(self.disk.module_name, kernel_folder()):
            return super()._result(compiling, args, return_type)

    def _rebuilt(self, reduced: tuple[Any, ...]) -> compiler.CompileResult:
        result = compiler.CompileResult._rebuild(self.targetctx, *reduced)
        self.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
        return result

    def _keep(self, result: compiler.CompileResult) -> None:
        """Make it what Python calls; tell the machine code where the environments of inner kernels are."""
        for environment in result._find_referenced_environments():
            result.codegen.set_env(environment.env_name, environment)
        self.add_overload(result)
