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
    team      (A-1, 19)    per teammate, in the order of their numbers: 1 if ever heard; where it
                           was, relative, in workspace sizes (3); cos and sin of its yaw and of its
                           pitch (4); seconds since then as s/(s + 60); 1 if an announcement was
                           heard; its viewpoint in the same way (7); r̂ in workspace diagonals; α̂/π;
                           zeros if unheard
    patch     (4, x, y, z) belief around the robot: expected coverage, normalised entropy, 1
                           outside the workspace, 1 where a teammate was last heard
    overview  (2, x, y, z) the whole belief, averaged over blocks: normalised entropy, expected
                           coverage
    action_mask (N,)       1 for each discrete action that makes sense

Normalised entropy is 1 at the prior and 0 at the voxel entropy that ends a mission (clipped).
A busy robot observes from where it is under way, or zeros if the scenario says so. Only a robot's own
belief and what it heard over the channel enter.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from gymnasium import spaces

from entropy_explore_env.belief.map_update import expected_utility
from entropy_explore_env.belief.measurement_model import measurement_precision
from entropy_explore_env.belief.pooling import normalised_entropy
from entropy_explore_env.belief.raycast import OPEN, STOP_AT_COVERED, cast_ray, longest_crossing
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.action import write_mask
from entropy_explore_env.missions.poses import grid_position, pose_at
from entropy_explore_env.missions.rules import Rules, overview_shape, rules_of
from entropy_explore_env.scenario import Scenario

OWN_NUMBERS = 10
TEAMMATE_NUMBERS = 19
PATCH_CHANNELS = 4
OVERVIEW_CHANNELS = 2
_HALF_LIFE_S = 60.0
"""Age of news that counts as ½."""


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
        self.parts = _parts(scenario)
        self.size = max((part.stop for part in self.parts.values()), default=0)
        self.flat = scenario.observation.flat
        self.low = np.concatenate([np.full(p.stop - p.start, p.low) for p in self.parts.values()] or [[]])
        self.high = np.concatenate(
            [np.broadcast_to(p.high, p.shape).ravel() for p in self.parts.values()] or [[]]
        )

    def space(self) -> spaces.Space:
        """A new space object of one robot's observation: a Dict of parts, or one Box."""
        if self.flat:
            return self.flat_space()
        return spaces.Dict({name: _part_space(name, part) for name, part in self.parts.items()})

    def flat_space(self, robots: int | None = None) -> spaces.Box:
        """One robot's observation as a Box, or that of a whole team one after the other."""
        low, high = self.low.astype(np.float32), self.high.astype(np.float32)
        if robots is not None:
            low, high = np.tile(low, robots), np.tile(high, robots)
        return spaces.Box(low, high, dtype=np.float32)

    def split(self, vectors: np.ndarray) -> np.ndarray | dict[str, np.ndarray]:
        """An observation from flat vectors (..., size) float32; parts are views of them."""
        if self.flat:
            return vectors
        parts: dict[str, np.ndarray] = {}
        for name, part in self.parts.items():
            values = vectors[..., part.start : part.stop].reshape(vectors.shape[:-1] + part.shape)
            parts[name] = values.astype(np.int8) if name == "action_mask" else values
        return parts

    def split_rows(self, rows: np.ndarray) -> list[np.ndarray] | list[dict[str, np.ndarray]]:
        """The observations of robots one by one, from their flat vectors (A, size) float32."""
        together = self.split(rows)
        if isinstance(together, np.ndarray):
            return list(together)
        return [{name: values[row] for name, values in together.items()} for row in range(len(rows))]


def _part_space(name: str, part: Part) -> spaces.Box:
    if name == "action_mask":
        return spaces.Box(0, 1, part.shape, np.int8)
    high = np.broadcast_to(part.high, part.shape).astype(np.float32)
    return spaces.Box(np.full(part.shape, part.low, np.float32), high, dtype=np.float32)


