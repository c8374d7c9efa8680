"""Work that Numba repeats for each kernel, and that is done once here while kernels are compiled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.extending import lower_cast

from entropy_explore_env.compilation.numba_parts import (
    BaseFunction,
    ConfigStack,
    default_mangler,
    type_inference_stage,
    typed_passes,
    types,
)

_known: dict[tuple[Any, ...], Any] = {}
"""Signatures of Numba's own functions, by function, types of arguments and options."""
_resolve = BaseFunction.get_call_type


def _resolve_once(function: Any, context: Any, args: Any, kws: Any) -> Any:  # noqa: ANN401 - as Numba has them
    """Return the signature of a function of Numba's for some types, as `get_call_type` does.

    For each addition Numba goes through some thirty templates, of dates, lists and texts among them.
    """
    options = ConfigStack.top_or_none()
    given = None if options is None else options.summary()
    key = function, context, tuple(args), tuple(kws.items()), given
    signature = _known.get(key)
    if signature is None:
        signature = _known[key] = _resolve(function, context, args, kws)
    return signature


def _short_name(name: str, types: Any, *, abi_tags: Any = (), uid: Any = None) -> str:  # noqa: ANN401
    """Return the symbol of a function; that of a kernel with a stamp leaves out types, which the stamp holds.

    Types of a mission's state take thousands of letters, in each call of each kernel.
    """
    return default_mangler(name, () if isinstance(uid, str) else types, abi_tags=abi_tags, uid=uid)


@contextmanager
def shortcuts(target_context: Any, infer: Callable[..., Any]) -> Iterator[None]:  # noqa: ANN401 - of Numba
    """Let Numba take the shortcuts; its lock of compiling is held meanwhile.

    Args:
        target_context: Of the kernels that are compiled.
        infer: In place of `type_inference_stage`.
    """
    functions: Any = BaseFunction
    functions.get_call_type, target_context.mangler = _resolve_once, _short_name
    typed_passes.type_inference_stage = infer
    try:
        yield
    finally:
        functions.get_call_type, typed_passes.type_inference_stage = _resolve, type_inference_stage
        del target_context.mangler


def general_type(kind: types.Type) -> types.Type:
    """Return the type for which a kernel is compiled when it is called with this one.

    Constants, short integers and fields of records have types of their own. Each would be compiled apart,
    into code that does the same.
    """
    kind = types.unliteral(kind)
    if isinstance(kind, types.NestedArray):
        return types.Array(kind.dtype, kind.ndim, kind.layout)
    if kind in types.signed_domain:
        return types.int64
    return kind


@lower_cast(types.NestedArray, types.Array)
def _field_to_array(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:  # noqa: ANN401
    """Return a field of a record as an array: Numba holds both in the same form."""
    return value
