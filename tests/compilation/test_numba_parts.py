"""Numba still has the private parts that kernels build on, and they take what they are given."""

import inspect
from types import SimpleNamespace
from typing import Any

import llvmlite.binding as llvm
import pytest
from numba.core import dispatcher
from numba.core.cpu import CPUContext
from numba.core.registry import cpu_target

from entropy_explore_env.compilation.numba_parts import (
    CODE_SETTINGS,
    UNUSED_PASSES,
    BaseFunction,
    ConfigStack,
    CPUDispatcher,
    JITCodeLibrary,
    NativeLowering,
    NopythonTypeInference,
    compiler,
    config,
    type_inference_stage,
    types,
)

CONTEXT: Any = cpu_target.target_context
CPU_CODE = CONTEXT.codegen()


@pytest.mark.parametrize(
    "owner, names",
    [
        (CPUDispatcher, ("compile", "add_overload", "_numba_type_", "_reduce_states", "_rebuild")),
        (JITCodeLibrary, ("_optimize_final_module", "_finalize_final_module", "_finalize_dynamic_globals")),
        (JITCodeLibrary, ("_ensure_finalized", "_get_compiled_object", "_optimize_functions", "codegen")),
        (ConfigStack, ("top_or_none",)),
        (CPUContext, ("mangler", "refresh")),
        (JITCodeLibrary, ("serialize_using_bitcode", "serialize_using_object_code", "enable_object_caching")),
        (compiler.CompileResult, ("_reduce", "_rebuild", "_find_referenced_environments")),
        (compiler.Compiler, ("define_pipelines",)),
        (compiler.Flags, ("copy", "nrt", "forceinline", "no_compile", "summary")),
        (vars(dispatcher)["_FunctionCompiler"], ("compile", "fold_argument_types", "_customize_flags")),
        (NativeLowering, ("run_pass",)),
        (types, ("unliteral", "signed_domain", "NestedArray", "Array")),
        (CPU_CODE, ("_tm", "_data_layout")),
        (CONTEXT.typing_context.callstack, ("__len__",)),
        (llvm, ("parse_bitcode", "parse_assembly", "create_pass_builder", "create_pipeline_tuning_options")),
    ],
)
def test_what_is_overridden_or_called_exists(owner, names):
    assert [name for name in names if not hasattr(owner, name)] == []


def test_what_is_called_takes_what_it_is_given():
    def parameters(function):
        return list(inspect.signature(function).parameters)

    assert parameters(CPUDispatcher.__init__)[1:] == ["py_func", "locals", "targetoptions", "pipeline_class"]
    rebuilt = "libdata fndesc env signature objectmode lifted typeann reload_init referenced_envs".split()
    assert parameters(compiler.CompileResult._rebuild)[1:] == rebuilt
    assert parameters(BaseFunction.get_call_type) == ["self", "context", "args", "kws"]
    assert parameters(CPUContext.mangler) == ["self", "name", "types", "abi_tags", "uid"]
    assert parameters(CPUDispatcher.compile) == ["self", "sig"]
    assert parameters(CPUDispatcher.get_call_template) == ["self", "args", "kws"]
    inferred = ["typingctx", "targetctx", "interp", "args", "return_type", "locals"]
    assert parameters(type_inference_stage)[:6] == inferred


def test_settings_of_numba_that_change_code_are_known():
    assert [name for name in CODE_SETTINGS if not hasattr(config, name)] == []


def test_passes_that_are_left_out_are_numbas():
    flags = compiler.Flags()
    state = SimpleNamespace(func_ir=None, flags=flags)
    passes = {step.__name__ for step, _ in compiler.DefaultPassBuilder.define_nopython_pipeline(state).passes}
    assert passes >= UNUSED_PASSES
    assert {NativeLowering.__name__, NopythonTypeInference.__name__} <= passes
