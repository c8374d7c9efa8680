"""What the commands that reproduce a paper share: options, folders, the noted command, the result."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from baselines.cli.arguments import given_options, make_folder
from baselines.cli.worker_options import WorkerOptions
from baselines.experiments.claims import Claim, report_claims
from entropy_explore_env.validation import check_whole


@dataclass
class PaperArgs(WorkerOptions):
    """Options of every reproduction; a paper has its own folders, and more options."""

    quick: bool = False
    """Fewer starts and cells."""
    out: Path = Path("results")
    """Folder for the report, its figures and tables."""
    runs: Path = Path("results/runs")
    """Folder that keeps the missions."""
    json: bool = False
    """Print one JSON object and nothing else."""
    strict: bool = False
    """Exit with 1 if a claim does not hold."""


class Reproduced(NamedTuple):
    """The page that was written, and the claims on it."""

    page: Path
    claims: Sequence[Claim]


def check_counts(args: PaperArgs, **least: int) -> None:
    """Check that options that are given are whole numbers, at least so large, and where missions are to run.

    Raises:
        SettingError: One is not.
        MissingExtraError: On a cluster, and Ray is not installed.
    """
    for name, smallest in {**least, "jobs": 1}.items():
        value = getattr(args, name)
        if value is not None:
            check_whole(name.replace("_", "-"), value, smallest)
    assert args.workers  # raises where there is no such cluster


def command_line(paper: str, args: PaperArgs) -> str:
    """The command that makes the same page again, wherever the files lie that it reads.

    Args:
        paper: Name of the package of the paper.
        args: Its options.
    """
    own = given_options(args, leave_out=("out", "runs", "jobs", "cluster", "json", "strict"))
    return " ".join([f"python -m baselines.papers.{paper}", *own, f"--out {args.out}"])


def reproduce(title: str, args: PaperArgs, work: Callable[[], Reproduced]) -> int:
    """Do the work of a reproduction, and show what it came to.

    Args:
        title: The paper's short name.
        args: Options.
        work: Runs what is missing and writes the page.

    Returns:
        The command's exit code.
    """
    make_folder("out", args.out)
    make_folder("runs", args.runs)
    started = time.perf_counter()
    page, claims = work()
    return report_claims(title, claims, page, started, args.json, args.strict)
