"""The help of a command: the usual options on a screen, the others by part with `--help PART`."""

from __future__ import annotations

import inspect
import re
import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from baselines.cli.options import Option
from entropy_explore_env.command import UsageError
from entropy_explore_env.errors import counted, did_you_mean

_ALL, _OTHERS = "all", "others"
_LEFT = 25
"""Columns of flags beside their text; a longer flag has a line of its own."""
_WIDEST = 110


def help_text(
    program: str,
    description: str,
    options: Sequence[Option],
    usual: Sequence[str] = (),
    topic: str | None = None,
) -> str:
    """Return the help of a command.

    Args:
        program: What the options follow.
        description: Paragraphs; indented lines are kept as they are.
        options: All options.
        usual: Names of those that the short help shows; empty = all but those of parts.
        topic: A part, the name of an option, or `all`; None = the short help.

    Raises:
        UsageError: There is no such part and no such option.
    """
    width = min(shutil.get_terminal_size().columns, _WIDEST)
    parts = _parts(options, usual)
    if topic is not None:
        return "\n".join(_on(topic, options, parts, width))
    shown = [option for option in options if _is_usual(option, usual)]
    shown.sort(key=lambda option: usual.index(option.name) if usual else 0)
    words = "".join(f" [{_upper(option)}]" for option in options if option.positional)
    lines = [f"usage: {program}{words} [OPTIONS]", "", *_paragraphs(description, width), ""]
    for option in shown:
        lines += _entry(option, width)
    lines += _entry_of("-h, --help [PART]", "This help, or that of a part of the options.", width)
    if parts:
        lines += ["", f"More options: {program} --help PART, where PART is"]
        for name, inside in parts.items():
            lines += _entry_of(name, _summary(inside), width)
        lines += _entry_of(_ALL, "all options", width)
    return "\n".join(lines)


def _is_usual(option: Option, usual: Sequence[str]) -> bool:
    return option.name in usual if usual else option.part is None


def _parts(options: Sequence[Option], usual: Sequence[str]) -> dict[str, list[Option]]:
    """Return the options that the short help leaves out, by part."""
    parts: dict[str, list[Option]] = {}
    for option in options:
        if option.part is not None or not _is_usual(option, usual):
            name = _OTHERS if option.part is None else option.part.name
            parts.setdefault(name, []).append(option)
    return parts


def _on(topic: str, options: Sequence[Option], parts: dict[str, list[Option]], width: int) -> list[str]:
    """Return the lines about a part, or about the options with a name."""
    name = topic.lstrip("-").replace("_", "-")
    if name == _ALL:
        found = list(options)
    elif name in parts:
        found = parts[name]
    else:
        found = [option for option in options if option.flag[2:] == name]
        found = found or [option for option in options if name in option.flag]
    if not found:
        known = [*parts, _ALL]
        meant = did_you_mean(name, [*known, *(option.flag[2:] for option in options)])
        raise UsageError(
            f"--help {topic}: expected one of {', '.join(known)}, or the name of an option{meant}"
        )
    return [line for option in found for line in _entry(option, width, whole=True)]


def _summary(options: Sequence[Option]) -> str:
    """Return what the options of a part are about, and their number."""
    part = options[0].part
    about = "What is less often given." if part is None else part.text
    return f"{re.split('[:;.(]', about)[0].strip()} ({counted(len(options), 'option')})"


def _entry(option: Option, width: int, whole: bool = False) -> list[str]:
    """Return the lines about an option; in the short help the first paragraph of its text alone."""
    text = option.text if whole else option.text.split("\n")[0]
    default = _default(option)
    if default and "default" not in text:
        text += ("\n" if "\n" in text else " ") + f"(default: {default})"
    return _entry_of(_typed(option), text, width)


def _typed(option: Option) -> str:
    """Return the form of an option on a command line, such as `--size INT INT`."""
    if option.positional:
        return _upper(option)
    if option.kind is bool:
        return f"{option.flag}, {option.opposite}" if option.default is True else option.flag
    shown, count = option.values.shown, option.values.count
    words = f"{shown} ..." if count == "*" else " ".join([shown] * int(count or 1))
    return f"{option.flag} {words}"


def _upper(option: Option) -> str:
    return option.name.upper() + (" ..." if option.values.count == "*" else "")


def _entry_of(left: str, text: str, width: int) -> list[str]:
    """Return lines with something on the left, and its text wrapped on the right."""
    indent = " " * (_LEFT + 3)
    wrapped = (textwrap.wrap(part, width - len(indent), break_on_hyphens=False) for part in text.split("\n"))
    lines = [line for paragraph in wrapped for line in paragraph or [""]]
    if len(left) > _LEFT:
        return [f"  {left}", *(indent + line for line in lines)]
    return [f"  {left:<{_LEFT}} {lines[0]}", *(indent + line for line in lines[1:])]


def _default(option: Option) -> str:
    """Return the words of an option's default on a command line; empty if it has no default."""
    value = option.default
    if value is None or value is False or value in ((), [], ""):
        return ""
    if value is True:
        return option.flag
    return " ".join(_shown(each) for each in (value if isinstance(value, tuple | list) else (value,)))


def _shown(value: Any) -> str:  # noqa: ANN401
    if isinstance(value, float):
        return f"{value:g}"
    return value.name if isinstance(value, Path) and value.is_absolute() else str(value)


def _paragraphs(text: str, width: int) -> list[str]:
    """Return a docstring's paragraphs wrapped, and its indented lines as they are."""
    lines: list[str] = []
    for paragraph in inspect.cleandoc(text).split("\n\n"):
        kept = paragraph.startswith(" ")
        lines += [*(paragraph.split("\n") if kept else textwrap.wrap(paragraph, width)), ""]
    return lines[:-1]
