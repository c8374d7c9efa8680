"""Commands that README.md and the site's pages tell of can be typed.

Of every command, in a block or quoted in a sentence, this proves that the module, script or target is there,
that each option is one that the command's own help lists, and that files of the checkout that it names exist.
Of a piece of one, as `--jobs 4`, that some command told of has the option. It proves nothing of values, of
other arguments, or of what a command does; `python -m tests.new_user` runs some of them.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import io
import itertools
import re
import shlex
from pathlib import Path

import pytest

from tests.code_blocks import ROOT

OUTSIDE = {
    "pip": "what installs",
    "pytest": "what tests",
    "venv": "what makes environments",
}
"""Modules that are not ours → what they are: told as they stand."""
PAGES = [
    page
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
    if not {ROOT / "docs" / "scenarios", ROOT / "docs" / "build"}.intersection(page.parents)
]
"""All but scenario cards, which are written from the code."""
_CONFIGURATION = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
_MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
_SCRIPTS = {
    name: module.removesuffix(".__main__")
    for name, module in re.findall(r'^([\w-]+) = "([\w.]+):command"$', _CONFIGURATION, flags=re.MULTILINE)
}
_TARGETS = set(re.findall(r"^([a-z][\w-]*):", _MAKEFILE, flags=re.MULTILINE))
_RUNS = re.compile(
    r"(?:\w+=\S+ )*"
    r"(?:(?:\S*/)?python3? -m [\w.]+|(?:\S*/)?entropy-explore-[\w-]+(?![\w/-])|make [a-z]|--[a-z])"
)
"""How a command begins, or a piece of one that starts with an option."""
_FENCED = re.compile(r"^ *```.*?^ *```", flags=re.DOTALL | re.MULTILINE)
_INLINE = re.compile(r"`([^`]+)`")
_OPTION = re.compile(r"(?<![\w-])--[a-z][\w.-]*")
_VARIABLE = re.compile(r"[A-Z_]+=")
_OURS = re.compile(r"(?<![\w./-])(?:docs|baselines|training|tests)/[^\s:,=]*")


def told_in(text: str) -> list[tuple[str, ...]]:
    """The commands of a page: lines of fenced and of indented blocks, and what is quoted in a sentence."""
    text = re.sub(r"\\\n\s*", " ", text)
    lines = [line.strip() for block in _FENCED.findall(text) for line in block.splitlines()]
    prose = []
    for line in _FENCED.sub("", text).splitlines():
        indented = line.startswith("    ") and _RUNS.match(line.strip())
        (lines if indented else prose).append(line.strip())
    lines += [" ".join(quoted.split()) for quoted in _INLINE.findall("\n".join(prose))]
    return [tuple(shlex.split(line, comments=True)) for line in lines if _RUNS.match(line)]


def module_of(words: tuple[str, ...]) -> tuple[str | None, tuple[str, ...]]:
    """The module that a command runs, and the words that it gets; None = another kind of command."""
    if words[1:2] == ("-m",):
        return words[2], words[3:]
    return _SCRIPTS.get(words[0].rpartition("/")[2]), words[1:]


@functools.cache
def help_of(module: str, *words: str) -> str:
    """What a command says to `--help`, asked in this process: what commands share is imported once.

    Args:
        module: As after `python -m`.
        words: Those before `--help`, of a command that has commands of its own.
    """
    inside = ".__main__" if _file_of(module).name == "__main__.py" else ""
    command = importlib.import_module(module + inside)
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        command.main([*words, "--help"])
    return said.getvalue()


def _file_of(module: str) -> Path:
    """The file that `python -m` runs."""
    path = ROOT / Path(*module.split("."))
    return path / "__main__.py" if path.is_dir() else path.with_suffix(".py")


def options_of(module: str, words: tuple[str, ...]) -> set[str]:
    """The options that a command takes; if it has commands of its own, with those of the one asked for."""
    text = help_of(module)
    commands = {name for names in re.findall(r"\{([\w,-]+)\}", text) for name in names.split(",")}
    if words and words[0] in commands:
        text += help_of(module, words[0])
    lists = [line.strip("│ ") for line in text.splitlines()]
    named = [line.partition("  ")[0] for line in lists if line.startswith("-")]
    return {option for line in named for option in _OPTION.findall(line)}


def faults(words: tuple[str, ...]) -> list[str]:
    """What of a command is not there."""
    words = tuple(itertools.dropwhile(_VARIABLE.match, words))  # of the environment
    module, given = module_of(words)
    given = given if module else words
    missing = [path for word in words for path in _OURS.findall(word) if not (ROOT / path).exists()]
    if words[0] == "make":
        variables = {word: f"$({word.partition('=')[0]})" for word in words[1:] if _VARIABLE.match(word)}
        missing += [word for word in words[1:] if word not in {*_TARGETS, *variables}]
        return missing + [word for word, used in variables.items() if used not in _MAKEFILE]
    if module is None and not words[0].startswith("-"):
        return [*missing, words[0]]
    if module in OUTSIDE:
        return missing
    if module is not None and not _file_of(module).exists():
        return [*missing, module]
    asked = [
        option for word in given for option in _OPTION.findall(word.partition("=")[0]) if "…" not in word
    ]
    if asked:
        missing += sorted({*asked} - (options_of(module, given) if module else options_of_all()))
    return missing


@functools.cache
def options_of_all() -> frozenset[str]:
    """The options of all commands that pages give options."""
    commands = [module_of(words) for page in PAGES for words in told_in(page.read_text(encoding="utf-8"))]
    ours = {
        (module, words)
        for module, words in commands
        if module not in (None, *OUTSIDE) and _file_of(module).exists() and _OPTION.search(" ".join(words))
    }
    return frozenset(option for module, words in ours for option in options_of(module, words))


@pytest.fixture(autouse=True)
def one_column(monkeypatch):
    """Help of a width at which options stand below each other, whatever the terminal."""
    monkeypatch.setenv("COLUMNS", "90")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_commands_of_a_page_can_be_typed(page):
    commands = told_in(page.read_text(encoding="utf-8"))
    assert {shlex.join(words): found for words in commands if (found := faults(words))} == {}


def test_commands_are_found_wherever_they_stand():
    page = """
