"""The suites: worlds and starts that are pinned, so that figures of different strategies can be compared.

    plans     floor plans, one ground robot that replans at every scan under way, until everything that can be
              seen is seen: how far it drives, and how long
    volumes   3-D worlds and the office, one robot and three, as the scenarios stand, until a map passes the
              mission's entropy threshold
    teams     1, 2, 4 and 8 robots with a channel that carries everything; 4 also with a narrow one, with one
              that loses half of the messages, and with one that needs a line of sight
    others    the named scenarios that no other suite has, as they stand, with their own teams

Worlds of recipes are those of the test split, which nothing was tuned on; mission k of a task has seed k for
every strategy. The dungeons are those of ARiADNE (Cao et al., ICRA 2023): a sensor of 80 cells, a robot
without a body, the start mark as start, and the end when at most 250 free cells are unseen. In the other
plans robots have no body either, so that all cells can be seen.

In all plans the lidar has 720 rays, as the dungeons' authors have it and as real ones have, and reaches 80
cells, so that rays are 0.7 cells apart there; the scenarios have 180, which leave single cells unknown
between them. It scans every 0.5 m of the way.
"""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from baselines.experiments.cells import Cell
from baselines.experiments.mission import Surroundings, scripted
from baselines.scoreboard.mission import SuiteMission
from baselines.strategies.table import suite_names
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import SCENARIOS
from entropy_explore_env.settings import Grid

WORLDS = Path(__file__).parent / "worlds"
STARTS = WORLDS / "starts.csv"
VOXEL_SIZES_M = {"warehouse": 0.1, "depot": 0.1, "willow": 0.1, "geb079": 0.16}
"""Of the worlds in WORLDS; the dungeons' are those of `DUNGEON_CELL_M`."""
DUNGEON_CELL_M = 0.1
STARTS_A_TASK, QUICK_STARTS = 30, 2
QUICK_DUNGEONS = 2
"""In quick suites, which take two processors less than ten minutes each; what costs most is left out."""
SCAN_EVERY_M = 0.5
"""Plans: everybody scans, and may replan, whenever so much of the way is driven."""
ANGULAR_STEP_RAD = math.pi / 360
"""Plans: between two rays of the lidar."""
DUNGEON_UNSEEN = 250
OTHERS = (
    "box-7x11x5",
    "lab",
    "occlusions",
    "cliff",
    "bhattacharya-office",
    "bhattacharya-cluttered",
    "office-mixed",
    "terrain-smooth",
    "terrain-rough",
)
"""Scenarios of the suite with this name."""
_ALL: Mapping[str, Any] = {"seen_share": 1.0}
_WHOLE: Mapping[str, Any] = {"burst": 1_000_000, "i_min_bits": 0.0}
_CHANNELS: Mapping[str, Mapping[str, Any]] = {
    "": _WHOLE,
    ", burst 64": {"burst": 64},
    ", half of the messages lost": {**_WHOLE, "loss_probability": 0.5},
    ", in line of sight": {**_WHOLE, "reach": "line_of_sight"},
}
"""Channels of teams: what stands after a task's name, and the settings; the first carries everything."""


@dataclass(frozen=True)
class Place:
    """A scenario, and the missions that are run in it.

    Attributes:
        name: Of its folder of results.
        scenario: Tracks the truth.
        missions: Their number; their seeds are 0, 1, ….
        start: x, y, z, yaw, pitch of one robot; None = drawn from the seed.
        surroundings: World files, starts and length of a step; None = those that the scenario says.
    """

    name: str
    scenario: Scenario
    missions: int
    start: tuple[float, float, float, float, float] | None = None
    surroundings: Surroundings | None = None


@dataclass(frozen=True)
class Task:
    """A row of the table for each strategy.

    Attributes:
        name: As the table says it.
        places: Their missions, one after the other, are those of the task.
        beside: Name of the task from which it differs by its team or its channel alone; None = of none.
    """

    name: str
    places: tuple[Place, ...]
    beside: str | None = None

    @property
    def scenario(self) -> Scenario:
        """Of the first place; all have the same settings but for the world."""
        return self.places[0].scenario

    @property
    def folder(self) -> str:
        """Of its results."""
        return "-".join(self.name.replace(",", "").split())

    @property
    def missions(self) -> int:
        """N, of all places."""
        return sum(place.missions for place in self.places)


