"""Scenes that several tests share: small worlds, random beliefs, missions of random actions.

No two edges of a world are equal, so that swapped axes show.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from entropy_explore_env.belief.raycast import Crossing, longest_crossing
from entropy_explore_env.missions.rules import action_count
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import BOX
from tests.reference import rocha04

SMALL = ("room", "room-furnished", "box-7x11x5")
"""Scenarios that tests walk through for whole episodes, with teams and actions of all kinds: small enough for
seconds a test. The others are walked through for a few steps, in tests/settings/test_scenarios.py."""
SHAPES = ((7, 11, 5), (3, 8, 6), (9, 6, 1), (13, 2, 4), (1, 10, 3))


def drawn(examples: int = 60) -> settings:
    """So many examples for Hypothesis, and ten times as many in its profile `long` (tests/conftest.py)."""
    return settings(max_examples=max(examples * settings.default.max_examples // 100, 1))


seeds = st.integers(0, 2**32 - 1)


@st.composite
def rays(draw: st.DrawFn) -> tuple[rocha04.Voxel, np.ndarray, np.ndarray]:
    """A grid's size, a start inside it and a direction; level in 2-D."""
    size = draw(st.sampled_from(SHAPES))
    inside = st.floats(0.01, 0.99)
    start = np.array([draw(st.integers(0, n - 1)) + draw(inside) for n in size])
    yaw = draw(st.floats(-math.pi, math.pi))
    pitch = 0.0 if size[2] == 1 else draw(st.floats(-math.pi / 2, math.pi / 2))
    return size, start, np.array(rocha04.gaze(yaw, pitch))


def flat_index(voxels: Any, size: rocha04.Voxel) -> list[int]:
    """Numbers of voxels in C order, z fastest."""
    return [(x * size[1] + y) * size[2] + z for x, y, z in voxels]


def flood(room: np.ndarray, start: tuple[int, ...]) -> set[tuple[int, ...]]:
    """What hangs together with a voxel by faces: a search breadth first."""
    reached, queue = {start}, deque([start])
    while queue:
        here = queue.popleft()
        for axis in range(room.ndim):
            for step in (-1, 1):
                near = (*here[:axis], here[axis] + step, *here[axis + 1 :])
                if 0 <= near[axis] < room.shape[axis] and room[near] and near not in reached:
                    reached.add(near)
                    queue.append(near)
    return reached


def random_cover(size: rocha04.Voxel, share: float, seed: int) -> np.ndarray:
    """(X, Y, Z) float32, 1 in about this share of the voxels and 0 elsewhere."""
    return (np.random.default_rng(seed).random(size) < share).astype(np.float32)


