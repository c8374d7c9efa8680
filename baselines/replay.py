"""Run a recorded mission again, bit for bit: `python -m baselines.replay mission.npz --out results/again`.

Of a bag of ROS it plays the maps through a strategy: `python -m baselines.replay BAG --strategy best`.

Takes the record that `baselines.run --record FILE` (or `--out`) wrote, gives the environment the same
commands, compares the state at the end with the record's digest, and draws the mission anew. Exit code 1
where the end differs: another version of the library, or another machine's arithmetic. A record holds its
settings: there are no options of a task, such as `--settings` or `--robots`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

from baselines import bag_replay
from baselines.bag_replay import BagArgs, is_bag, replay_bag
from baselines.cli.arguments import parse, run_command
from baselines.cli.mission_outputs import MissionLog, Outputs, show_results
from baselines.cli.options import Mark
from baselines.cli.progress import progress_bar
from baselines.experiments.mission import replay_commands
from entropy_explore_env.command import allow_read_memory
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.mission_record import (
    MissionRecord,
    check_world,
    given_worlds_of,
    load_record,
    reset_options_of,
    same_end,
)
from entropy_explore_env.version import VERSION

_DIFFERS = 1


@dataclass
class Args:
    """Run a recorded mission again and compare its end."""

    record: Annotated[Path, Mark.POSITIONAL] = Path("mission.npz")
    """A mission record, mission.npz."""
    world_file: str | None = None
    """Where the world's file lies now, if it was moved."""
    read_memory_mib: float | None = None
    """MiB of memory that reading a world file may take; default: by the file's size."""
    out: Path | None = None
    """Folder for mission.json, mission.png and mission.gif."""
    output: Annotated[Outputs, Mark.INLINE] = field(default_factory=Outputs)


def main(words: Sequence[str]) -> int:
    """Run the command."""
    if is_bag(words):
        return replay_bag(parse(BagArgs, words, description=bag_replay.__doc__))
    args = parse(Args, words, description=__doc__)
    allow_read_memory(args.read_memory_mib)
    record = load_record(args.record)
    if args.world_file is not None:
        record = replace(record, scenario=replace(record.scenario, world=args.world_file), world=None)
    log = MissionLog(args.output, args.out, recorded=False)
    title = f"{record.scenario.name}, replayed"
    with log, progress_bar(title, hidden=args.output.json) as show:
        env = _replayed(record, log, show)
        same = same_end(record, env.missions)
        replayed = {"same": same, "recorded_by": record.library, "replayed_by": VERSION}
        figures, written = log.finish(record.strategy, replayed=replayed)
    show_results(env, figures, written, args.output.json)
    if not same:
        versions = f"recorded by version {record.library}, replayed by {VERSION}"
        print(f"the end state differs from the record's: {versions}", file=sys.stderr)
        return _DIFFERS
    if not args.output.json:
        print("replayed bit for bit: the end state is the record's")
    return 0


def _replayed(
    record: MissionRecord, log: MissionLog, show: Callable[[EntropyExploreEnv], None]
) -> EntropyExploreEnv:
    """Return the environment after the record's commands, or after the mission's end if that came earlier."""
    env = EntropyExploreEnv(record.scenario, **given_worlds_of(record))
    env.missions.seeds[0], env.missions.episodes[0] = record.seed, record.episode - 1
    env.reset(seed=None if record.episode else record.seed, options=reset_options_of(record))
    check_world(record, env.missions)

    def note(env: EntropyExploreEnv) -> None:
        log.note(env)
        show(env)

    note(env)
    replay_commands(env, record, note, log.command)
    return env


if __name__ == "__main__":
    raise SystemExit(run_command(main))