@dataclass(frozen=True)
class Suite:
    """What is run.

    Attributes:
        name: `plans`, `volumes`, `teams`, `others`, or `own` for scenarios of one's own.
        tasks: The rows of each strategy.
        strategies: Names.
    """

    name: str
    tasks: tuple[Task, ...]
    strategies: tuple[str, ...]

    def cell_id(self, task: Task, place: Place, strategy: str) -> str:
        """Name of a cell of missions."""
        where = f"{task.folder}/{place.name}" if len(task.places) > 1 else task.folder
        return f"{where}/{strategy}"

    @cached_property
    def cells(self) -> list[Cell]:
        """All cells, strategies of one place beside each other; mission k of every task is run in round k."""
        return [
            Cell(
                self.cell_id(task, place, strategy),
                place.scenario,
                strategy,
                place.missions,
                SuiteMission(place.start),
                place.surroundings,
                round=sum(before.missions for before in task.places[:number]),
                group=f"{task.folder}/{strategy}",
            )
            for task in self.tasks
            for number, place in enumerate(task.places)
            for strategy in self.strategies
        ]


def plans(quick: bool = False) -> tuple[Task, ...]:
    """One ground robot in floor plans, replanning at every scan, until everything is seen."""
    starts = QUICK_STARTS if quick else STARTS_A_TASK
    names = ("office", "corridor", "cluttered", "hybrid")
    chosen = {name: SCENARIOS[name] for name in (names[:2] if quick else names)}
    if not quick:
        chosen |= {name: _in_file(SCENARIOS["office"], name) for name in ("depot", "warehouse", "willow")}
    return (
        _dungeons(QUICK_DUNGEONS if quick else None),
        *(
            task_in(name, _explored(scenario, {"seen_share": 1.0}), starts)
            for name, scenario in chosen.items()
        ),
    )


def volumes(quick: bool = False) -> tuple[Task, ...]:
    """One robot and three in 3-D worlds and the office, as the scenarios stand.

    Building 079 is explored by half: its voxels are small and many, and mapping all takes robots hours.
    """
    starts = QUICK_STARTS if quick else STARTS_A_TASK
    names = ("room", "room-furnished", "office", "office-3d", "cave", "terrain")
    worlds = {name: SCENARIOS[name] for name in (names[:3] if quick else names)}
    if not quick:
        half = {"seen_share": 0.5, "time_limit_s": 14_400.0}
        worlds["geb079"] = _in_file(SCENARIOS["office-3d"], "geb079", {"ending": half})
    return tuple(
        task_in(team_name(name, robots), with_settings(scenario, {"robots": robots}), starts)
        for name, scenario in worlds.items()
        for robots in (1, 3)
    )


def teams(quick: bool = False) -> tuple[Task, ...]:
    """Teams of 1, 2, 4 and 8 robots, with channels of different width."""
    starts = QUICK_STARTS if quick else STARTS_A_TASK
    names = ("room-furnished", "office", "office-3d", "cave", "terrain")
    worlds = {name: SCENARIOS[name] for name in (("office",) if quick else names)}
    if not quick:
        worlds["warehouse"] = _in_file(SCENARIOS["office"], "warehouse")
    return tuple(
        dataclasses.replace(
            task_in(
                team_name(name, robots) + words,
                with_settings(scenario, {"robots": robots, "channel": channel}),
                starts,
            ),
            beside=team_name(name, robots) if words else team_name(name, 1) if robots > 1 else None,
        )
        for name, scenario in worlds.items()
        for words, channel in _CHANNELS.items()
        for robots in ((1, 2, 4, 8) if not words else (4,))
    )


def others(quick: bool = False) -> tuple[Task, ...]:
    """The named scenarios that no other suite has, as they stand."""
    starts = QUICK_STARTS if quick else STARTS_A_TASK
    names = ("box-7x11x5", "lab", "bhattacharya-office") if quick else OTHERS
    return tuple(task_in(team_name(name, SCENARIOS[name].robots), SCENARIOS[name], starts) for name in names)


SUITES = {"plans": plans, "volumes": volumes, "teams": teams, "others": others}
"""Name → a function of `quick` that makes the tasks."""


