"""The parts of Numba that are not documented and that kernels build on, named here and nowhere else.

`tests/compilation/test_numba_parts.py` fails when one of them disappears or takes other arguments, and
pyproject.toml bounds Numba's versions to those that were tested.
"""

from __future__ import annotations

from numba.core import compiler, config, errors, sigutils, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import AnalysisPass, PassManager, register_pass
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps
from numba.core.typed_passes import NativeLowering, NopythonTypeInference, type_inference_stage

__all__ = [
    "CODE_SETTINGS",
    "UNUSED_PASSES",
    "AnalysisPass",
    "CPUDispatcher",
    "Dispatcher",
    "JITCodeLibrary",
    "NativeLowering",
    "NopythonTypeInference",
    "PassManager",
    "compiler",
    "config",
    "dumps",
    "errors",
    "global_compiler_lock",
    "register_pass",
    "sigutils",
    "type_inference_stage",
    "types",
]

CODE_SETTINGS = (
    "OPT",
    "BOUNDSCHECK",
    "LOOP_VECTORIZE",
    "SLP_VECTORIZE",
    "DEBUGINFO_DEFAULT",
    "ENABLE_PROFILING",
)
"""Numba's settings, by environment variables, that change the code that it makes."""

UNUSED_PASSES = frozenset(
    {
        "WithLifting",
        "InlineClosureLikes",
        "RewriteDynamicRaises",
        "MakeFunctionToJitFunction",
        "InlineInlinables",
        "FindLiterallyCalls",
        "LiteralUnroll",
        "LiteralPropagationSubPipelinePass",
        "InlineOverloads",
        "NopythonRewrites",
        "AnnotateTypes",
        "DumpParforDiagnostics",
    }
)
"""Passes for closures, `with`, literals and expressions of arrays, which lean kernels have none of."""
