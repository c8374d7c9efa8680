"""What there is to win over the planner, and what sets of actions cost.

    python -m training.policy_improvement.headroom --scenario office --robots 1 --missions 20

Runs the same starts with the planner among its own candidates; with a clairvoyant, who at every `--every`-th
decision tries the eight best of them in branches of the mission as it will happen, led to their ends (or to a
horizon and a learned time to go) by the planner, and keeps the best; with `planned-rate`, from whose kind of
candidates these are drawn; and with `planned-rate` restricted to the discrete actions of `training.ppo`.

The clairvoyant knows the world, which no policy does, but it looks one choice ahead: it is a measure and no
bound. Where it gains little, little is to be expected of a policy.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from baselines.experiments.mission import run_mission, scripted, scripted_env
from baselines.experiments.statistics import geometric_ratio_interval, median_ratio_interval
from baselines.strategies import make_strategy
from baselines.strategies.protocol import Strategy
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.privileged import deciding, mission_times, privileged_numbers, running
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training import extra  # noqa: F401 - before what is not there without it
from training.policy_improvement.headroom_table import table_row
from training.policy_improvement.restricted import RestrictedPlanner
from training.policy_improvement.rollouts import PLANNER, BatchMissions, Branch, RollOutEffort, RollOuts
from training.policy_improvement.tasks import task_of
from training.policy_improvement.time_to_go import TimeToGo, learn_time_to_go
from training.seeds import label_seeds

_SHARD = 2**31
"""No file of labels has this number: the starts are others than those of labels."""
_BETTER_S = 1e-6
ACTION_SETS = ("planned-rate", "restricted")


@dataclass
class Args:
    """What there is to win over the planner, and what sets of actions cost."""

    scenario: str = "room-furnished"
    """Named scenario."""
    robots: int = 3
    """Robots in a team."""
    missions: int = 10
    """Starts, in worlds of training."""
    candidates: int = 24
    """Viewpoints that the planner proposes at most."""
    tries: int = 8
    """Candidates that the clairvoyant tries, the best by the planner's scores."""
    every: int = 5
    """It does so at one decision of so many; 1 = always."""
    horizon: int = 0
    """Decisions a robot until the learned time to go stands for the rest of a branch; 0 = never."""
    divisor: int = 1
    """So many times fewer viewpoints are drawn in its branches; 1 = the missions as they will be."""
    action_sets: bool = True
    """Also run planned-rate, as it is and restricted to discrete actions."""
    seed: int = 0
    """Of the starts."""
    threads: int = 2
    """Threads that share the missions."""
    out: Path | None = None
    """Folder for SCENARIO-ROBOTS.json, as policy/headroom beside the policies' page, which then shows it;
    default: nothing is written."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    for name in ("missions", "every", "divisor", "threads"):
        check_whole(name, getattr(args, name), 1)
    for name in ("horizon", "seed"):
        check_whole(name, getattr(args, name), 0)
    if not 2 <= args.tries <= args.candidates:
        raise SettingError("tries", args.tries, f"from 2 to --candidates {args.candidates}")
    task = task_of(f"{args.scenario}:{args.robots}", args.candidates)
    if args.out is not None:
        make_folder("out", args.out)
    for found in measure(args, task):
        if args.out is not None:
            _keep(args.out / f"{task.name}-{task.robots}.json", found)
        if not args.json:
            print(found["rows"][-1]["line"], flush=True)
    if args.json:
        print_json(found)
    return 0


def _keep(file: Path, found: dict[str, Any]) -> None:
    """Write what is known after each row, but not over a file of the same options that holds more rows."""
    if file.is_file():
        table_row(file)  # refuses what this command did not write
        before = json.loads(file.read_text("utf-8"))
        same = all(before.get(name) == value for name, value in found.items() if name != "rows")
        if same and len(before["rows"]) > len(found["rows"]):
            return
    write_atomically(file, json.dumps(found, indent=1, allow_nan=False) + "\n")


def measure(args: Args, task: Scenario) -> Iterator[dict[str, Any]]:
    """Mission times of all, on the same starts, and their ratios to the planner's; after each what is known.

    Yields:
        `scenario`, `robots`, `missions`; `rows`: of each its `name`, `median_s`, `finished`, the `ratio` of
        medians and the geometric mean of ratios (`mean_ratio`), each with `_low` and `_high`, and a `line`.
    """
    seeds = label_seeds(args.seed, _SHARD, args.missions)
    options = {name: getattr(args, name) for name in ("every", "horizon", "divisor", "tries")}
    found = {"scenario": task.name, "robots": task.robots, "missions": args.missions, **options}
    planner = lead_by_planner(task, seeds, args.threads)
    rows: list[dict[str, Any]] = []
    for name, own_s in _all_times(args, task, seeds, planner):
        rows.append(_row(name, own_s, planner.times_s, task))
        yield {**found, "rows": list(rows)}


def _all_times(
    args: Args, task: Scenario, seeds: Sequence[int], planner: PlannerMissions
) -> Iterator[tuple[str, np.ndarray]]:
    """Names, and the lengths of their missions."""
    yield "planner", planner.times_s
    to_go = learn_time_to_go(planner.moments, planner.moments_to_go_s) if args.horizon else None
    with closing(Clairvoyant(task, seeds, args, to_go)) as clairvoyant:
        yield "clairvoyant", clairvoyant.run()
    for name in ACTION_SETS if args.action_sets else ():
        strategy = RestrictedPlanner() if name == "restricted" else make_strategy(name)
        yield name, strategy_times(task, strategy, seeds)


@dataclass(frozen=True)
class PlannerMissions:
    """Missions that the planner led.

    Attributes:
        times_s: (E,) their lengths.
        moments: (T, P) privileged numbers along them.
        moments_to_go_s: (T,) seconds that they still took.
    """

    times_s: np.ndarray
    moments: np.ndarray
    moments_to_go_s: np.ndarray


def lead_by_planner(task: Scenario, seeds: Sequence[int], threads: int) -> PlannerMissions:
    """Let the planner lead missions to their ends."""
    with closing(BatchMissions(task, len(seeds), threads)) as batch:
        missions = batch.missions
        missions.reset_some(range(len(seeds)), list(seeds))
        numbers, which, at_s = [], [], []
        actions = np.full((len(seeds), task.robots), PLANNER, np.int64)
        while running(missions).any():
            going = np.flatnonzero(running(missions))
            numbers.append(privileged_numbers(missions)[going, 0])
            which.append(going)
            at_s.append(mission_times(missions)[going])
            batch.step(actions)
        times_s = mission_times(missions)
    all_which = np.concatenate(which)
    return PlannerMissions(times_s, np.concatenate(numbers), times_s[all_which] - np.concatenate(at_s))


class Clairvoyant:
    """Missions in which at some decisions the best of several branches is taken."""

    def __init__(self, task: Scenario, seeds: Sequence[int], args: Args, to_go: TimeToGo | None) -> None:
        """Make the missions, and room for the branches of one decision."""
        self._args, self._to_go = args, to_go
        self._batch = BatchMissions(task, len(seeds), args.threads)
        self._batch.missions.reset_some(range(len(seeds)), list(seeds))
        effort = RollOutEffort(args.horizon, args.divisor)
        self._rollouts = RollOuts(self._batch.scenario, (1, args.tries, 1), effort, args.threads)
        self._decided = np.zeros((len(seeds), task.robots), np.int64)

    def run(self) -> np.ndarray:
        """(E,) the missions' lengths in seconds."""
        missions = self._batch.missions
        while running(missions).any():
            choosing = deciding(missions) & running(missions)[:, None]
            actions = np.full(choosing.shape, PLANNER, np.int64)
            turns = choosing & (self._decided % self._args.every == 0)
            self._decided += choosing
            for mission, robot in np.argwhere(turns).tolist():
                actions[mission, robot] = self._best(mission, robot)
            self._batch.step(actions)
        return mission_times(missions)

    def _best(self, mission: int, robot: int) -> int:
        """The candidate whose branch is the shortest; the planner's own, unless another is shorter."""
        at, parts = (mission, robot), self._batch.parts
        score = np.where(self._batch.exists()[at], self._batch.features()[at][:, parts.score], -1.0)
        score[PLANNER] = 2.0
        tried = np.argsort(-score, kind="stable")[: self._args.tries]
        tried = tried[score[tried] >= 0.0]
        if len(tried) < 2:
            return PLANNER
        self._rollouts.add(self._batch, Branch(mission, robot, tried, None))
        outcomes = self._rollouts.run()
        seconds = outcomes.seconds[0, : len(tried), 0].astype(np.float64)
        if self._to_go is not None:
            rest_s = self._to_go.seconds(outcomes.at_end[0, : len(tried), 0])
            seconds += np.where(outcomes.ended[0, : len(tried), 0], 0.0, rest_s)
        best = int(seconds.argmin())
        return int(tried[best]) if seconds[best] < seconds[0] - _BETTER_S else PLANNER

    def close(self) -> None:
        """End the threads."""
        self._rollouts.close()
        self._batch.close()


