"""What the papers' commands share: options, what is noted of them, exit codes."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from baselines.cli.arguments import given_options, parse
from baselines.experiments.claims import Claim
from baselines.experiments.reproduction import (
    PaperArgs,
    Reproduced,
    check_counts,
    command_line,
    reproduce,
)
from entropy_explore_env.errors import SettingError


@dataclass
class Args(PaperArgs):
    """Reproduce something."""

    out: Path = Path("results/paper")
    small_plans: int | None = None
    """How many."""
    maps: tuple[Path, ...] = ()
    """Which."""
    limit_s: float = 5.0
    """How long."""


def test_the_noted_command_has_what_was_given_and_not_where_files_lie():
    words = "--quick --small-plans 3 --maps a/b.yaml c/d.png --limit-s 2.50 --jobs 2 --json".split()
    args = parse(Args, [*words, "--runs", "kept", "--out", "there"])
    noted = "--quick --small-plans 3 --maps b.yaml d.png --limit-s 2.5 --out there"
    assert command_line("paper", args) == f"python -m baselines.papers.paper {noted}"
    assert command_line("paper", Args()) == "python -m baselines.papers.paper --out results/paper"
    assert given_options(Args(jobs=2, strict=True), leave_out=("strict",)) == ["--jobs", "2"]


def test_counts_are_checked_where_they_are_given():
    check_counts(Args(), small_plans=1)
    check_counts(Args(small_plans=1, jobs=1), small_plans=1)
    for args, said in ((Args(small_plans=1), "small-plans"), (Args(small_plans=2, jobs=0), "jobs")):
        with pytest.raises(SettingError, match=said):
            check_counts(args, small_plans=2)


@pytest.mark.parametrize(("holds", "strict", "code"), [(True, True, 0), (False, True, 1), (False, False, 0)])
def test_a_claim_that_does_not_hold_is_an_exit_code_where_that_is_asked_for(
    holds, strict, code, tmp_path, capsys
):
    args = Args(out=tmp_path / "a/out", runs=tmp_path / "b/runs", json=True, strict=strict)
    claims = [Claim("id", "is so", None, 1.0, None, None, holds)]

    def work() -> Reproduced:
        assert args.out.is_dir() and args.runs.is_dir()
        return Reproduced(tmp_path / "page.md", claims)

    assert reproduce("Paper", args, work) == code
    printed = json.loads(capsys.readouterr().out)
    assert printed["paper"] == "Paper" and [claim["holds"] for claim in printed["claims"]] == [holds]
