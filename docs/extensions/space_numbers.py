"""Every number of a scenario's observation and action: what it means, its unit and its range."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.observation.layout import ObservationLayout, Part
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.planner.candidate_features import CONTEXT, FEATURES
from entropy_explore_env.settings.scenario import Scenario


class Numbers(NamedTuple):
    """Some numbers that stand side by side and mean the same.

    Attributes:
        first: Index of the first one, in the part or the action.
        count: How many they are.
        meaning: What they say.
        unit: `-` where they have none.
        low, high: What they lie between; the bounds of the space may be wider.
    """

    first: int
    count: int
    meaning: str
    unit: str
    low: float
    high: float

    @property
    def indices(self) -> str:
        """`3`, or `3 … 5`."""
        last = self.first + self.count - 1
        return str(self.first) if self.count == 1 else _span(str(self.first), str(last))

    @property
    def range(self) -> str:
        """`-1 … 1`."""
        return _span(f"{self.low:.4g}", f"{self.high:.4g}")


def _span(low: str, high: str) -> str:
    """`low … high`, in one line of a narrow column."""
    return f"{low}\N{NO-BREAK SPACE}…\N{NO-BREAK SPACE}{high}"


class _Told(NamedTuple):
    """What is said of some numbers, and from what on they are, where the space's bound is lower."""

    count: int
    meaning: str
    unit: str
    least: float | None = None


def _relative_pose(of: str) -> list[_Told]:
    """Return the seven numbers of a pose as another robot's observation tells it."""
    places = [
        _Told(1, f"{of}: how far away along {axis}, in sizes of the workspace", "share") for axis in "xyz"
    ]
    return places + _angles(f"{of}: ")


def _angles(of: str) -> list[_Told]:
    """Cos and sin of yaw and pitch."""
    return [
        _Told(1, f"{of}{ratio} of {angle}", "-")
        for angle in ("the yaw", "the pitch, downwards")
        for ratio in ("cos", "sin")
    ]


class PartNumbers(NamedTuple):
    """A part of an observation.

    Attributes:
        shape: Of its array.
        rows: How often its numbers come one after the other: in `team` once for each teammate, in
            `candidates` once for each candidate, else once.
        numbers: Those of a row, in their order, none left out and none twice.
    """

    shape: tuple[int, ...]
    rows: int
    numbers: list[Numbers]


def observation_numbers(scenario: Scenario) -> dict[str, PartNumbers]:
    """Name of a part → its numbers."""
    layout = ObservationLayout(scenario)
    return {name: _part_numbers(name, part, scenario) for name, part in layout.parts.items()}


def _part_numbers(name: str, part: Part, scenario: Scenario) -> PartNumbers:
    """Return a part's numbers, with their indices and the bounds of their space."""
    high = np.broadcast_to(part.high, part.shape).ravel()
    rows = part.shape[0] if name in ("team", "candidates") else 1
    numbers: list[Numbers] = []
    first = 0
    for count, meaning, unit, least in _told(name, part, scenario):
        low = part.low if least is None else least
        numbers.append(Numbers(first, count, meaning, unit, low, float(high[first])))
        first += count
    if first * rows != part.stop - part.start:
        raise ValueError(f"{first * rows} numbers are told of, {name} has {part.stop - part.start}")
    return PartNumbers(part.shape, rows, numbers)


