"""One mission of a strategy: how it runs through the environment, and what is recorded of it."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from baselines.experiments.rows import Record
from baselines.strategies import make_strategy
from baselines.strategies.protocol import Bound, Stopwatch, Strategy, choose_all
from entropy_explore_env.compilation.announcement import compiling_s
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.planner.driver import Driver, Trail
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.mission_record import CommandRecorder, MissionRecord, save_record
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.scenario import Scenario

NOTHING_OBSERVED = Observation(panorama=False, self_state=False, team=False)
"""Strategies read RobotViews: an observation for networks would cost time for nothing."""

_SERIES_POINTS = 200
_DIGITS = 7
"""Significant digits of figures: archives of thousands of missions hold no noise."""


@dataclass(frozen=True)
class Surroundings:
    """What of missions is no setting of their scenario, as texts, so that it goes into digests.

    Attributes:
        worlds: JSON of the settings `world` and `grid` of missions in world files; empty = in no files.
        every_reset: JSON of the options `starts` and `world` of every reset; empty = all is drawn.
        decision_period_s: Length of a step; None = until the next robot has to decide.
    """

    worlds: str = ""
    every_reset: str = ""
    decision_period_s: float | None = None

    def settings(self) -> dict[str, Any]:
        """Return the settings as an environment takes them."""
        fixed = {"every_reset": json.loads(self.every_reset)} if self.every_reset else {}
        return {**(json.loads(self.worlds) if self.worlds else {}), **fixed}

    def files(self) -> list[Path]:
        """Return the world files."""
        world = self.settings().get("world", [])
        paths = world["path"] if isinstance(world, dict) else world
        return [Path(path) for path in ([paths] if isinstance(paths, str) else paths)]

    def without_folders(self) -> Surroundings:
        """Return the same, wherever the world files lie."""
        if not self.worlds:
            return self
        worlds, names = json.loads(self.worlds), [path.name for path in self.files()]
        if isinstance(worlds["world"], dict):
            worlds["world"]["path"] = names
        else:
            worlds["world"] = names[0]
        return dataclasses.replace(self, worlds=json.dumps(worlds))


def scripted(scenario: Scenario, decision_period_s: float | None = None) -> Scenario:
    """Return a scenario as scripted strategies run it: no observation, steps to a decision or of a length."""
    return with_settings(scenario, {"decision_period_s": decision_period_s, "observation": NOTHING_OBSERVED})


def scripted_env(
    scenario: Scenario,
    surroundings: Surroundings | None = None,
    **settings: Any,  # noqa: ANN401 - whatever a setting may be
) -> EntropyExploreEnv:
    """Return an environment for scripted strategies, with some fields of the scenario changed.

    Raises:
        SettingError: A setting is not allowed.
        WorldError: A world file cannot be used.
    """
    around = surroundings or Surroundings()
    task = scripted(scenario, around.decision_period_s)
    return EntropyExploreEnv(task, **{**around.settings(), **settings})


def run_mission(
    env: EntropyExploreEnv,
    strategy: Strategy,
    seed: int,
    after_step: Callable[[EntropyExploreEnv], bool | None] | None = None,
    before_step: Callable[[Mapping[str, Any]], bool | None] | None = None,
    options: dict[str, Any] | None = None,
    backs_off: bool = True,
) -> None:
    """Reset the environment and let a strategy act until the mission is over or left.

    Args:
        env: With any settings; it is left at the mission's end.
        strategy: Chooses the viewpoints.
        seed: Of the mission.
        after_step: Called after the reset and after every step; where it returns True the mission is left.
        before_step: Called with the actions before every step; the same holds.
        options: Of the reset: where the robots start, and in which world.
        backs_off: Whether robots that drift back off from what blocks them: see `planner.driver`.
    """
    env.reset(seed=seed, options=options)
    if isinstance(strategy, Driver):
        strategy.backs_off = backs_off
    elif env.scenario.drifts and backs_off:
        strategy = Followed(strategy)
    strategy.reset(env.scenario, env.strategy_generator())
    actions = {agent: _idle_action(env, agent) for agent in env.agents}
    left = after_step is not None and after_step(env)
    while env.agents and not left:
        views = [env.view(agent) for agent in env.deciding_agents()]
        chosen = choose_all(strategy, views)
        for view, viewpoint in zip(views, chosen, strict=True):
            actions[env.agents[view.robot]] = view.action_for(viewpoint)
        if before_step is not None and before_step(actions):
            return
        env.step(actions)
        left = after_step is not None and after_step(env)


class Followed(Driver):
    """Follows any strategy, so that robots that drift back off from what blocks them."""

    most_blocked = 0
    repeats = True

    def __init__(self, strategy: Strategy) -> None:
        """Take the strategy."""
        self._strategy = strategy

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission; the strategy draws as it does alone."""
        self._strategy.reset(scenario, rng)
        super().reset(scenario, rng)

    def give_way(self, view: RobotView, trail: Trail) -> None:
        """Leave it to the strategy."""

    def decide(self, view: RobotView) -> np.ndarray:
        """Return what the strategy chooses."""
        return choose_all(self._strategy, [view])[0]


def _idle_action(env: EntropyExploreEnv, agent: str) -> np.ndarray | np.int64:
    """Return an action for a robot that is busy: it is ignored."""
    space = env.action_space(agent)
    return np.zeros(space.shape, np.float32) if space.shape else np.int64(0)


