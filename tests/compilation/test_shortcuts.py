"""What Numba takes as a shortcut while kernels are compiled gives what it finds without."""

import operator
from typing import Any

import pytest
from numba.core import errors, types
from numba.core.registry import cpu_target

from entropy_explore_env.compilation.numba_parts import BaseFunction, type_inference_stage
from entropy_explore_env.compilation.shortcuts import shortcuts

CPU: Any = cpu_target
CONTEXT, TARGET = CPU.typing_context, CPU.target_context


@pytest.mark.parametrize(
    "function, args",
    [
        (operator.add, (types.int64, types.float32)),
        (operator.add, (types.int32, types.int32)),
        (operator.lt, (types.float32, types.int64)),
        (operator.getitem, (types.Array(types.float64, 2, "A"), types.UniTuple(types.intp, 2))),
        (operator.getitem, (types.Array(types.float32, 2, "C"), types.UniTuple(types.intp, 2))),
        (max, (types.float64, types.int64)),
    ],
)
def test_functions_have_the_same_signature(function, args):
    TARGET.refresh()
    kind = CONTEXT.resolve_value_type(function)
    expected = kind.get_call_type(CONTEXT, args, {})
    with shortcuts(TARGET, type_inference_stage):
        for _ in range(2):
            found = kind.get_call_type(CONTEXT, args, {})
            assert (found.args, found.return_type) == (expected.args, expected.return_type)
            assert kind.get_impl_key(found) == kind.get_impl_key(expected)


def test_what_has_no_signature_is_refused_each_time():
    kind = CONTEXT.resolve_value_type(operator.add)
    with shortcuts(TARGET, type_inference_stage):
        for _ in range(2):
            with pytest.raises(errors.TypingError, match="No implementation"):
                kind.get_call_type(CONTEXT, (types.float64, types.none), {})


def test_symbols_leave_out_types_where_the_stamp_holds_them():
    args = types.UniTuple(types.int64, 3), types.Array(types.float64, 2, "C")
    long = TARGET.mangler("module.f", args, uid="1a2b")
    with shortcuts(TARGET, type_inference_stage):
        assert "Array" in TARGET.mangler("module.f", args, uid=7)
        assert "Array" not in TARGET.mangler("module.f", args, uid="1a2b")
        assert TARGET.mangler("module.f", args, uid="1a2b") != TARGET.mangler("module.f", args, uid="1a2c")
    assert TARGET.mangler("module.f", args, uid="1a2b") == long


def test_afterwards_numba_is_as_it_was():
    before = BaseFunction.get_call_type
    with pytest.raises(ZeroDivisionError), shortcuts(TARGET, type_inference_stage):
        assert BaseFunction.get_call_type is not before
        raise ZeroDivisionError
    assert BaseFunction.get_call_type is before
    assert "mangler" not in vars(TARGET)
