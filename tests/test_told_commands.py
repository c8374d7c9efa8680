"""Commands in README.md, CONTRIBUTING.md and on the site can be typed: module, options and targets are there.

Values are not checked; `python -m tests.new_user` runs some of the commands.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import itertools
import re
import shlex
from pathlib import Path

import pytest

from baselines.cli.options import options_of
from entropy_explore_env.__main__ import PARTS
from tests.code_blocks import PAGES, ROOT

OUTSIDE = ("pip", "pytest", "venv", "tests")
"""Packages whose options are not checked."""
_TARGETS = set(re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text("utf-8"), flags=re.MULTILINE))
_COMMAND = re.compile(r"(?:\w+=\S+ )*(?:\S*python3? -m |entropy-explore-env |make )[^`\n]*")
_VARIABLE = re.compile(r"[A-Z_]+=")
_OPTION = re.compile(r"--[a-z][\w.-]*")


def told_in(text: str) -> list[list[str]]:
    """Return the commands of a page: indented or fenced lines, and what is quoted in a sentence."""
    text = re.sub(r"\\\n\s*", " ", text)
    blocks = re.findall(rf"^(?: {{4,}}|\$ )?({_COMMAND.pattern})$", text, flags=re.MULTILINE)
    quoted = (" ".join(words.split()) for words in re.findall(r"`([^`]+)`", text))
    told = [*blocks, *(words for words in quoted if _COMMAND.fullmatch(words))]
    split = (itertools.dropwhile(_VARIABLE.match, shlex.split(line, comments=True)) for line in told)
    return [list(words) for words in dict.fromkeys(map(tuple, split))]


def options_of_command(module: str, words: list[str]) -> set[str]:
    """Return the options that a command takes."""
    if module == "entropy_explore_env":
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
            importlib.import_module(PARTS[words[0]][0]).main([*words[1:2], "--help"])
        return {*_OPTION.findall(said.getvalue())}
    file = importlib.import_module(module if _file(module).is_file() else f"{module}.__main__")
    classes = [getattr(file, name) for name in ("Args", "BagArgs") if hasattr(file, name)]
    options = [option for args in classes for option in options_of(args, args())]
    return {flag for option in options for flag in (option.flag, option.opposite)}


def _file(module: str) -> Path:
    return (ROOT / Path(*module.split("."))).with_suffix(".py")


def faults(words: list[str]) -> list[str]:
    """Return the parts of a command that do not exist."""
    if words[0] == "make":
        return [word for word in words[1:] if word not in _TARGETS and not _VARIABLE.match(word)]
    ours = words[0] == "entropy-explore-env"
    module, given = ("entropy_explore_env", words[1:]) if ours else (words[2], words[3:])
    if module.split(".")[0] in OUTSIDE:
        return []
    if not _file(module).is_file() and not (_file(module).with_suffix("") / "__main__.py").is_file():
        return [module]
    if module == "entropy_explore_env" and given and given[0] not in (*PARTS, "--version"):
        return given[:1]
    asked = {option for word in given for option in _OPTION.findall(word.partition("=")[0])}
    asked -= {"--help", "--version"}
    return sorted(asked - options_of_command(module, given)) if asked else []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_commands_of_a_page_can_be_typed(page):
    commands = told_in(page.read_text("utf-8"))
    assert {shlex.join(words): found for words in commands if (found := faults(words))} == {}


def test_commands_beside_a_target_are_those_of_the_makefile():
    made = " ".join((ROOT / "Makefile").read_text("utf-8").split())
    text = "".join(re.sub(r"\\\n\s*", " ", page.read_text("utf-8")) for page in PAGES)
    beside = re.findall(r"^ {4}python -m ([^#\n]+?) +# [^\n]*make ([a-z]+)$", text, flags=re.MULTILINE)
    assert {target for _, target in beside} >= {"policy", "predictor"}
    for command, target in beside:
        assert re.search(rf" {target}: [^:]*\$\(RUN\) {re.escape(' '.join(command.split()))} ", made), command


def test_workflows_make_what_the_makefile_has():
    texts = [path.read_text("utf-8") for path in (ROOT / ".github").rglob("*.yml")]
    made = {
        target for text in texts for target in re.findall(r"\brun: make ([\w-]+)$", text, flags=re.MULTILINE)
    }
    assert made and made <= _TARGETS
