"""The command `baselines.run` in this process, for the tests of what it prints and writes."""

from __future__ import annotations

import json

import pytest

from baselines import run
from baselines.cli.arguments import run_command
from tests.baselines.ran import Ran


@pytest.fixture
def command(capsys):
    def ran(*words: str) -> Ran:
        code = run_command(run.main, words)
        return Ran(code, *capsys.readouterr())

    return ran


@pytest.fixture
def figures(command):
    def printed(*words: str) -> dict:
        ran = command("box-7x11x5", *words, "--json")
        assert (ran.code, ran.err) == (0, "")
        return json.loads(ran.out, parse_constant=pytest.fail)

    return printed
