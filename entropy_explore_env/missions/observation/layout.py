"""What a robot observes: parts of one flat float32 vector, written by compiled code.

Parts, in this order, each only if the scenario's settings ask for it (D directions, A robots):

    panorama  (2, D)       utility in bits that a ray would bring by the robot's own belief (or
                           log2(1 + bits)), 0 where its return would be too near for the sensor; and
                           the metres that it would go before something believed covered;
                           directions in the order of `gaze_set`
    self      (10 + K,)    position in the workspace, -1…1 (x, y, z); cos and sin of yaw, cos and
                           sin of pitch; share of the time limit gone (0 without one); share of
                           the map's entropy left, counting every voxel; 1 while it decides; in
                           teams of K > 1 kinds of robots 1 for its kind, 0 for the others
    drive     (8,)         speed as a share of the top speed; the viewpoint that the robot chose
                           last: where it is, relative, in workspace sizes (3); cos and sin of its
                           yaw and of its pitch (4)
    team      (A-1, 19)    per teammate, in the order of their numbers: 1 if ever heard; where it
                           was, relative, in workspace sizes (3); cos and sin of its yaw and of its
                           pitch (4); seconds since then as s/(s + 60); 1 if an announcement was
                           heard; its viewpoint in the same way (7); r̂ in workspace diagonals; α̂/π;
                           zeros if unheard
    patch     (4, x, y, z) belief around the robot: expected coverage, normalised entropy, 1
                           outside the workspace, 1 where a teammate was last heard
    overview  (2, x, y, z) the whole belief, averaged over blocks: normalised entropy, expected
                           coverage
    prediction (2, x, y)   cells of 0.2 m around the robot: probability to be solid, where nothing was
                           measured by a network (`prediction`), else by the belief; 1 where
                           something was measured
    candidates (K, F)      candidates as actions: their features, `viewpoints.candidate_features.FEATURES`;
                           zeros for those that there are not, and while the robot is busy
    context   (C,)         what is true of all of them, `viewpoints.candidate_features.CONTEXT`; likewise
    overlaps  (K, K)       voxels that two of them see, as a share of those of the one that sees fewer
    action_mask (N,)       1 for each action by number that makes sense, or candidate that there is; for a
                           busy robot, which has no candidates, the first is 1

Normalised entropy is 1 at the prior and 0 at the voxel entropy that ends a mission (clipped).
A busy robot observes from where it is under way, or zeros if the scenario says so. Only a robot's own
belief and what it heard over the channel enter.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import numpy as np
from gymnasium import spaces

from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.missions.observation.belief import (
    OVERVIEW_CHANNELS,
    PATCH_CHANNELS,
    PREDICTION_CHANNELS,
)
from entropy_explore_env.missions.observation.robots import DRIVE_VALUES, SELF_VALUES, TEAMMATE_VALUES
from entropy_explore_env.missions.rules import Rules, action_count, overview_shape, rules_of
from entropy_explore_env.planner.candidate_features import CONTEXT, FEATURES
from entropy_explore_env.settings.scenario import Scenario

_Space = TypeVar("_Space", bound=spaces.Space)


class Part(NamedTuple):
    """Where a part lies in the flat vector, and what it looks like."""

    start: int
    stop: int
    shape: tuple[int, ...]
    low: float
    high: np.ndarray
    """Broadcast to `shape`."""


class ObservationLayout:
    """The parts of a scenario's observation, and the spaces made of them."""

    def __init__(self, scenario: Scenario) -> None:
        """Lay out the parts that the scenario asks for."""
        self.parts = observation_parts(scenario)
        self.size = max((part.stop for part in self.parts.values()), default=0)
        self.flat = scenario.observation.flat
        self.low = np.concatenate([np.full(p.stop - p.start, p.low) for p in self.parts.values()] or [[]])
        self.high = np.concatenate(
            [np.broadcast_to(p.high, p.shape).ravel() for p in self.parts.values()] or [[]]
        )

    def space(self) -> spaces.Space:
        """Return a new space object of one robot's observation: a Dict of parts, or one Box."""
        if self.flat:
            return self.flat_space()
        return short_repr(spaces.Dict({name: _part_space(name, part) for name, part in self.parts.items()}))

    def flat_space(self, robots: int | None = None) -> spaces.Box:
        """Return one robot's observation as a Box, or that of a whole team one after the other."""
        low, high = self.low.astype(np.float32), self.high.astype(np.float32)
        if robots is not None:
            low, high = np.tile(low, robots), np.tile(high, robots)
        return short_repr(spaces.Box(low, high, dtype=np.float32))

    def split(self, vectors: np.ndarray) -> np.ndarray | dict[str, np.ndarray]:
        """Return an observation from flat vectors (..., size) float32; parts are views of them."""
        if self.flat:
            return vectors
        parts: dict[str, np.ndarray] = {}
        for name, part in self.parts.items():
            values = vectors[..., part.start : part.stop].reshape(vectors.shape[:-1] + part.shape)
            parts[name] = values.astype(np.int8) if name == "action_mask" else values
        return parts

    def split_rows(self, rows: np.ndarray) -> list[np.ndarray] | list[dict[str, np.ndarray]]:
        """Return the observations of robots one by one, from their flat vectors (A, size) float32."""
        together = self.split(rows)
        if isinstance(together, np.ndarray):
            return list(together)
        return [{name: values[row] for name, values in together.items()} for row in range(len(rows))]


