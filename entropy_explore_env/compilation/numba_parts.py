"""The parts of Numba that are not documented and that kernels build on, named here and nowhere else.

`tests/compilation/test_numba_parts.py` fails when one of them disappears or takes other arguments, and
pyproject.toml bounds Numba's versions to those that were tested.
"""

from __future__ import annotations

from numba.core import compiler as compiler
from numba.core import config as config
from numba.core import errors as errors
from numba.core import sigutils as sigutils
from numba.core import typed_passes as typed_passes
from numba.core import types as types
from numba.core.codegen import JITCodeLibrary as JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock as global_compiler_lock
from numba.core.compiler_machinery import AnalysisPass as AnalysisPass
from numba.core.compiler_machinery import PassManager as PassManager
from numba.core.compiler_machinery import register_pass as register_pass
from numba.core.dispatcher import Dispatcher as Dispatcher
from numba.core.funcdesc import default_mangler as default_mangler
from numba.core.registry import CPUDispatcher as CPUDispatcher
from numba.core.serialize import dumps as dumps
from numba.core.targetconfig import ConfigStack as ConfigStack
from numba.core.typed_passes import NativeLowering as NativeLowering
from numba.core.typed_passes import NopythonTypeInference as NopythonTypeInference
from numba.core.typed_passes import type_inference_stage as type_inference_stage
from numba.core.types.functions import BaseFunction as BaseFunction

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