Run `python -m a.b --c
d` or `--jobs 4`, not `name`.

    .venv/bin/python -m pytest  # all
    entropy-explore-env doctor
    and so on

- in a list:
    `make docs`

```bash
FAST=1 make test
python -m c --d \\
    e
```
"""
    assert sorted(map(shlex.join, told_in(page))) == sorted(
        [
            "python -m a.b --c d",
            "--jobs 4",
            ".venv/bin/python -m pytest",
            "entropy-explore-env doctor",
            "make docs",
            "FAST=1 make test",
            "python -m c --d e",
        ]
    )
    assert sum(len(told_in(page.read_text(encoding="utf-8"))) for page in PAGES) > 200


@pytest.mark.parametrize(
    ("command", "missing"),
    [
        ("python -m baselines.run room --robots 2 --channel.burst 32", []),
        ("python -m baselines.run room --robot 2 --channel.bursts=32", ["--channel.bursts", "--robot"]),
        ("python -m baselines.runs room", ["baselines.runs"]),
        (".venv/bin/python -m baselines.replay mission.npz --jobs 2", ["--jobs"]),
        ("python -m entropy_explore_env.worlds show office --seed 1 --wings", ["--wings"]),
        ("entropy-explore-worlds list --seed 1", ["--seed"]),
        ("entropy-explore-world list", ["entropy-explore-world"]),
        ("python -m pip install -e . --no-deps", []),
        (
            "python -m baselines.run room --strategy docs/examples/own_strategy.py:A --out docs/no",
            ["docs/no"],
        ),
        ("FAST=1 make demo STRATEGY=gradient", []),
        ("make demos STRATEGIES=gradient", ["demos", "STRATEGIES=gradient"]),
        ("--jobs 2 --wings", ["--wings"]),
        ("--channel.…", []),
        ("--archive docs/results/none.xz", ["docs/results/none.xz"]),
    ],
)
def test_what_is_not_there_is_named(command, missing):
    assert faults(tuple(shlex.split(command))) == missing


def test_workflows_make_what_the_makefile_has():
    texts = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / ".github").rglob("*.yml")}
    made = {
        name: re.findall(r"\brun: make ([\w-]+)$", text, flags=re.MULTILINE) for name, text in texts.items()
    }
    assert {target for targets in made.values() for target in targets} <= _TARGETS
    regularly = {target for name, text in texts.items() if "schedule:" in text for target in made[name]}
    assert regularly == {"docs-links", "night"}


def test_the_page_of_speed_says_which_commands_share_missions_among_processes():
    page = (ROOT / "docs" / "speed.md").read_text(encoding="utf-8")
    (row,) = re.findall(r"\*\*Long jobs\.\*\*(.*?)\n(?:- |\n)", page, flags=re.DOTALL)
    named = {name: "--jobs" in options_of(name, ()) for name in re.findall(r"`((?:\w+\.)+\w+)`", row)}
    assert len(named) > 2 and all(named.values())
    assert "--jobs" in options_of("baselines.papers", ())
