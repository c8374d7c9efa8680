"""Run a mission, show its progress, and print a table of its figures.

    python -m baselines.run office --strategy best --robots 3 --seed 0
    python -m baselines.run office --world map.yaml --out results/mine
    python -m baselines.run terrain --world dem.tif --clearance-m 20 --robot.max-speed-m-s 1.5
    python -m baselines.run room --settings mine.json --channel.range-m 5 --gif mission.gif

With `--out DIR` the folder gets mission.json (figures and time series), mission.png (curves and maps),
mission.gif (the mission as it went) and mission.npz (its record, for `python -m baselines.replay`). Ctrl-C
ends the mission after the step under way: what was done is shown and written, and the exit code is 130.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from baselines.cli.arguments import parse, run_command
from baselines.cli.interruption import Interruption
from baselines.cli.mission_outputs import MissionLog, Outputs, show_results
from baselines.cli.options import Mark
from baselines.cli.progress import progress_bar
from baselines.cli.task_options import TaskOptions, base_task, parsed_for, tasked
from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import make_strategy, resolved, shown_name
from baselines.strategies.table import help_text
from entropy_explore_env.command import INTERRUPTED
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.settings.validation import check_whole

_STRATEGY = f"""Chooses viewpoints; best is {resolved("best")}. All of them: --help strategy
{help_text()}
Learned: pretrained:room, the folder of a run of training, or a file of planner weights, weights.json.
Your own: my_package.my_module:MyStrategy, path/to/file.py:MyStrategy."""

_PROMISE = "the mission ends after this step, and what was done is shown and written"


@dataclass
class Args:
    """Run a mission of a strategy and show it."""

    usual: ClassVar = (
        *("scenario", "strategy", "robots", "seed", "time_limit_s", "settings", "starts"),
        *("world", "height_m", "voxel_size_m", "out", "gif", "mp4", "rerun", "json"),
    )

    scenario: Annotated[str, Mark.POSITIONAL] = "room"
    """Named scenario: room, office, cave, terrain, … (docs/environments.md)."""
    strategy: Annotated[str, _STRATEGY] = "gradient"
    robots: int = 3
    """Team size; default: the scenario's."""
    seed: int = 0
    """Seed of the world, the starts and all other draws."""
    task: Annotated[TaskOptions, Mark.INLINE] = dataclasses.field(default_factory=TaskOptions)
    out: Path | None = None
    """Folder for mission.json, mission.png, mission.gif, mission.npz and the team's map."""
    record: Path | None = None
    """File for the mission's record, an .npz that baselines.replay runs again."""
    output: Annotated[Outputs, Mark.INLINE] = dataclasses.field(default_factory=Outputs)


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    task = base_task(args.scenario, args.task.settings)
    args = parsed_for(task, args, words, robots=task.scenario.robots)
    name = resolved(args.strategy)
    strategy = make_strategy(name)
    check_whole("seed", args.seed, 0)
    env = scripted_env(*tasked(task.scenario, args.task, args.robots), track_truth=True)
    log = MissionLog(args.output, args.out, args.record)
    title = f"{args.scenario}, {shown_name(name)}"
    with log, progress_bar(title, hidden=args.output.json) as show:

        def after_step(env: EntropyExploreEnv) -> bool:
            log.note(env)
            show(env)
            return interruption.asked

        with Interruption(_PROMISE) as interruption:
            run_mission(env, strategy, args.seed, after_step, log.command)
        figures, written = log.finish(name)
    if args.task.world and env.scenario.grid.flat and not task.scenario.grid.flat:
        plan = f"{args.task.world[0]} is one voxel high: robots stayed in its plane and looked level"
        print(f"{plan} (--height-m makes it 3-D; office has ground robots)", file=sys.stderr)
    show_results(env, figures, written, args.output.json)
    if not env.agents:
        return 0
    print(f"interrupted after {figures['t_mission_s']:,.1f} s of the mission", file=sys.stderr)
    return INTERRUPTED


if __name__ == "__main__":
    raise SystemExit(run_command(main))