def _parts(scenario: Scenario) -> dict[str, Part]:
    """Shapes and bounds of the parts, one after the other."""
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
            [[math.log2(1 + most) if rules.numbers[0]["panorama_log"] else most], [farthest]]
        ) * (1 + 1e-6)
        limits["panorama"] = ((2, len(rules.panorama)), 0.0, high)
    if settings.self_state:
        kinds = len(scenario.kinds)
        limits["self"] = ((OWN_NUMBERS + (kinds if kinds > 1 else 0),), -1.0, one)
    if settings.team and scenario.robots > 1:
        limits["team"] = ((scenario.robots - 1, TEAMMATE_NUMBERS), -1.0, one)
    if settings.patch:
        limits["patch"] = ((PATCH_CHANNELS, *settings.patch_shape), 0.0, one)
    if (cells := overview_shape(scenario)) is not None:
        limits["overview"] = ((OVERVIEW_CHANNELS, *cells), 0.0, one)
    if settings.action_mask and scenario.action.kind == "discrete":
        limits["action_mask"] = ((len(rules.moves) * len(rules.gazes),), 0.0, one)
    parts, start = {}, 0
    for name, (shape, low, high) in limits.items():
        stop = start + math.prod(shape)
        parts[name] = Part(start, stop, shape, low, high)
        start = stop
    return parts


def _most_utility_bits(scenario: Scenario, rules: Rules) -> float:
    """More than any ray can bring: the longest one, over voxels that nobody has measured."""
    most, prior = 0.0, float(rules.numbers[0]["prior_precision"])
    for kind in scenario.kinds:
        length = kind.sensor.max_range_m / scenario.grid.voxel_size_m
        voxels = longest_crossing(*scenario.grid.shape, length, kind.sensor.voxels_behind)
        most = max(most, voxels * 0.5 * math.log2(1.0 + 1.0 / kind.sensor.sigma_min**2 / prior))
    return most


class ObservationRules(NamedTuple):
    """The layout for compiled code: where each part begins, -1 if it is left out."""

    panorama: int
    own: int
    team: int
    patch: int
    overview: int
    action_mask: int
    patch_shape: tuple[int, int, int]
    kinds: int
    """K, of robots; 0 if all are alike."""
    while_busy: bool
    """Whether robots that do not decide observe, too."""


def observation_rules(scenario: Scenario, layout: ObservationLayout) -> ObservationRules:
    """What compiled code needs of a layout."""
    begin = {name: part.start for name, part in layout.parts.items()}
    patch = scenario.observation.patch_shape
    return ObservationRules(
        *(begin.get(name, -1) for name in ("panorama", "self", "team", "patch", "overview", "action_mask")),
        patch_shape=(int(patch[0]), int(patch[1]), int(patch[2])),
        kinds=len(scenario.kinds) if len(scenario.kinds) > 1 else 0,
        while_busy=scenario.observation.while_busy,
    )


@lean_kernel
def observe_panorama(rules, robot, start, mean, precision, scan, out):
    """Fill (2·D,): what rays around the robot would bring, cast like a scan through its own belief.

    Args:
        rules: The scenario.
        robot: Whose sensor.
        start: (x, y, z), the robot in grid units.
        mean: (V,) float32, its expected coverage.
        precision: (V,) float32, 1/σ² of it.
        scan: Scratch space.
        out: (2·D,) float32, filled in.
    """
    directions = len(rules.panorama)
    numbers, sensor = rules.numbers[robot], rules.sensors.numbers[robot]
    size = (numbers.size[0], numbers.size[1], numbers.size[2])
    reach = sensor.max_range_m / numbers.voxel_size_m
    for ray in range(directions):
        length, n, end = cast_ray(
            mean,
            STOP_AT_COVERED,
            size,
            start,
            rules.panorama[ray],
            reach,
            False,
            sensor.voxels_behind,
            scan.crossed[0],
            scan.entered,
        )
        range_m = sensor.max_range_m if end == OPEN else length * numbers.voxel_size_m
        measured = measurement_precision(range_m, sensor.sigma_min, sensor.sigma_slope_per_m)
        bits = expected_utility(precision, scan.crossed[0], n, measured)
        if end != OPEN and range_m < sensor.min_range_m:
            bits = 0.0
        out[ray] = math.log2(1.0 + bits) if numbers.panorama_log else bits
        out[directions + ray] = range_m


