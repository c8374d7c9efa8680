"""What a predicted map brings the planner, beside one probability everywhere, and the true map.

Ground robots in plans and flying ones in caves until their map is known, as the scenarios stand. The
predictors have seen other worlds of the recipes, no plan like the warehouse, and of the dungeons those of odd
number: here are the others, with robots that have no body. The bound knows what each unknown voxel is, but
plans as the planner does.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from baselines.experiments.statistics import Interval
from baselines.experiments.tables import markdown_table
from baselines.suites.public_worlds import in_world
from baselines.suites.results import Results
from baselines.suites.suite import PATH, QUICK_STARTS, STARTS, TIME, Place, Task, task_in, team_name
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.explorer.planned_rate import LearnedForesight, PlannedRate
from entropy_explore_env.prediction.predictor import MapPredictor, Prediction, read_predictor
from entropy_explore_env.prediction.volumes import read_volume_predictor
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS

TEAMS = (
    ("corridor", 1),
    ("corridor", 3),
    ("hybrid", 1),
    ("hybrid", 3),
    ("cluttered", 1),
    ("office", 1),
    ("office", 3),
    ("warehouse", 4),
    ("cave", 1),
    ("cave", 3),
)
QUICK_TEAMS = TEAMS[:1]
MEASURES = (TIME, PATH)
_DUNGEONS, _QUICK_DUNGEONS = range(2, 101, 2), range(2, 6, 2)
DUNGEONS = "dungeons, 1 robot"
GOALS: Mapping[str, float] = MappingProxyType(
    {
        **{team_name(name, robots): 0.90 for name in ("corridor", "hybrid") for robots in (1, 3)},
        **{team_name("office", 1): 0.88, team_name("office", 3): 0.85, DUNGEONS: 0.85},
        team_name("cave", 3): 0.95,
    }
)
"""Task → what the ratio of time was hoped to be at most."""


class Unpredicted(PlannedRate):
    """The planner to which nothing is predicted."""

    def __init__(self) -> None:
        """Predict nothing."""
        super().__init__(foresight=None)


class Constant(PlannedRate):
    """The planner whose imagined rays stop in every unknown voxel with one probability, a high one.

    Of those tried in caves of the training split, the one with which a team of three takes the least time.
    """

    IN_PLANS, IN_VOLUMES = 0.3, 0.85

    def __init__(self) -> None:
        """Take the same probability for all voxels."""
        super().__init__(foresight=lambda: self._solid)

    def _solid(self, view: RobotKnowledge) -> np.ndarray:
        stops = self.IN_PLANS if view.scenario.grid.flat else self.IN_VOLUMES
        return np.full(view.precision.size, stops, np.float32)


class TrueMap(PlannedRate):
    """The planner whose imagined rays stop where they would stop in the true map; a bound."""

    def __init__(self) -> None:
        """Wait for the true map."""
        super().__init__(foresight=lambda: self._solid)
        self._env: EntropyExploreEnv | None = None

    def tell_truth(self, env: EntropyExploreEnv) -> None:
        """Take the environment whose world is the true map."""
        self._env = env

    def _solid(self, _: RobotKnowledge) -> np.ndarray:
        world = None if self._env is None else self._env.missions.worlds[0]
        if world is None:
            raise SettingError("strategy", "TrueMap", "no strategy but in the suite `prediction`")
        return world.occupied.astype(np.float32).reshape(-1)


class LeftOut(PlannedRate):
    """The planner whose predictor never saw a world of the mission's recipe.

    `python -m training.map_predictor --leave-out RECIPE --out runs/without-RECIPE` trains it; for volumes,
    add `--recipes cave office-3d`.
    """

    def __init__(self) -> None:
        """Wait for the mission's recipe."""
        super().__init__(foresight=lambda: LearnedForesight(self._predictor))
        self._predictor: MapPredictor[Prediction | np.ndarray] | None = None

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        recipe = re.sub(r"-\d+$", "", str(scenario.world))  # dungeons have a number
        file = Path("runs") / f"without-{recipe}" / "predictor.safetensors"
        if not file.is_file():
            recipes = "" if scenario.grid.flat else "--recipes cave office-3d "
            trained = f"python -m training.map_predictor {recipes}--leave-out {recipe} --out {file.parent}"
            raise SettingError("strategy", "LeftOut", f"{file}, which `{trained}` writes; then --rerun")
        self._predictor = read_predictor(file) if scenario.grid.flat else read_volume_predictor(file)
        super().reset(scenario, rng)


WITHOUT, CONSTANT, TRUE_MAP, LEFT_OUT = (
    f"{__name__}:{each.__name__}" for each in (Unpredicted, Constant, TrueMap, LeftOut)
)
STRATEGIES = (WITHOUT, "planned-rate", TRUE_MAP, CONSTANT)


def tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks: teams in plans and caves, and one robot in dungeons."""
    starts = QUICK_STARTS if quick else STARTS
    base = SCENARIOS["office"]
    dungeons = (f"dungeon-{number}" for number in (_QUICK_DUNGEONS if quick else _DUNGEONS))
    alone = {"robots": 1, "robot": {"body_radius_m": 0.0}, "track_truth": True}
    return (
        *(
            task_in(
                team_name(name, robots), SCENARIOS.get(name) or in_world(base, name), starts, robots=robots
            )
            for name, robots in (QUICK_TEAMS if quick else TEAMS)
        ),
        Task(DUNGEONS, tuple(Place(name, in_world(base, name, alone), 1) for name in dungeons)),
    )


def bounds_table(results: Results) -> str:
    """Return the table of what the prediction brings in each task, beside what the true map does."""
    head = ["task", "missions", "time (s) without"]
    for name in ("predicted", "true map"):
        head += [f"{name}: {measure.words.split()[0]}" for measure in MEASURES]
    head += ["recipe left out: time", "one probability: time", "goal of time, met"]
    rows = []
    for task in results.tasks:
        alone = results.values(task, WITHOUT, TIME)
        cells = [task.name, len(alone), f"{alone.mean():.0f}"]
        for name in ("planned-rate", TRUE_MAP):
            cells += [_shown(results.ratio(name, WITHOUT, measure, [task])) for measure in MEASURES]
        cells += [_shown(results.ratio(name, WITHOUT, TIME, [task])) for name in (LEFT_OUT, CONSTANT)]
        rows.append([*cells, _judged(results, task)])
    return markdown_table(head, rows)


def _shown(ratio: Interval | None) -> str:
    return "-" if ratio is None else f"{ratio:.2f}"


def _judged(results: Results, task: Task) -> str:
    """Return the goal of a task, and whether the ratio and its whole interval are below it."""
    goal, ratio = GOALS.get(task.name), results.ratio("planned-rate", WITHOUT, TIME, [task])
    if goal is None or ratio is None:
        return "-"
    met = "yes" if ratio.high <= goal else "by the mean" if ratio.value <= goal else "**no**"
    return f"{goal:.2f}, {met}"
