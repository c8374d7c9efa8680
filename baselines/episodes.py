"""Write a strategy's missions as Parquet, for offline learning.

    python -m baselines.episodes room --strategy best --missions 1000 --out results/episodes

The folder gets files of --missions-per-file missions each; docs/episodes.md describes their rows: what each
robot observed and chose, and what came of it. The same options give the same bytes. An interrupted command
continues where it was.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from baselines.cli.options import Mark
from baselines.cli.task_options import TaskOptions, base_task, parsed_for, tasked
from baselines.cli.worker_options import TrialOptions
from baselines.experiments.rows import read_table
from baselines.experiments.trials import run_trials
from baselines.strategies import make_strategy, resolved
from entropy_explore_env.errors import MissingExtraError, SettingError
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.validation import check_whole

ROWS = "_rows.jsonl"
"""Table in --out that says which files are whole; readers of Parquet pass by what begins with _."""


@dataclass
class Args(TrialOptions):
    """Write a strategy's missions as Parquet."""

    usual: ClassVar = (
        *("scenario", "strategy", "robots", "missions", "first_seed", "missions_per_file", "settings"),
        *("time_limit_s", "world", "voxel_size_m", "jobs", "cluster", "rerun", "out", "json"),
    )

    scenario: Annotated[str, Mark.POSITIONAL] = "room"
    """A named scenario."""
    strategy: str = "best"
    """Strategy that decides, as in baselines.run."""
    robots: int = 3
    """Team size."""
    missions: int = 100
    """Number of missions; their seeds count up from --first-seed."""
    first_seed: int = 0
    """Seed of the first mission."""
    missions_per_file: int = 20
    """Missions in a file; each file is written whole or not at all."""
    task: Annotated[TaskOptions, Mark.INLINE] = dataclasses.field(default_factory=TaskOptions)
    observation: Observation = dataclasses.field(default_factory=lambda: Observation(panorama_utility="log2"))
    """Parts of the observation, which is flat and of robots that decide."""
    out: Path = Path("results/episodes")
    """Folder for the files."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    task = base_task(args.scenario, args.task.settings)
    args = parsed_for(task, args, words, robots=task.scenario.robots)
    for name, least in (("missions", 1), ("missions_per_file", 1), ("first_seed", 0)):
        check_whole(name, getattr(args, name), least)
    if importlib.util.find_spec("pyarrow") is None:
        raise MissingExtraError("pyarrow", "episodes")
    how, strategy = args.how("episodes", args.json), resolved(args.strategy)
    make_strategy(strategy)
    scenario, surroundings = tasked(task.scenario, args.task, args.robots)
    make_folder("out", args.out)
    from baselines.offline.recorded_env import observed_scenario
    from baselines.offline.shards import Shard, refuse_others

    recorded = observed_scenario(scenario, args.observation)
    shards = [
        Shard(recorded, strategy, surroundings, args.first_seed + done, missions, str(args.out))
        for done in range(0, args.missions, args.missions_per_file)
        for missions in [min(args.missions_per_file, args.missions - done)]
    ]
    table = args.out / ROWS
    rows = read_table(table)
    refuse_others(shards, rows)
    kept = {row.key: row.record for row in rows}
    lost = [shard for shard in shards if shard.key in kept and not shard.is_whole(kept[shard.key])]
    run_trials(lost, table, dataclasses.replace(how, rerun=True, since=None))
    records = [row.record for row in run_trials(shards, table, how) if row is not None]
    for shard, record in zip(shards, records, strict=True):
        if not shard.is_whole(record):
            allowed = f"a folder that all machines share: {shard.path.name} is not in it"
            raise SettingError("out", str(args.out), allowed)
    counted = ("missions", "decisions", "rows", "bytes")
    report({name: sum(record[name] for record in records) for name in counted}, args)
    return 0


def report(total: dict[str, int], args: Args) -> None:
    """Say what is in the folder."""
    robot_steps = total["rows"] - args.robots * total["missions"]
    per_step = total["bytes"] / robot_steps
    if args.json:
        more = {"robot_steps": robot_steps, "bytes_per_robot_step": round(per_step, 1)}
        print_json({**total, **more, "out": str(args.out)})
        return
    print(
        f"{total['missions']:,} missions, {total['decisions']:,} decisions, {robot_steps:,} robot-steps, "
        f"{total['bytes'] / 1e6:,.1f} MB: {per_step:,.0f} bytes a robot-step"
    )
    print(f"written: {args.out}", file=sys.stderr)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