@lean_kernel
def observe_self(numbers, kinds, pose, time_s, entropy_bits, deciding, out):
    """Fill (10 + K,): the robot's pose, the time, the entropy left, whether it decides, and its kind."""
    for axis in range(3):
        extent = numbers.size[axis] * numbers.voxel_size_m
        out[axis] = min(max(2.0 * (pose[axis] - numbers.origin_m[axis]) / extent - 1.0, -1.0), 1.0)
    out[3], out[4] = math.cos(pose[3]), math.sin(pose[3])
    out[5], out[6] = math.cos(pose[4]), math.sin(pose[4])
    out[7] = min(time_s / numbers.time_limit_s, 1.0)
    voxels = numbers.size[0] * numbers.size[1] * numbers.size[2]
    known = 0.5 * voxels * math.log2(2.0 * math.pi * math.e / numbers.end_precision)
    span = 0.5 * voxels * math.log2(numbers.end_precision / numbers.prior_precision)
    out[8] = min(max((entropy_bits - known) / span, 0.0), 1.0)
    out[9] = 1.0 if deciding else 0.0
    for kind in range(kinds):
        out[OWN_NUMBERS + kind] = 1.0 if kind == numbers.kind else 0.0


@lean_kernel
def observe_team(numbers, robot, pose, time_s, heard, out):
    """Fill ((A-1)·19,): where teammates were last heard, and what they announced.

    Args:
        numbers: NUMBERS of the scenario.
        robot: Whose observation.
        pose: (5,) its pose.
        time_s: Now.
        heard: (A,) HEARD, what it heard of each teammate.
        out: Filled in.
    """
    for number in range((len(heard) - 1) * TEAMMATE_NUMBERS):
        out[number] = 0.0
    diagonal = 0.0
    for axis in range(3):
        diagonal += (numbers.size[axis] * numbers.voxel_size_m) ** 2
    diagonal = math.sqrt(diagonal)
    place = 0
    for mate in range(len(heard)):
        if mate == robot:
            continue
        news = heard[mate]
        row = out[place : place + TEAMMATE_NUMBERS]
        place += TEAMMATE_NUMBERS
        if news.heard_s >= 0.0:
            age = time_s - news.heard_s
            row[0], row[8] = 1.0, age / (age + _HALF_LIFE_S)
            write_relative(numbers, pose, news.pose, row[1:])
        if news.announced_s >= 0.0:
            row[9] = 1.0
            write_relative(numbers, pose, news.announced, row[10:])
            row[17], row[18] = min(news.announced[5] / diagonal, 1.0), news.announced[6] / math.pi


@lean_kernel
def write_relative(numbers, pose, other, out):
    """Fill (7,): another pose's place, relative, in workspace sizes; cos and sin of its yaw and pitch."""
    for axis in range(3):
        extent = numbers.size[axis] * numbers.voxel_size_m
        out[axis] = min(max((other[axis] - pose[axis]) / extent, -1.0), 1.0)
    out[3], out[4] = math.cos(other[3]), math.sin(other[3])
    out[5], out[6] = math.cos(other[4]), math.sin(other[4])


