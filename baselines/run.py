"""Run a mission and show it: `python -m baselines.run room --strategy gradient --robots 3 --seed 0`.

Shows a progress bar and a table; with `--out DIR` writes `mission.json` (the figures and time
series), `mission.png` (curves and maps), `mission.gif` (the mission as it went) and `mission.npz`
(its record, for `python -m baselines.replay`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from baselines.cli.arguments import OmitArgPrefixes, Positional, parse, run_command
from baselines.cli.mission_outputs import MissionLog, Outputs, Wanted, show_results
from baselines.cli.progress import progress_bar
from baselines.cli.start_options import reset_options
from baselines.cli.world_options import Reading, world_settings
from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import make_strategy, resolved
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.scenarios import ROOM, find_scenario
from entropy_explore_env.settings import Channel, Ending, RangeSensor, Robot
from entropy_explore_env.validation import check_whole


@dataclass
class Args:
    """Run a mission of a strategy and show it."""

    scenario: Positional[str] = "room"
    """A named scenario: room, office, cave, … (the README lists them)."""
    strategy: str = "gradient"
    """Chooses viewpoints: best (planned-rate, which we recommend), random, gradient, gradient-plane,
    mutual-information, ground-gradient, information-rate-v0, information-per-scan, voronoi, voronoi-gradient,
    voronoi-nearest, per-time-visibility, nearest-candidate, coordinated-candidate, nearest-frontier,
    coordinated-frontier, assigned-frontier, information-gain, distance-advantage, receding-horizon, tour; a
    learned policy: pretrained:room, or the folder of a run of training.ppo; or a class of your own:
    my_package.my_module:MyStrategy, or path/to/file.py:MyStrategy."""
    robots: int = 3
    """Team size."""
    seed: int = 0
    """Of the world, the starts and every other draw."""
    world: str | None = None
    """A world file in place of the scenario's world; entropy_explore_env.worlds lists the kinds."""
    world_number: int | None = None
    """The world with this number of the scenario's recipe; default: drawn by the seed."""
    starts: str | None = None
    """Poses of all robots as JSON, or a file of it: [[x, y, z, yaw, pitch], ...] in metres and radians,
    of planar robots also [x, y, yaw]; default: drawn by the seed."""
    voxel_size_m: float | None = None
    """Resample the world file's voxels to this size; default: the scenario's."""
    world_file: OmitArgPrefixes[Reading] = dataclasses.field(default_factory=Reading)
    out: Path | None = None
    """Folder for mission.json, mission.png, mission.gif and mission.npz."""
    record: Path | None = None
    """File for the mission's record, an .npz that baselines.replay runs again."""
    output: OmitArgPrefixes[Outputs] = dataclasses.field(default_factory=Outputs)
    robot: Robot = dataclasses.field(default_factory=Robot)
    sensor: RangeSensor = dataclasses.field(default_factory=RangeSensor)
    channel: Channel = dataclasses.field(default_factory=Channel)
    ending: Ending = dataclasses.field(default_factory=Ending)


def main(words: Sequence[str]) -> int:
    """Run the command."""
    named = parse(Args, words, default=_defaults(ROOM), description=__doc__).scenario
    args = parse(Args, words, default=_defaults(find_scenario(named)), description=__doc__)
    name = resolved(args.strategy)
    strategy = make_strategy(name)
    check_whole("seed", args.seed, 0)
    env = _env(args)
    options = reset_options(args.starts, args.world_number, env.scenario)
    wanted = Wanted(args.output, args.out, args.record)
    wanted.prepare()
    title = f"{args.scenario}, {name}"
    with MissionLog(wanted) as log, progress_bar(title, hidden=args.output.json) as show:

        def after_step(env: EntropyExploreEnv) -> None:
            log.note(env)
            show(env)

        run_mission(env, strategy, args.seed, after_step, log.command, options)
        figures, written = log.finish(name)
    show_results(env, figures, written, args.output.json)
    return 0


def _defaults(scenario: Scenario) -> Args:
    return Args(
        scenario=scenario.name,
        robots=scenario.robots,
        robot=scenario.robot,
        sensor=scenario.sensor,
        channel=scenario.channel,
        ending=scenario.ending,
    )


def _env(args: Args) -> EntropyExploreEnv:
    """The scenario with the command line's settings, in its world or in the file's."""
    settings = {name: getattr(args, name) for name in ("robots", "robot", "sensor", "channel", "ending")}
    world = world_settings(args.world, args.voxel_size_m, args.world_file)
    return EntropyExploreEnv(scripted(find_scenario(args.scenario)), track_truth=True, **settings, **world)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