def suite_strategies(name: str) -> tuple[str, ...]:
    """Return the strategies of a suite's table.

    Raises:
        SettingError: No suite has this name.
    """
    _check_suite(name)
    return suite_names(name)


def _check_suite(name: str) -> None:
    """Raise an error if no suite has this name."""
    if name not in SUITES:
        raise SettingError("suite", name, one_of(name, SUITES))


def find_suite(name: str, quick: bool, strategies: tuple[str, ...]) -> Suite:
    """The suite with a name.

    Args:
        name: One of SUITES.
        quick: Few worlds and starts.
        strategies: Names.

    Raises:
        SettingError: No suite has this name, or its worlds are not where they should be.
    """
    _check_suite(name)
    return Suite(name, SUITES[name](quick), strategies)


def task_in(name: str, scenario: Scenario, missions: int, split: str = "test") -> Task:
    """A task in one scenario, in worlds of a split.

    Args:
        name: Of the task.
        scenario: Whose worlds are drawn.
        missions: Their number.
        split: `train` or `test`.
    """
    tested = with_settings(scenario, {"split": split, "track_truth": True})
    return Task(name, (Place(name, tested, missions),))


def team_name(name: str, robots: int) -> str:
    """A task's name: the scenario and the team size."""
    return f"{name}, {robots} robot" + ("s" if robots > 1 else "")


def _explored(scenario: Scenario, ending: Mapping[str, Any]) -> Scenario:
    """A scenario whose one robot replans at every scan and has no body, with the suite's lidar and an end."""
    changes = {
        "robots": 1,
        "robot": {"redecide": "on_scan", "body_radius_m": 0.0},
        "sensor": {"scan_every_m": SCAN_EVERY_M, "angular_step_rad": ANGULAR_STEP_RAD},
        "ending": {**ending, "time_limit_s": 7200.0},
    }
    return with_settings(scenario, changes)


def _in_file(scenario: Scenario, name: str, settings: Mapping[str, Any] | None = None) -> Scenario:
    """A scenario in one of the worlds that come with the suites.

    Raises:
        SettingError: The world is not there.
    """
    path = _world_file(name)
    grid = _grid_of(path, VOXEL_SIZES_M.get(name, DUNGEON_CELL_M))
    return with_settings(dataclasses.replace(scenario, name=name, world=path, grid=grid), settings or {})


def _world_file(name: str) -> str:
    """The path of a world; an error if it is not there."""
    path = WORLDS / f"{name}.npz"
    if not path.is_file():
        allowed = "there: it comes with the project; make it again with baselines.scoreboard.pack_worlds"
        raise SettingError("suite world", str(path), allowed)
    return str(path)


@lru_cache(maxsize=16)
def _grid_of(path: str, voxel_size_m: float) -> Grid:
    """The grid of a saved world, read as environments read it."""
    base = with_settings(SCENARIOS["office"], {"world": path, "grid": {"voxel_size_m": voxel_size_m}})
    return EntropyExploreEnv(scripted(base)).scenario.grid


def _dungeons(count: int | None, every: int = 1) -> Task:
    """ARiADNE's dungeons, of each `every` the first; None = all of these."""
    if not STARTS.is_file():
        raise SettingError("suite world", str(STARTS), "there: it comes with the project")
    with STARTS.open(newline="") as file:
        rows = list(csv.DictReader(file))[::every][:count]
    seen_from_afar = {
        "robot": {"reach_m": 8.0},
        "sensor": {"max_range_m": 8.0},
        "track_truth": True,
    }
    base = _explored(SCENARIOS["office"], {"unseen_free_voxels": DUNGEON_UNSEEN})
    first = _in_file(with_settings(base, seen_from_afar), f"dungeons/{rows[0]['dungeon']}")
    places = []
    for row in rows:  # all of one grid
        world = _world_file(f"dungeons/{row['dungeon']}")
        start = (float(row["x_m"]), float(row["y_m"]), DUNGEON_CELL_M / 2, 0.0, 0.0)
        places.append(
            Place(row["dungeon"], dataclasses.replace(first, name="dungeon", world=world), 1, start)
        )
    return Task("dungeons", tuple(places))
