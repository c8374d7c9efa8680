"""What viewpoints are proposed with: models and recipe of a kind of robot, and memory for one thread.

In all kernels of this package `proposer` is a Proposer of the robot's kind and `situation` a Situation;
places and viewpoints (x, y, z, yaw, pitch) are in grid units and radians, lengths in voxel edges. Letters: V
voxels, K candidates, M teammates, N viewpoints of the pool, F viewpoints at far places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import Costs, Lattice, new_lattice
from entropy_explore_env.belief.paths.search import Search, new_search
from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.planner.far_places import Blocks, new_blocks
from entropy_explore_env.planner.recipe import Recipe, angular_spread, recipe_for
from entropy_explore_env.planner.records import KNOWLEDGE, MATE, OPTION, VIEW
from entropy_explore_env.planner.thresholds import REFINED_AROUND
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import (
    DriveModel,
    cell_edge,
    places_within,
    robot_model,
    sees_all_around,
)
from entropy_explore_env.viewpoints.expected_scan import ScanModel, ScanScratch, new_scan_scratch

_WAYPOINTS = 64
"""Corners of the straightened path to a far place that are found at most."""
_BATCH = 256
"""Voxels whose marks are counted at a time."""
_SPARE = 4
"""Viewpoints beside those of the recipe: where to go when nothing is left, and where the robot is going."""


class Situation(NamedTuple):
    """What one robot's candidates depend on."""

    knowledge: np.record  # KNOWLEDGE
    belief: Belief
    costs: Costs  # Traversal costs by the belief
    cones: np.ndarray  # (M,) CONE, views left to teammates, marked in `ScanScratch.left` during a decision
    mates: np.ndarray  # (M,) MATE, teammates that were heard
    experience: np.record  # EXPERIENCE, changed in place


class ProposalScratch(NamedTuple):
    """Memory of one thread, shared by the kinds of robots."""

    scan: ScanScratch
    search: Search
    source: np.ndarray  # (1,) int32, the robot's voxel
    path: np.ndarray  # (V,) int32
    waypoints: np.ndarray  # (_WAYPOINTS, 3) float64
    at: np.ndarray  # (5,) float64, a viewpoint that is tried
    pool: np.ndarray  # (N,) OPTION out of which candidates are selected
    order: np.ndarray  # (N,) int64, numbers in the pool
    far: np.ndarray  # (F,) OPTION, viewpoints at far places
    worth: np.ndarray  # (F,) float64, what the blocks of the far places promise, the most first
    marks: np.ndarray  # (V,) uint64, zeros, which it is again afterwards: bit k = candidate k sees the voxel
    seen: np.ndarray  # (V,) int32, voxels that some candidate sees
    batch: np.ndarray  # (_BATCH,) uint64, marks of some voxels
    unique: np.ndarray  # (K,) float64, sums over voxels seen of 1/n, each seen by n candidates
    views: np.ndarray  # (K,) VIEW
    taken: np.ndarray  # (K,) int64, numbers in the pool of the candidates
    common: np.ndarray  # (K, K) int64, voxels that both of two candidates see
    knowledge: np.ndarray  # (1,) KNOWLEDGE
    cone_bits: np.ndarray  # (M,) float64
    cones: np.ndarray  # (M,) CONE, what teammates have announced to see
    mates: np.ndarray  # (M,) MATE


class Proposer(NamedTuple):
    """What candidates of one kind of robot are proposed with."""

    recipe: Recipe
    drawn: ScanModel  # How scans at drawn viewpoints are imagined
    refined: ScanModel  # How scans at all other viewpoints are imagined
    drive: DriveModel
    lattice: Lattice  # Steps between cells, in which paths are searched
    planar: bool
    level: bool  # Whether it never looks up or down
    planned: bool  # Whether it drives along planned paths, not straight
    all_around: bool
    axes: int  # 2 for planar robots, else 3
    within: float  # Largest distance at which places are drawn
    reach: float  # Longest drive
    view_rad: tuple[float, float]  # Width and height of the sensor's view
    view_width_rad: float  # The larger one of them, and no less than the angle between two rays
    refined_rad: float  # Standard deviation by which refined gazes differ at first
    least_s: float  # Shortest time, in seconds, by which bits are divided
    target_precision: float  # 1/σ² of a voxel at which nothing remains to be gained
    unknown_cost: float  # Traversal cost of unknown voxels
    blocks: Blocks
    scratch: ProposalScratch


def _longest_ray(scenario: Scenario) -> int:
    """Return the most voxels that a ray of the team, or a line through the workspace, crosses."""
    edge_m, shape = scenario.grid.voxel_size_m, scenario.grid.shape
    return sum(shape) + max(
        longest_crossing(*shape, kind.sensor.max_range_m / edge_m, kind.sensor.voxels_behind + 1)
        for kind in scenario.kinds
    )