def random_belief(size: rocha04.Voxel, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and precision, (X, Y, Z) float32: some voxels unknown, some known very well."""
    rng = np.random.default_rng(seed)
    mean = rng.random(size).astype(np.float32)
    sigma = 10.0 ** rng.uniform(-2.0, 1.5, size)
    return mean, (sigma**-2.0).astype(np.float32)


def as_reference(mean: np.ndarray, precision: np.ndarray) -> dict[rocha04.Voxel, rocha04.Belief]:
    """The same belief as voxel → (μ, σ)."""
    sigma = precision.astype(np.float64) ** -0.5
    return {(x, y, z): (float(mean[x, y, z]), float(sigma[x, y, z])) for x, y, z in np.ndindex(*mean.shape)}


def as_arrays(
    beliefs: dict[rocha04.Voxel, rocha04.Belief], size: rocha04.Voxel
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and precision, (X, Y, Z) float64, of a reference belief."""
    mean, precision = np.zeros(size), np.zeros(size)
    for voxel, (mu, sigma) in beliefs.items():
        mean[voxel], precision[voxel] = mu, sigma**-2.0
    return mean, precision


def ray_space(size: rocha04.Voxel, length: float = math.inf, behind: int = 0) -> Crossing:
    """Scratch space of a ray, filled with what must not be taken for a result."""
    places = longest_crossing(*size, length, behind)
    return Crossing(np.full(places, -1, np.int32), np.full(places, -1, np.int64))


def free_box(**changes: Any) -> Scenario:
    """The tiny box, where a step lasts until the next robot has to decide; with some settings changed."""
    return with_settings(BOX, {"decision_period_s": None, **changes})


ENDLESS = {"sigma_end": 1e-4}
"""Endings of missions that no map is known well enough for."""
NO_PARTS = {"panorama": False, "self_state": False, "team": False}
"""Observations without any part."""
TIGHT = free_box(
    robots=5,
    robot={"body_radius_m": 0.35, "reach_m": 3.0},
    decision_period_s=0.6,
    observation=NO_PARTS,
)
"""Five large bodies in a small box."""


def started(scenario: Scenario, seed: int = 0, missions: int = 1) -> Missions:
    """Missions after their reset, mission m with seed + m."""
    these = Missions(scenario, missions)
    for mission in range(missions):
        these.reset(mission, seed + mission)
    return these


def robots_of(missions: Missions, field: str) -> np.ndarray:
    """A field of the first mission's robots, (A, …)."""
    return missions.state.robots[0][field]


def standing(*poses: Any, **changes: Any) -> Missions:
    """Return a mission of the tiny box whose robots stand at poses (x, y, z, yaw, pitch)."""
    missions = started(free_box(robots=len(poses), **changes))
    for robot, pose in enumerate(poses):
        put(missions, robot, pose)
    return missions


def random_actions(missions: Missions, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Continuous and discrete actions of all robots, drawn uniformly."""
    robots, rules = missions.scenario.robots, missions.rules
    axes = 3 if missions.scenario.planar else 5
    boxes = rng.uniform(-1.0, 1.0, (missions.count, robots, axes)).astype(np.float32).astype(np.float64)
    numbers = rng.integers(0, action_count(missions.scenario, rules), (missions.count, robots))
    return boxes, numbers


def wander(missions: Missions, steps: int, seed: int, after: Callable[[int], None] | None = None) -> None:
    """Step with random actions, and call `after(step)` after each."""
    rng = np.random.default_rng(seed)
    for step in range(steps):
        missions.step(*random_actions(missions, rng))
        if after is not None:
            after(step)


def toward(missions: Missions, *viewpoints: Any) -> np.ndarray:
    """Send the robots to viewpoints (x, y, z, yaw, pitch) for one step; their states after it."""
    views = [view_of(missions, 0, robot) for robot in range(missions.scenario.robots)]
    boxes = [
        view.action_for(np.asarray(wanted, float)) for view, wanted in zip(views, viewpoints, strict=True)
    ]
    missions.step(np.array([boxes], np.float64), np.zeros((1, len(boxes)), np.int64))
    return missions.state.robots[0]


def put(missions: Missions, robot: int, pose: Any, mission: int = 0) -> None:
    """Stand a robot that decides somewhere."""
    for field in ("origin", "goal", "target", "scan_pose"):
        missions.state.robots[mission, robot][field] = pose
    if missions.estimates is not None:
        own = missions.estimates[mission, robot]
        own["place"], own["yaw"], own["scan_pose"] = pose[:3], pose[3], pose


def build(missions: Missions, solid: np.ndarray, mission: int = 0) -> None:
    """Make these voxels, (X, Y, Z) bool, the truth; bodies are smaller than half a voxel."""
    missions.state.truth[mission] = solid.ravel()


def build_known(missions: Missions, solid: np.ndarray, voxels: list[tuple[int, int, int]]) -> None:
    """Make these voxels, (X, Y, Z) bool, the truth; robots stand in some voxels and know all of the world."""
    build(missions, solid)
    for robot, voxel in enumerate(voxels):
        pose = np.zeros(5)
        pose[:3] = missions.grid.centre_of(np.array(voxel))
        put(missions, robot, pose)
        missions.mean[0, robot][solid], missions.mean[0, robot][~solid] = 1.0, 0.0
        missions.precision[0, robot] = 1e4
