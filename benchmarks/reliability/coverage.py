"""Branches of kernels that tests take, with kernels interpreted: `python -m benchmarks.reliability.coverage`.

Compiled code cannot be traced. Interpreted, a kernel gives the same bits, some hundred times slower: a test
that takes longer than `--test-s` of the processor is ended, and what it took until then counts.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baselines.cli.arguments import parse, run_command
from benchmarks.reliability.quick_tests import LIMIT
from entropy_explore_env.errors import SettingError
from entropy_explore_env.writing import write_atomically

_ROOT = Path(__file__).parents[2]
_FOLDERS = ("belief", "robots", "viewpoints", "missions")


@dataclass(frozen=True)
class Args:
    """Measure the branches that tests take, and keep them for the page of the proofs.

    Attributes:
        folders: Of the library, and of the tests that are run.
        test_s: Seconds of the processor after which a test is ended.
        out: Where the rows are kept; those of other folders stay.
    """

    folders: tuple[str, ...] = _FOLDERS
    test_s: float = 10.0
    out: Path = Path("results/reliability/coverage.jsonl")


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words)
    for folder in args.folders:
        if folder not in _FOLDERS:
            raise SettingError("folders", folder, "one of " + ", ".join(_FOLDERS))
    rows = [row for row in _rows(args.out) if row["path"].split("/")[1] not in args.folders]
    rows += measured(args.folders, args.test_s)
    write_atomically(args.out, "".join(json.dumps(row) + "\n" for row in rows))
    for row in rows:
        print(f"{row['path']}: {row['covered']} of {row['branches']}")
    return 0


def _rows(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.exists() else []


def measured(folders: Sequence[str], test_s: float) -> list[dict[str, Any]]:
    """A row for each source file of some folders: its branches, and how many of them tests took."""
    with tempfile.TemporaryDirectory() as folder:
        kept, report = Path(folder) / "kept", Path(folder) / "report.json"
        variables = {**os.environ, "PYTHONPATH": str(_ROOT), "NUMBA_DISABLE_JIT": "1", LIMIT: str(test_s)}
        coverage = [sys.executable, "-m", "coverage"]
        sources = ",".join(f"entropy_explore_env/{name}" for name in folders)
        plugins = ["-p", "no:cacheprovider", "-p", "benchmarks.reliability.quick_tests"]
        tests = ["-m", "pytest", "-q", "-W", "ignore", *plugins, *(f"tests/{name}" for name in folders)]
        subprocess.run(
            [*coverage, "run", "--branch", f"--source={sources}", f"--data-file={kept}", *tests],
            cwd=_ROOT,
            env=variables,
            stdout=sys.stderr,
            check=False,  # tests that are ended fail
        )
        subprocess.run(
            [*coverage, "json", "-q", f"--data-file={kept}", "-o", str(report)],
            cwd=_ROOT,
            env=variables,
            check=True,
        )
        return rows_of(json.loads(report.read_text("utf-8")))


def rows_of(report: dict[str, Any]) -> list[dict[str, Any]]:
    """A row for each file of a report of `coverage json`; those without branches are left out."""
    return [
        {"path": path, "branches": told["num_branches"], "covered": told["covered_branches"]}
        for path, told in ((path, file["summary"]) for path, file in sorted(report["files"].items()))
        if told["num_branches"]
    ]


if __name__ == "__main__":
    raise SystemExit(run_command(main))