def short_repr(space: _Space) -> _Space:
    """Return the space, whose text says the range of its bounds and not each of them."""
    if isinstance(space, spaces.Dict):
        for part in space.spaces.values():
            short_repr(part)
    if isinstance(space, spaces.Box):
        space.low_repr, space.high_repr = _range_text(space.low), _range_text(space.high)
    return space


def _range_text(bounds: np.ndarray) -> str:
    """Return one number where all are alike, else the least and the largest."""
    if bounds.size == 0:
        return "-"
    least, most = float(bounds.min()), float(bounds.max())
    return f"{least:g}" if least == most else f"{least:g}…{most:g}"


def _part_space(name: str, part: Part) -> spaces.Box:
    if name == "action_mask":
        return spaces.Box(0, 1, part.shape, np.int8)
    high = np.broadcast_to(part.high, part.shape).astype(np.float32)
    return spaces.Box(np.full(part.shape, part.low, np.float32), high, dtype=np.float32)


def observation_parts(scenario: Scenario) -> dict[str, Part]:
    """Return the parts' shapes and bounds, in order; no array as large as an observation is made."""
    settings, rules = scenario.observation, rules_of(scenario)
    limits: dict[str, tuple[tuple[int, ...], float, np.ndarray]] = {}
    one = np.ones(1)
    if settings.panorama:
        most = _most_utility_bits(scenario, rules)
        farthest = min(
            max(kind.sensor.max_range_m for kind in scenario.kinds),
            float(np.linalg.norm(scenario.grid.size_m)),
        )
        high = np.asarray(
            [[math.log2(1 + most) if rules.params[0]["panorama_log"] else most], [farthest]]
        ) * (1 + 1e-6)
        limits["panorama"] = ((2, len(rules.panorama)), 0.0, high)
    if settings.self_state:
        kinds = len(scenario.kinds)
        limits["self"] = ((SELF_VALUES + (kinds if kinds > 1 else 0),), -1.0, one)
    if settings.drive:
        limits["drive"] = ((DRIVE_VALUES,), -1.0, one)
    if settings.team and scenario.robots > 1:
        limits["team"] = ((scenario.robots - 1, TEAMMATE_VALUES), -1.0, one)
    if settings.patch:
        limits["patch"] = ((PATCH_CHANNELS, *settings.patch_shape), 0.0, one)
    if (cells := overview_shape(scenario)) is not None:
        limits["overview"] = ((OVERVIEW_CHANNELS, *cells), 0.0, one)
    if settings.prediction:
        limits["prediction"] = ((PREDICTION_CHANNELS, *settings.prediction_shape), 0.0, one)
    if scenario.action.kind == "candidates":
        limits.update(_candidate_parts(scenario))
    if settings.action_mask and scenario.action.by_number:
        limits["action_mask"] = ((action_count(scenario, rules),), 0.0, one)
    parts, start = {}, 0
    for name, (shape, low, high) in limits.items():
        stop = start + math.prod(shape)
        parts[name] = Part(start, stop, shape, low, high)
        start = stop
    return parts


