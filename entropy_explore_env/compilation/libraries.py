"""The code of kernels in both forms: how it is made, what is kept of it on disk, and how it comes back.

An inner kernel is intermediate code that other kernels link, an outer one is machine code that nothing links.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import llvmlite.binding as llvm

from entropy_explore_env.compilation.numba_parts import (
    JITCodeLibrary,
    NativeLowering,
    compiler,
    register_pass,
)


class InnerLibrary(JITCodeLibrary):
    """The intermediate code of an inner kernel and of all that it calls: not translated.

    It is simplified a little, function by function, and optimised with the outermost kernel. Inlined kernels,
    the innermost loops, are optimised before that, too: code that was optimised once traces rays 10 % slower.
    """

    optimised = False
    """Whether it is an inlined kernel."""

    def _optimize_functions(self, ll_module: Any) -> None:  # noqa: ANN401 - of LLVM
        """Simplify functions at the lowest level; the rest is done to the outermost kernel anyway."""
        ll_module.data_layout = self.codegen._data_layout
        builder = llvm.create_pass_builder(self.codegen._tm, llvm.create_pipeline_tuning_options(1))
        for function in _defined(ll_module.functions):
            builder.getFunctionPassManager().run(function, builder)

    def enable_object_caching(self) -> None:
        """There is no object code."""

    def _optimize_final_module(self) -> None:
        if self.optimised:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return what is kept of it."""
        return self.serialize_using_bitcode()

    @classmethod
    def from_bitcode(cls, codegen: Any, state: tuple[str, str, bytes]) -> InnerLibrary:  # noqa: ANN401
        """Return what `serialize_using_object_code` was made of, ready to be linked."""
        name, _, bitcode = state
        library = cls(codegen, name)
        library._final_module = llvm.parse_bitcode(bitcode)
        library._finalize_final_module()
        return library


class OuterLibrary(JITCodeLibrary):
    """The machine code of what Python calls, kept on disk without intermediate code: nothing links it."""

    def _optimize_functions(self, ll_module: Any) -> None:  # noqa: ANN401 - of LLVM
        """Leave it to the passes over the whole module."""
        ll_module.data_layout = self.codegen._data_layout

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """Return what is kept of it: the machine code, and the names that it defines."""
        self._ensure_finalized()
        return self.name, "object", (self._get_compiled_object(), _names_alone(self._final_module))


def _names_alone(module: Any) -> bytes:  # noqa: ANN401 - of LLVM
    """Return the bitcode of a module that defines the same names and holds nothing else."""
    functions = [f"define void @{_quoted(one.name)}() {{ ret void }}" for one in _defined(module.functions)]
    variables = [f"@{_quoted(one.name)} = global i8 0" for one in _defined(module.global_variables)]
    return llvm.parse_assembly("\n".join(functions + variables)).as_bitcode()


def _defined(values: Iterable[Any]) -> Iterator[Any]:
    return (value for value in values if not value.is_declaration)


def _quoted(name: str) -> str:
    """Return a name as LLVM's assembly writes it."""
    letters = (chr(byte) if byte < 128 and chr(byte).isalnum() else f"\\{byte:02x}" for byte in name.encode())
    return f'"{"".join(letters)}"'


@register_pass(mutates_CFG=True, analysis_only=False)
class OuterLowering(NativeLowering):
    """Lowers into an `OuterLibrary`."""

    _name = "outer_lowering"

    def run_pass(self, state: Any) -> bool:  # noqa: ANN401 - Numba's bag of everything
        """Lower as Numba does."""
        state.library = OuterLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().run_pass(state)


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


def rebuilt_inner(target_context: Any, reduced: tuple[Any, ...]) -> compiler.CompileResult:  # noqa: ANN401
    """Return the inverse of `CompileResult._reduce` for an inner kernel."""
    library, fndesc, environment, signature, objectmode, lifted, annotation, reload_init, environments = (
        reduced
    )
    for function in reload_init:
        function()
    return compiler.compile_result(
        typing_context=target_context.typing_context,
        target_context=target_context,
        entry_point=object(),
        type_annotation=annotation,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        fndesc=fndesc,
        library=InnerLibrary.from_bitcode(target_context.codegen(), library),
        environment=environment,
        reload_init=reload_init,
        referenced_envs=environments,
    )