def _told(name: str, part: Part, scenario: Scenario) -> list[_Told]:
    """Return what is said of a part's numbers, or of those of one of its rows."""
    cells = math.prod(part.shape[1:])
    if name == "panorama":
        unit = "log2(1 + bits)" if scenario.observation.panorama_utility == "log2" else "bits"
        return [
            _Told(cells, "what a ray in each direction would bring by the robot's own map", unit),
            _Told(cells, "how far that ray would go before something that the robot believes covered", "m"),
        ]
    if name == "self":
        return _own_state(len(scenario.kinds))
    if name == "drive":
        speed = _Told(1, "speed, as a share of the top speed", "share", 0.0)
        return [speed, *_relative_pose("the viewpoint chosen last")]
    if name == "team":
        return _teammate()
    if name == "patch":
        return [
            _Told(cells, "expected coverage of the voxels around the robot: 0 free, 1 covered", "-"),
            _Told(cells, "their entropy: 1 as before any measurement, 0 where known well enough", "share"),
            _Told(cells, "1 outside the workspace", "-"),
            _Told(cells, "1 where a teammate was last heard", "-"),
        ]
    if name in ("candidates", "context"):
        features = FEATURES if name == "candidates" else CONTEXT
        return [_Told(1, f"`{each.name}`: {each.meaning}", each.unit, each.least) for each in features]
    if name == "overlaps":
        shared = "share of the voxels of each two candidates, of those of the one that sees fewer"
        return [_Told(math.prod(part.shape), shared, "share")]
    if name == "overview":
        return [
            _Told(cells, "mean entropy of each block of the map: 1 unknown, 0 known well enough", "share"),
            _Told(cells, "mean expected coverage of each block", "-"),
        ]
    if name == "prediction":
        return [
            _Told(
                cells, "probability of the cells around the robot to be solid: predicted, or measured", "-"
            ),
            _Told(cells, "1 where something was measured", "-"),
        ]
    return [_Told(math.prod(part.shape), "1 for each action by number that makes sense", "-")]


def _own_state(kinds: int) -> list[_Told]:
    """Return the part `self`."""
    told = [
        _Told(1, f"{axis} in the workspace: -1 at its lower edge, 1 at its upper one", "share")
        for axis in "xyz"
    ]
    told += _angles("")
    told += [
        _Told(1, "time gone, as a share of the time limit; 0 without one", "share", 0.0),
        _Told(1, "entropy left in the robot's map: 1 at the start, 0 with all voxels known", "share", 0.0),
        _Told(1, "1 while the robot decides, 0 while it is busy and its action is ignored", "-", 0.0),
    ]
    if kinds > 1:
        told += [_Told(1, f"1 if the robot is of kind {kind}", "-", 0.0) for kind in range(kinds)]
    return told


def _teammate() -> list[_Told]:
    """Return a row of the part `team`."""
    return [
        _Told(1, "1 if the teammate was ever heard; the next eight are 0 until then", "-", 0.0),
        *_relative_pose("where it was last heard"),
        _Told(1, "seconds s since then, as s/(s + 60)", "-", 0.0),
        _Told(1, "1 if an announcement of it was heard; the rest is 0 until then", "-", 0.0),
        *_relative_pose("the viewpoint that it announced"),
        _Told(1, "r̂, how far it expects to see there, in diagonals of the workspace", "share", 0.0),
        _Told(1, "α̂/π, half the angle of what it expects to see there", "share", 0.0),
    ]


def action_numbers(scenario: Scenario) -> list[Numbers]:
    """Return the numbers of a continuous action, in their order."""
    unlimited = any(math.isinf(kind.robot.reach_m) for kind in scenario.kinds)
    if unlimited:
        told = [f"{axis} of the viewpoint in the workspace: -1 the first voxel, 1 the last" for axis in "xyz"]
    else:
        told = [f"displacement along {axis}, in shares of the reach" for axis in "xyz"]
    if not scenario.planar:
        told[2] += _ignored_by(scenario.layer_of(kind.robot) is not None for kind in scenario.kinds)
    told = [*told[: 2 if scenario.planar else 3], "yaw of the gaze, in π radians"]
    if not scenario.planar:
        level = _ignored_by(scenario.looks_level(kind.robot) for kind in scenario.kinds)
        told.append("pitch of the gaze, downwards, in π/2 radians" + level)
    space = action_space(scenario)
    if (len(told),) != space.shape:
        raise ValueError(f"{len(told)} numbers are told of, an action has the shape {space.shape}")
    return [Numbers(i, 1, meaning, "share", -1.0, 1.0) for i, meaning in enumerate(told)]


def _ignored_by(kinds: Iterable[bool]) -> str:
    """Return what is said of a number of an action that means nothing to some kinds of robots."""
    ignored = list(kinds)
    if not any(ignored):
        return ""
    return f"; means nothing {'here: all robots stay in a plane' if all(ignored) else 'to ground robots'}"


def discrete_actions(scenario: Scenario) -> tuple[int, int]:
    """How many moves, and how many gazes, a scenario's discrete actions are made of."""
    actions = rules_of(scenario).actions
    return len(actions.moves), len(actions.gazes)
