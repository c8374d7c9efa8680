"""Our speed beside peers, in one process and on one thread unless said: `python -m benchmarks.speed`.

Each job and its peer take turns; every figure is a median over the rounds, and every ratio the median of the
rounds' ratios. Needs the extras `bench` and `training`.
"""

from __future__ import annotations

import dataclasses
import importlib.metadata
import os
import platform
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpuinfo import get_cpu_info

from baselines.cli.arguments import parse, print_json, run_command
from baselines.experiments.tables import markdown_table, terminal_table
from benchmarks.deciding import deciding_rows, mission_rows
from benchmarks.fusion import fusion_rows
from benchmarks.learning import learning_rows
from benchmarks.peers import load_peers
from benchmarks.planning import voronoi_rows
from benchmarks.rows import FULL, QUICK, Effort, Row
from benchmarks.startup import startup_rows
from benchmarks.stepping import step_rows, vector_rows
from entropy_explore_env.errors import SettingError
from entropy_explore_env.writing import write_atomically

JOBS: dict[str, Callable[[Effort], list[Row]]] = {
    "fusion beside octomap-python": fusion_rows,
    "ParallelEnv beside mpe2 simple_spread": step_rows,
    "VectorEnv beside the ParallelEnv, on one and two threads": vector_rows,
    "geodesic Voronoi cells beside SciPy": voronoi_rows,
    "decisions of strategies": deciding_rows,
    "a dense scanner, and missions on a large floor": mission_rows,
    "learning": learning_rows,
    "first steps of fresh processes": startup_rows,
}
"""Title → what is measured, in this order."""
COLUMNS = ("job", "ours", "peer", "theirs", "ratio", "goal", "holds")
_PACKAGES = "numpy numba octomap-python mpe2 pettingzoo gymnasium torch stable-baselines3".split()


@dataclass(frozen=True)
class Args:
    """Measure our speed beside peers, in the same run."""

    json: bool = False
    """Print one JSON object and nothing else."""
    quick: bool = False
    """Fewer rounds: some minutes in all."""
    only: str | None = None
    """Measure no more than what this word is in the title of, such as learning."""
    out: Path | None = None
    """A Markdown file for the table."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    jobs = checked(args)
    load_peers()
    rows: list[Row] = []
    for number, (title, job) in enumerate(jobs.items(), start=1):
        print(f"[{number}/{len(jobs)}] {title} …", file=sys.stderr, flush=True)
        effort = QUICK if args.quick else FULL
        rows += job(effort)
    about = {**machine(), "command": " ".join(["python -m benchmarks.speed", *words])}
    if args.out is not None:
        write_atomically(args.out, markdown(about, rows, args.only))
    if args.json:
        print_json({"machine": about, "rows": [dataclasses.asdict(row) for row in rows]})
    else:
        print(terminal_table(COLUMNS, [cells(row) for row in rows]))
        print(sentence(about))
    return 0


def checked(args: Args) -> dict[str, Callable[[Effort], list[Row]]]:
    """Return the jobs that are asked for.

    Raises:
        SettingError: No job has such a title, or a file or folder is in the way.
    """
    if args.out is not None and (args.out.is_dir() or not args.out.absolute().parent.is_dir()):
        raise SettingError("out", str(args.out), "a file in a folder that exists")
    jobs = {title: job for title, job in JOBS.items() if args.only is None or args.only in title}
    if not jobs:
        raise SettingError("only", args.only, "a word of one of: " + "; ".join(JOBS))
    return jobs


def machine() -> dict[str, Any]:
    """Return what the figures were measured on."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "processor": get_cpu_info().get("brand_raw") or "unknown",
        "cores": usable,
        "load_1_min": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "packages": {name: importlib.metadata.version(name) for name in _PACKAGES},
    }


def cells(row: Row) -> tuple[str, ...]:
    """Return a row as people read it: job, ours, peer, theirs, ratio, goal, holds."""
    return (
        row.job,
        f"{shown(row.ours)} {row.unit}",
        row.peer or "–",
        "–" if row.theirs is None else f"{shown(row.theirs)} {row.unit}",
        "–" if row.ratio is None else f"{shown(row.ratio)} ×",
        row.goal or "–",
        {True: "yes", False: "no", None: "–"}[row.holds],
    )


def shown(value: float) -> str:
    """Return a number with three digits; whole thousands are written in full."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def sentence(about: dict[str, Any]) -> str:
    """Return the machine in one sentence."""
    packages = ", ".join(f"{name} {version}" for name, version in about["packages"].items())
    return (
        f"{about['processor']}, {about['cores']} cores (load {about['load_1_min']} at the end), "
        f"{about['system']}, Python {about['python']}; {packages}."
    )


def markdown(about: dict[str, Any], rows: Sequence[Row], only: str | None = None) -> str:
    """Return the page for `docs/results/`: table, machine, command; of all jobs, or of one word's."""
    return (
        f"# Speed beside peers{f': {only}' if only else ''}\n\n"
        f"Made by `{about['command']}`. One process, one thread unless said. Each job and its peer take "
        "turns; figures are medians over the rounds, ratios are medians of the rounds' ratios.\n\n"
        f"{markdown_table(COLUMNS, [cells(row) for row in rows])}\n"
        f"Machine: {sentence(about)}\n"
    )


if __name__ == "__main__":
    raise SystemExit(run_command(main))
