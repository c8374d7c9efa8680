"""What docstrings say of fields: the `Attributes:` section of a class, and the text below a constant."""

from __future__ import annotations

import ast
import inspect
import itertools
import re
import textwrap
from types import ModuleType

_ENTRY = re.compile(r"^(\w+(?:, \w+)*): (.*)$")


def attribute_docs(of: type) -> dict[str, str]:
    """Field → its text in the class docstring's `Attributes:` section, on one line.

    An entry may speak of several fields, `robot, sensor: …`; each of them gets its text.
    """
    _, _, section = inspect.cleandoc(of.__doc__ or "").partition("\nAttributes:\n")
    section = re.split(r"\n(?=\S)", section)[0]  # another section may follow
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in textwrap.dedent(section).splitlines():
        entry = _ENTRY.match(line)
        if entry is not None:
            names = entry[1].split(", ")
            texts |= dict.fromkeys(names, entry[2])
        elif line.strip():
            texts |= {name: f"{texts[name]} {line.strip()}" for name in names}
    return texts


def constant_docs(module: ModuleType) -> dict[str, str]:
    """Name of a constant → the string that follows its assignment in the module, on one line."""
    texts: dict[str, str] = {}
    body = ast.parse(inspect.getsource(module)).body
    for before, after in itertools.pairwise(body):
        if not isinstance(before, ast.Assign | ast.AnnAssign) or not isinstance(after, ast.Expr):
            continue
        target = before.targets[0] if isinstance(before, ast.Assign) else before.target
        if (
            isinstance(target, ast.Name)
            and isinstance(after.value, ast.Constant)
            and isinstance(after.value.value, str)
        ):
            texts[target.id] = " ".join(after.value.value.split())
    return texts