def counted_time_s(figures: Mapping[str, Any], scenario: Scenario) -> float:
    """Return the time that a mission counts with: the time limit if it did not finish."""
    limit_s = scenario.ending.time_limit_s
    if figures["finished"] or math.isinf(limit_s):
        return float(figures["t_mission_s"])
    return limit_s


def mission_record(env: EntropyExploreEnv, strategy: str | Strategy, seed: int) -> Record:
    """Run a mission and record what reports need of it.

    Returns:
        The mission's figures; `half_s`, when the best map had lost half of H(0) - H_th; `sent_by_scan`,
        measurements sent after each of the team's scans; `apart_m`, the robots' mean distance from each
        other; and `series`: time, entropy of the best map and measurements sent so far at up to 200 moments.
    """
    made = make_strategy(strategy) if isinstance(strategy, str) else strategy
    recorder = Recorder(env.missions)
    run_mission(env, made, seed, lambda _: recorder.note())
    figures = mission_figures(env.missions, 0)
    series = recorder.series()
    best = series.entropy_bits.min(axis=1)
    middle = 0.5 * (figures["entropy_start_bits"] + figures["entropy_threshold_bits"])
    halved = np.flatnonzero(best <= middle)
    rows = series.sampled(_SERIES_POINTS)
    single = np.flatnonzero(np.diff(series.scans.sum(axis=1)) == 1)
    return {
        **figures,
        "half_s": float(series.time_s[halved[0]]) if len(halved) else None,
        "sent_by_scan": np.diff(series.shared)[single].tolist(),
        "apart_m": round(_mean_distance_apart_m(series.scan_positions_m[1:]), 3),
        "series": {
            "time_s": np.round(series.time_s[rows], 3).tolist(),
            "entropy_bits": np.round(best[rows], 1).tolist(),
            "shared_measurements": series.shared[rows].tolist(),
        },
    }


def _mean_distance_apart_m(places_m: np.ndarray) -> float:
    """Return the mean distance between two robots over the moments (T, A, 3); 0 for one robot."""
    moments, robots, _ = places_m.shape
    distances_m = np.linalg.norm(places_m[:, :, None] - places_m[:, None], axis=-1)
    return float(distances_m.sum() / max(moments * robots * (robots - 1), 1))


def _clock_s() -> float:
    """Return the time in seconds on a clock that stands still while kernels compile."""
    return time.perf_counter() - compiling_s()


@dataclass(frozen=True)
class SuiteMission:
    """Runs a mission and says what is kept of it.

    Attributes:
        start: x, y, z, yaw, pitch of the one robot, metres and radians, map frame; None = drawn.
    """

    start: tuple[float, float, float, float, float] | None = None

    @property
    def options(self) -> dict[str, Any] | None:
        """Options of the reset."""
        return None if self.start is None else {"starts": [self.start]}

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int, file: Path | None = None) -> Record:
        """Run a mission and keep its figures, what it cost on the clock, and its record if there is a file.

        Returns:
            `suite_figures`; and `clock`: `decision_ms` and `worst_decision_ms`, the time that the strategy
            took for one robot (median and largest, without compiling and without the first decision, which
            loads what is compiled), and `mission_s`.
        """
        made = make_strategy(strategy)
        if isinstance(made, Bound):
            made.tell_truth(env)
        timed, started = Stopwatch(made, _clock_s), time.perf_counter()
        if file is None:
            run_mission(env, timed, seed, options=self.options)
        else:
            recorder = CommandRecorder(env.missions)
            run_mission(env, timed, seed, lambda _: recorder.note(), recorder.command, self.options)
            save_record(recorder.record(strategy), file)
        mission_s = time.perf_counter() - started
        spent_ms = timed.decisions_ms[1:] or timed.decisions_ms
        clock = {
            "decision_ms": float(np.median(spent_ms)),
            "worst_decision_ms": max(spent_ms),
            "mission_s": mission_s,
        }
        return {**suite_figures(env), "clock": rounded(clock)}


def replay_commands(
    env: EntropyExploreEnv,
    record: MissionRecord,
    after_step: Callable[[EntropyExploreEnv], None] | None = None,
    before_step: Callable[[Mapping[str, Any]], None] | None = None,
) -> int:
    """Give an environment the commands of a record, until they or the mission end; see `run_mission`.

    The environment was just reset, as the record's mission was.

    Returns:
        How many commands were given.
    """
    for number, commands in enumerate(record.commands):
        if not env.agents:
            return number
        actions = {}
        for agent, command in zip(env.agents, commands, strict=True):
            shape = env.action_space(agent).shape
            actions[agent] = command[: shape[0]] if shape else command  # what filled it up is cut off
        if before_step is not None:
            before_step(actions)
        env.step(actions)
        if after_step is not None:
            after_step(env)
    return len(record.commands)


def suite_figures(env: EntropyExploreEnv) -> Record:
    """Return what suites keep of the mission that an environment is in: figures of the team, rounded.

    It is `mission_figures` with `scans_over_floor`, without those of single robots.
    """
    figures = mission_figures(env.missions, 0, floor=True)
    del figures["per_robot"]
    return rounded(figures)


def rounded(figures: Any) -> Any:  # noqa: ANN401 - a number, text or object of JSON
    """Return figures with all floats at a few significant digits."""
    if isinstance(figures, dict):
        return {name: rounded(value) for name, value in figures.items()}
    return float(f"{figures:.{_DIGITS}g}") if isinstance(figures, float) else figures