def strategy_times(task: Scenario, strategy: Strategy, seeds: Sequence[int]) -> np.ndarray:
    """(E,) seconds that a strategy's missions take on the same starts; it may choose any viewpoint."""
    env = scripted_env(with_settings(scripted(task), {"action": {"kind": "continuous"}}))
    times = []
    for seed in seeds:
        run_mission(env, strategy, seed)
        times.append(float(mission_figures(env.missions, 0)["t_mission_s"]))
    return np.array(times)


def _row(name: str, own_s: np.ndarray, planner_s: np.ndarray, task: Scenario) -> dict[str, Any]:
    ratio = median_ratio_interval(own_s, planner_s)
    mean = geometric_ratio_interval([own_s], [planner_s])
    finished = int((own_s < task.ending.time_limit_s).sum())
    line = (
        f"{name:>14}: {float(np.median(own_s)):8.1f} s, {finished} of {len(own_s)} within the time limit; "
        f"ratio of medians {ratio.value:.3f} ({ratio.low:.3f} … {ratio.high:.3f}), "
        f"mean of ratios {mean.value:.3f} ({mean.low:.3f} … {mean.high:.3f})"
    )
    return {
        "name": name,
        "median_s": float(np.median(own_s)),
        "finished": finished,
        **{f"ratio{end}": value for end, value in zip(("", "_low", "_high"), ratio, strict=True)},
        **{f"mean_ratio{end}": value for end, value in zip(("", "_low", "_high"), mean, strict=True)},
        "line": line,
    }


if __name__ == "__main__":
    raise SystemExit(run_command(main))
