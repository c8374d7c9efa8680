"""What candidates of a kind of robot are proposed with: its models, its recipe, and memory for one thread."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import Costs, Lattice
from entropy_explore_env.belief.paths.search import Search, new_search, search_bytes
from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.planner.far_places import Blocks, new_blocks
from entropy_explore_env.planner.recipe import Recipe, angular_spread, checked, recipe_for
from entropy_explore_env.planner.records import KNOWLEDGE, MATE, OPTION, VIEW
from entropy_explore_env.planner.thresholds import REFINED_AROUND
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.viewpoints.evaluation import DriveModel, robot_model, sees_all_around
from entropy_explore_env.viewpoints.expected_scan import ScanModel, ScanScratch, new_scan_scratch

_WAYPOINTS = 64
"""Corners of the straightened path to a far place that are found at most."""
_SPARE = 4
"""Viewpoints beside those of the recipe: where to go when nothing is left, and where the robot is going."""


class Situation(NamedTuple):
    """What one robot's candidates depend on."""

    knowledge: np.record
    """KNOWLEDGE."""
    belief: Belief
    costs: Costs
    """Traversal costs by the belief."""
    cones: np.ndarray
    """(M,) CONE, views that are left to teammates; marked in `ScanScratch.left` during a decision."""
    mates: np.ndarray
    """(M,) MATE, teammates that were heard."""
    experience: np.record
    """EXPERIENCE, changed in place."""


class ProposalScratch(NamedTuple):
    """Memory of one thread, shared by the kinds of robots: V voxels, K candidates, M teammates."""

    scan: ScanScratch
    search: Search
    source: np.ndarray
    """(1,) int32, the robot's voxel."""
    path: np.ndarray
    """(V,) int32."""
    waypoints: np.ndarray
    """(_WAYPOINTS, 3) float64."""
    at: np.ndarray
    """(5,) float64, a viewpoint that is tried."""
    pool: np.ndarray
    """(N,) OPTION out of which candidates are selected."""
    order: np.ndarray
    """(N,) int64, numbers in the pool."""
    far: np.ndarray
    """(F,) OPTION, viewpoints at far places."""
    further: np.ndarray
    """(F,) OPTION, those that are evaluated after them."""
    worth: np.ndarray
    """(F,) float64, what the blocks of the far places promise, the most first."""
    marks: np.ndarray
    """(V,) uint64, zeros, which it is again afterwards: bit k = candidate k sees the voxel."""
    seen: np.ndarray
    """(V,) int32, voxels that some candidate sees."""
    views: np.ndarray
    """(K,) VIEW."""
    taken: np.ndarray
    """(K,) int64, numbers in the pool of the candidates."""
    common: np.ndarray
    """(K, K) int64, voxels that both of two candidates see."""
    knowledge: np.ndarray
    """(1,) KNOWLEDGE."""
    cone_bits: np.ndarray
    """(M,) float64."""
    cones: np.ndarray
    """(M,) CONE, what teammates have announced to see."""
    mates: np.ndarray
    """(M,) MATE."""


class Proposer(NamedTuple):
    """What candidates of one kind of robot are proposed with; lengths in voxel edges."""

    recipe: Recipe
    drawn: ScanModel
    """How scans at drawn viewpoints are imagined."""
    exact: ScanModel
    """How scans are imagined with all rays."""
    drive: DriveModel
    lattice: Lattice
    planar: bool
    level: bool
    """Whether it never looks up or down."""
    planned: bool
    """Whether it drives along planned paths, not straight."""
    all_around: bool
    axes: int
    """2 for planar robots, else 3."""
    within: float
    """Largest distance at which places are drawn."""
    reach: float
    """Longest drive."""
    view_rad: tuple[float, float]
    """Width and height of the sensor's view."""
    view_width_rad: float
    """The larger one of them, and no less than the angle between two rays."""
    refined_rad: float
    """Standard deviation by which refined gazes differ at first."""
    target_precision: float
    """1/σ² of a voxel at which nothing remains to be gained."""
    unknown_cost: float
    """Traversal cost of unknown voxels."""
    blocks: Blocks
    scratch: ProposalScratch


def _recipes_of(scenario: Scenario, given: Mapping[int, Recipe] | None = None) -> list[Recipe]:
    """Return the recipe of each kind of robot of a team."""
    return [
        checked((given or {}).get(number) or recipe_for(kind)) for number, kind in enumerate(scenario.kinds)
    ]