def _candidate_parts(scenario: Scenario) -> dict[str, tuple[tuple[int, ...], float, np.ndarray]]:
    """Return the shapes and bounds of the parts that describe candidates."""
    most, one = scenario.action.candidates, np.ones(1)
    parts: dict[str, tuple[tuple[int, ...], float, np.ndarray]] = {}
    if scenario.observation.candidates:
        parts["candidates"] = ((most, len(FEATURES)), -1.0, one)
        parts["context"] = ((len(CONTEXT),), 0.0, one)
    if scenario.observation.overlaps:
        parts["overlaps"] = ((most, most), 0.0, one)
    return parts


def _most_utility_bits(scenario: Scenario, rules: Rules) -> float:
    """Return a bound of what a ray can bring: the longest one, over voxels that were never measured."""
    most, prior = 0.0, float(rules.params[0]["prior_precision"])
    for kind in scenario.kinds:
        length = kind.sensor.max_range_m / scenario.grid.voxel_size_m
        voxels = longest_crossing(*scenario.grid.shape, length, kind.sensor.voxels_behind)
        most = max(most, voxels * 0.5 * math.log2(1.0 + 1.0 / kind.sensor.sigma_min**2 / prior))
    return most


class PartOffsets(NamedTuple):
    """The layout for compiled code: where each part begins; None if it is left out, and not compiled then."""

    panorama: int | None
    self_state: int | None
    drive: int | None
    team: int | None
    patch: int | None
    overview: int | None
    prediction: int | None
    action_mask: int | None
    """Of discrete actions."""
    patch_shape: tuple[int, int, int]
    prediction_shape: tuple[int, int]
    kinds: int
    """K, of robots; 0 if all are alike."""
    while_busy: bool
    """Whether robots that do not decide observe, too."""


class CandidateOffsets(NamedTuple):
    """Where the parts about candidates begin, for compiled code of its own; -1 = one is left out."""

    candidates: int
    context: int
    overlaps: int
    action_mask: int
    while_busy: bool
    """Whether robots that do not decide observe, too."""


def candidate_offsets(scenario: Scenario, layout: ObservationLayout) -> CandidateOffsets:
    """Return what compiled code needs of a layout to write what is about candidates."""
    names = ("candidates", "context", "overlaps", "action_mask")
    begin = [layout.parts[name].start if name in layout.parts else -1 for name in names]
    return CandidateOffsets(*begin, while_busy=scenario.observation.while_busy)


def part_offsets(scenario: Scenario, layout: ObservationLayout) -> PartOffsets:
    """Return what compiled code needs of a layout."""
    begin = {name: part.start for name, part in layout.parts.items()}
    patch, predicted = scenario.observation.patch_shape, scenario.observation.prediction_shape
    names = ("panorama", "self", "drive", "team", "patch", "overview", "prediction", "action_mask")
    if scenario.action.kind == "candidates":  # which are written elsewhere
        begin.pop("action_mask", None)
    return PartOffsets(
        *map(begin.get, names),
        patch_shape=(int(patch[0]), int(patch[1]), int(patch[2])),
        prediction_shape=(int(predicted[0]), int(predicted[1])),
        kinds=len(scenario.kinds) if len(scenario.kinds) > 1 else 0,
        while_busy=scenario.observation.while_busy,
    )