@lean_kernel
def observe_patch(numbers, shape, robot, start, mean, precision, heard, out):
    """Fill (4·x·y·z,): the belief around the robot's voxel; outside the workspace it is covered."""
    size_x, size_y, size_z = numbers.size[0], numbers.size[1], numbers.size[2]
    prior, end = numbers.prior_precision, numbers.end_precision
    cells = shape[0] * shape[1] * shape[2]
    corner_x = math.floor(start[0]) - shape[0] // 2
    corner_y = math.floor(start[1]) - shape[1] // 2
    corner_z = math.floor(start[2]) - shape[2] // 2
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                cell = (i * shape[1] + j) * shape[2] + k
                x, y, z = corner_x + i, corner_y + j, corner_z + k
                inside = 0 <= x < size_x and 0 <= y < size_y and 0 <= z < size_z
                voxel = (x * size_y + y) * size_z + z if inside else 0
                out[cell] = mean[voxel] if inside else 1.0
                out[cells + cell] = normalised_entropy(prior, end, precision[voxel]) if inside else 0.0
                out[2 * cells + cell] = 0.0 if inside else 1.0
                out[3 * cells + cell] = 0.0
    for mate in range(len(heard)):
        if mate != robot and heard[mate].heard_s >= 0.0:
            there, low = heard[mate].pose, numbers.origin_m
            x = math.floor((there[0] - low[0]) / numbers.voxel_size_m) - corner_x
            y = math.floor((there[1] - low[1]) / numbers.voxel_size_m) - corner_y
            z = math.floor((there[2] - low[2]) / numbers.voxel_size_m) - corner_z
            if 0 <= x < shape[0] and 0 <= y < shape[1] and 0 <= z < shape[2]:
                out[3 * cells + (x * shape[1] + y) * shape[2] + z] = 1.0


@lean_kernel
def observe_overview(cells, sums, out):
    """Fill (2·C,): normalised entropy and expected coverage, averaged over each cell; nothing for None."""
    if cells is None:  # known while compiling
        return
    count = len(cells.voxels)
    for cell in range(count):
        out[cell] = min(max(sums[0, cell] / cells.voxels[cell], 0.0), 1.0)
        out[count + cell] = min(max(sums[1, cell] / cells.voxels[cell], 0.0), 1.0)


@lean_kernel
def observe_robot(
    rules, parts, robot, pose, time_s, entropy_bits, deciding, heard, mean, precision, pooled, scan, out
):
    """Fill the flat observation of one robot.

    Args:
        rules: The scenario.
        parts: Its ObservationRules.
        robot: The robot's number.
        pose: (x, y, z, yaw, pitch), where it is now.
        time_s: Now.
        entropy_bits: Entropy of its map.
        deciding: Whether it decides.
        heard: (A,) HEARD, what it heard of each teammate.
        mean: (V,) float32, its expected coverage.
        precision: (V,) float32, 1/σ² of it.
        pooled: (2, C) float64, sums over the cells of the overview.
        scan: Scratch space.
        out: (F,) float32, filled in.
    """
    numbers = rules.numbers[robot]
    start = grid_position(numbers, pose)
    if parts.panorama >= 0:
        observe_panorama(rules, robot, start, mean, precision, scan, out[parts.panorama :])
    if parts.own >= 0:
        observe_self(numbers, parts.kinds, pose, time_s, entropy_bits, deciding, out[parts.own :])
    if parts.team >= 0:
        observe_team(numbers, robot, pose, time_s, heard, out[parts.team :])
    if parts.patch >= 0:
        observe_patch(numbers, parts.patch_shape, robot, start, mean, precision, heard, out[parts.patch :])
    if parts.overview >= 0:
        observe_overview(rules.cells, pooled, out[parts.overview :])
    if parts.action_mask >= 0:
        write_mask(rules, robot, start, mean, out[parts.action_mask :])


@lean_kernel
def observe_mission(rules, parts, state, scan, mission, out):
    """Fill the flat observations of a mission's robots, each from where it is now.

    Args:
        rules: The scenario.
        parts: Its ObservationRules.
        state: The MissionState.
        scan: Scratch space.
        mission: Which mission.
        out: (A, F) float32, filled in.
    """
    time_s, over = state.missions[mission].time_s, state.missions[mission].end != 0
    for robot in range(state.robots.shape[1]):
        own = state.robots[mission, robot]
        if not (parts.while_busy or own.deciding or over):
            for number in range(out.shape[1]):
                out[robot, number] = 0.0
            continue
        observe_robot(
            rules,
            parts,
            robot,
            pose_at(rules.numbers[robot], own, time_s),
            time_s,
            own.entropy_bits,
            own.deciding,
            state.heard[mission, robot],
            state.mean[mission, robot],
            state.precision[mission, robot],
            state.pooled[mission, robot],
            scan,
            out[robot],
        )