def _sizes(scenario: Scenario, recipes: Sequence[Recipe]) -> tuple[int, int, int]:
    """Return the largest pool, the most far viewpoints, and the most voxels that a ray crosses."""
    near = max(r.gazes + r.turns + r.places + r.refinements * max(r.refined, REFINED_AROUND) for r in recipes)
    far = max(r.far_places * r.far_gazes for r in recipes) + 1
    edge_m, shape = scenario.grid.voxel_size_m, scenario.grid.shape
    longest = max(
        longest_crossing(*shape, kind.sensor.max_range_m / edge_m, kind.sensor.voxels_behind + 1)
        for kind in scenario.kinds
    )
    return near + scenario.action.candidates + _SPARE, far, longest + sum(shape)


def _new_scratch(scenario: Scenario, recipes: Sequence[Recipe]) -> ProposalScratch:
    voxels, candidates = scenario.grid.voxels, scenario.action.candidates
    pool, far, longest = _sizes(scenario, recipes)
    mates = max(scenario.robots - 1, 0)
    return ProposalScratch(
        scan=new_scan_scratch(voxels, longest, max(kind.sensor.rows for kind in scenario.kinds)),
        search=new_search(voxels),
        source=np.zeros(1, np.int32),
        path=np.empty(voxels, np.int32),
        waypoints=np.zeros((_WAYPOINTS, 3)),
        at=np.zeros(5),
        pool=np.zeros(pool, OPTION),
        order=np.zeros(pool, np.int64),
        far=np.zeros(far, OPTION),
        further=np.zeros(far, OPTION),
        worth=np.zeros(far),
        marks=np.zeros(voxels, np.uint64),
        seen=np.zeros(voxels, np.int32),
        views=np.zeros(candidates, VIEW),
        taken=np.zeros(candidates, np.int64),
        common=np.zeros((candidates, candidates), np.int64),
        knowledge=np.zeros(1, KNOWLEDGE),
        cone_bits=np.zeros(mates),
        cones=np.zeros(mates, CONE),
        mates=np.zeros(mates, MATE),
    )


def proposal_bytes(scenario: Scenario) -> int:
    """Return the bytes of memory that a thread's proposers share, once searches have reached all voxels."""
    voxels, candidates, recipes = scenario.grid.voxels, scenario.action.candidates, _recipes_of(scenario)
    pool, far, longest = _sizes(scenario, recipes)
    blocks = sum(
        math.prod(math.ceil(n / _block_edge(scenario, recipe)) for n in scenario.grid.shape)
        for recipe in recipes
    )
    per_voxel = 9 + 4 + 8 + 4  # added, touched and left, path, marks, seen
    kept = OPTION.itemsize * (pool + 2 * far) + candidates * (8 * candidates + VIEW.itemsize)
    return search_bytes(voxels) + per_voxel * voxels + 12 * longest + kept + 24 * blocks


def _block_edge(scenario: Scenario, recipe: Recipe) -> int:
    return max(1, round(recipe.block_m / scenario.grid.voxel_size_m))


def new_proposers(scenario: Scenario, recipes: Mapping[int, Recipe] | None = None) -> list[Proposer]:
    """Return a proposer for each kind of robot of a team; they share memory, for one thread.

    Args:
        scenario: With candidates as actions.
        recipes: Number of a kind → its recipe; None, and of others: `recipe_for`.

    Raises:
        SettingError: A recipe makes no sense.
    """
    used = _recipes_of(scenario, recipes)
    scratch = _new_scratch(scenario, used)
    return [
        _proposer(scenario, kind, recipe, scratch) for kind, recipe in zip(scenario.kinds, used, strict=True)
    ]


def _proposer(scenario: Scenario, kind: RobotKind, recipe: Recipe, scratch: ProposalScratch) -> Proposer:
    grid, robot, sensor = scenario.grid, kind.robot, kind.sensor
    drawn, exact = (
        robot_model(scenario, kind, thinning, recipe.stop_probability, recipe.gap_probability)
        for thinning in (recipe.draw_thinning, 1)
    )
    planar, reach = scenario.layer_of(robot) is not None, robot.reach_m / grid.voxel_size_m
    width, height = sensor.field_of_view_rad
    return Proposer(
        recipe=recipe,
        drawn=drawn.scan,
        exact=exact.scan,
        drive=exact.drive,
        lattice=exact.lattice,
        planar=planar,
        level=bool(scenario.looks_level(robot)),
        planned=robot.navigator == "planned",
        all_around=bool(sees_all_around(sensor)),
        axes=2 if planar else 3,
        within=float(min(reach, 0.25 * max(grid.shape))),
        reach=float(min(reach, sum(grid.shape))),
        view_rad=(float(width), float(height)),
        view_width_rad=float(max(width, height, sensor.angular_step_rad)),
        refined_rad=float(angular_spread(kind)),
        target_precision=min(float(scenario.ending.sigma_end**-2), exact.scan.wanted_precision),
        unknown_cost=float(robot.unknown_cost),
        blocks=new_blocks(grid.shape, _block_edge(scenario, recipe)),
        scratch=scratch,
    )