def _arrays(scenario: Scenario, recipes: Sequence[Recipe]) -> dict[str, tuple[tuple[int, ...], Any]]:
    """Return the name, shape and type of each array of a ProposalScratch."""
    voxels, candidates, mates = scenario.grid.voxels, scenario.action.candidates, scenario.robots - 1
    near = max(r.gazes + r.turns + r.places + r.refinements * max(r.refined, REFINED_AROUND) for r in recipes)
    pool, far = near + candidates + _SPARE, max(r.far_places * r.far_gazes for r in recipes) + 1
    return {
        "source": ((1,), np.int32),
        "path": ((voxels,), np.int32),
        "waypoints": ((_WAYPOINTS, 3), np.float64),
        "at": ((5,), np.float64),
        "pool": ((pool,), OPTION),
        "order": ((pool,), np.int64),
        "far": ((far,), OPTION),
        "worth": ((far,), np.float64),
        "marks": ((voxels,), np.uint64),
        "seen": ((voxels,), np.int32),
        "batch": ((_BATCH,), np.uint64),
        "unique": ((candidates,), np.float64),
        "views": ((candidates,), VIEW),
        "taken": ((candidates,), np.int64),
        "common": ((candidates, candidates), np.int64),
        "knowledge": ((1,), KNOWLEDGE),
        "cone_bits": ((mates,), np.float64),
        "cones": ((mates,), CONE),
        "mates": ((mates,), MATE),
    }


def _block_edge(scenario: Scenario, recipe: Recipe) -> int:
    return max(1, round(recipe.block_m / scenario.grid.voxel_size_m))


def new_proposers(
    scenario: Scenario, recipe: Recipe | None = None, predicted: bool = False
) -> list[Proposer]:
    """Return a proposer for each kind of robot of a team; they share memory, for one thread.

    Args:
        scenario: With candidates as actions.
        recipe: Of all kinds; None = that of each.
        predicted: Whether `ScanScratch.solid` says what is predicted of unknown voxels.
    """
    recipes, voxels = [recipe or recipe_for(scenario, kind) for kind in scenario.kinds], scenario.grid.voxels
    rows = max(kind.sensor.rows for kind in scenario.kinds)
    scratch = ProposalScratch(
        scan=new_scan_scratch(voxels, _longest_ray(scenario), rows, predicted),
        search=new_search(voxels),
        **{name: np.zeros(shape, kind) for name, (shape, kind) in _arrays(scenario, recipes).items()},
    )
    pairs = zip(scenario.kinds, recipes, strict=True)
    return [_proposer(scenario, kind, of_kind, scratch) for kind, of_kind in pairs]


def _least_seconds(kind: RobotKind) -> float:
    """Return the shortest time by which bits are divided: to brake, and to come to full speed again.

    A robot that scans under way loses this time wherever it stands; others take all scans standing.
    """
    under_way, robot = math.isfinite(kind.sensor.scan_every_m), kind.robot
    return 2.0 * robot.max_speed_m_s / robot.acceleration_m_s2 if under_way else 0.0


def _proposer(scenario: Scenario, kind: RobotKind, recipe: Recipe, scratch: ProposalScratch) -> Proposer:
    grid, robot, sensor = scenario.grid, kind.robot, kind.sensor
    drawn, refined = (
        robot_model(scenario, kind, thinning, recipe.stop_probability, recipe.gap_probability)
        for thinning in (recipe.draw_thinning, recipe.thinning)
    )
    planar, reach = scenario.layer_of(robot) is not None, robot.reach_m / grid.voxel_size_m
    width, height = sensor.field_of_view_rad
    edge, layer = cell_edge(scenario, kind), scenario.layer_of(robot)
    lattice = (
        refined.lattice if edge == 1 else new_lattice(grid.shape, refined.drive.body_radius, layer, edge)
    )
    return Proposer(
        recipe=recipe,
        drawn=drawn.scan,
        refined=refined.scan,
        drive=refined.drive,
        lattice=lattice,
        planar=planar,
        level=bool(scenario.looks_level(robot)),
        planned=robot.navigator == "planned",
        all_around=bool(sees_all_around(sensor)),
        axes=2 if planar else 3,
        within=places_within(grid, robot.reach_m),
        reach=float(min(reach, sum(grid.shape))),
        view_rad=(float(width), float(height)),
        view_width_rad=float(max(width, height, sensor.angular_step_rad)),
        refined_rad=float(angular_spread(kind)),
        least_s=float(_least_seconds(kind)),
        target_precision=min(float(scenario.ending.sigma_end**-2), refined.scan.wanted_precision),
        unknown_cost=float(robot.unknown_cost),
        blocks=new_blocks(grid.shape, _block_edge(scenario, recipe)),
        scratch=scratch,
    )
