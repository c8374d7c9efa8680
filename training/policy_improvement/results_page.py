"""The policies that come with the project, tested: `python -m training.policy_improvement.results_page`.

Each policy over candidates runs beside the strategy that is recommended, on the same starts, in worlds that
nothing was learned in: in the tasks that it learned, and in others, with other teams, channels and sensors.
Written is `policy.md`, and beside it each policy's part of the page and all of its missions as one file, with
which another run begins (`--archive`). Missions are kept, a file each: what was stopped goes on, and a part
says how many starts it holds. Tasks that stand in suites, too, are theirs: archives of the scoreboard serve,
too.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.cli.worker_options import WorkerOptions
from baselines.experiments.archive import read_archive, write_archive
from baselines.experiments.cells import missions_of, run_cells
from baselines.scoreboard.page import ARCHIVE, PART
from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training import extra  # noqa: F401 - before what is not there without it
from training.policy import policy_folder
from training.policy_improvement import ablations_table, headroom_table
from training.policy_improvement.policy_tests import TESTS, strategies_of
from training.policy_improvement.results_text import FILES, Experiments, page_parts, policy_parts


@dataclass
class Args(WorkerOptions):
    """Test the policies over candidates that come with the project."""

    seeds: int = 100
    """Starts of each task in which missions are short; of the others 30 at most."""
    policies: str = ",".join(TESTS)
    """Which, commas between; of others the page keeps the parts that earlier runs wrote."""
    stop_after_s: float = math.inf
    """Time on the clock after which no mission is begun any more; the page then holds what was run."""
    wall_limit_s: float = 3600.0
    """Time on the clock after which a mission is ended, and counts as failed."""
    confirm: bool = False
    """Keep missions that other code ran, of each strategy and task whose first mission comes out the same
    when it is run again; else a change of the code runs all again."""
    archive: tuple[Path, ...] = ()
    """Files missions.jsonl.xz of earlier runs, of this page or of the scoreboard: their missions of the same
    settings are not run again; what other code ran counts with --confirm."""
    out: Path = Path("results/policy")
    """Folder for policy.md and, in policy, a folder of each policy."""
    runs: Path | None = None
    """Folder that keeps the missions; default: runs in --out."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_whole("seeds", args.seeds, 1)
    for name in ("stop_after_s", "wall_limit_s"):
        if not getattr(args, name) > 0.0:
            raise SettingError(name, getattr(args, name), "a number > 0")
    names = list(dict.fromkeys(args.policies.split(",")))
    workers = args.workers
    for name in names:
        policy_folder(f"pretrained:{name}")  # refuses those that there are not
        if name not in TESTS:
            raise SettingError("policies", name, "some of " + ", ".join(TESTS))
    make_folder("out", args.out)
    beside = args.out / FILES
    experiments = Experiments(
        headroom_table.shown(beside / "headroom"), ablations_table.shown(beside / "ablations")
    )
    rows = {
        name: [(test, strategy) for test in TESTS[name] for strategy in strategies_of(name)] for name in names
    }
    cells = {
        (name, test.title, strategy): test.cells(strategy, args.seeds)
        for name, pairs in rows.items()
        for test, strategy in pairs
    }
    wanted, runs = [cell for group in cells.values() for cell in group], args.runs or args.out / "runs"
    make_folder("runs", runs)
    missions = missions_of(wanted)
    for file in args.archive:
        print(f"{read_archive(file, runs, missions):,} missions taken from {file}", file=sys.stderr)
    records = run_cells(
        wanted,
        runs,
        workers,
        "policies tested",
        quiet=False,
        limit_s=args.wall_limit_s,
        keep_failures=True,
        stop_after_s=args.stop_after_s,
        confirm=args.confirm,
    )
    found = {key: [each for cell in group for each in records[cell.id]] for key, group in cells.items()}
    for name in names:
        make_folder("out", beside / name)
        own = [cell for key, group in cells.items() if key[0] == name for cell in group]
        write_archive(beside / name / ARCHIVE, runs, missions_of(own))
        write_atomically(beside / name / PART, "\n".join(policy_parts(name, found, args.seeds, args.confirm)))
    parts = {name: beside / name / PART for name in TESTS}
    written = [file.read_text("utf-8") for file in parts.values() if file.is_file()]
    page = args.out / "policy.md"
    write_atomically(page, "\n".join(page_parts(written, experiments)))
    print(f"written: {page}")
    return 0


if __name__ == "__main__":
    raise SystemExit(run_command(main))
