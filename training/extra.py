"""Says in one line what is missing without the extra `training`; imported before what needs it."""

from __future__ import annotations

import importlib.util
import sys

from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.errors import MissingExtraError

PACKAGES = ("torch", "stable_baselines3", "safetensors", "docstring_parser")
_MISSING = next((name for name in PACKAGES if importlib.util.find_spec(name) is None), None)
if _MISSING is not None:
    _error = MissingExtraError(_MISSING, "training")
    _command = getattr(sys.modules["__main__"], "__spec__", None)
    if _command is None or not _command.name.startswith("training."):
        raise _error
    print(f"error: {_error}", file=sys.stderr)
    raise SystemExit(BAD_INPUT)
