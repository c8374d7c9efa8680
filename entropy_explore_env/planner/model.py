"""What candidates of a kind of robot are proposed with: its models, its recipe, and memory for one thread."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import Lattice
from entropy_explore_env.belief.paths.search import Search, new_search, search_bytes
from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.compilation.kernels import record_type
from entropy_explore_env.planner.far_places import Blocks, new_blocks
from entropy_explore_env.planner.recipe import Recipe, angular_spread, recipe_for
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.viewpoints.drawing import surroundings
from entropy_explore_env.viewpoints.evaluation import DriveModel, robot_model, sees_all_around
from entropy_explore_env.viewpoints.expected_scan import ScanModel, ScanScratch, new_scan_scratch

WAYPOINTS = 64
"""Corners of the straightened path to a far place that are found at most."""
_SPARE = 4
"""Viewpoints beside those of the recipe: where to go when nothing is left, and where the robot is going."""

VIEW = record_type(
    [
        ("bits", "f8"),  # of a scan, but for what is left to teammates
        ("all_bits", "f8"),  # with that
        ("again_bits", "f8"),  # of a second scan, likewise
        ("seen", "i8"),  # voxels that count as seen
        ("unknown", "i8"),  # of these, unknown ones
        ("distance", "f8"),  # sum over those seen, voxel edges
        ("slivers", "i8"),  # unknown voxels left beside them, one voxel thick
        ("unique", "f8"),  # sum over those seen of 1/n
        ("shared", "f8", (3,)),  # most bits in announced views, the largest first
    ],
)
"""What is expected to be seen from a candidate, or from the far place to which it leads."""

MATE = record_type(
    [
        ("place", "f8", (3,)),  # where it was last heard, grid units
        ("max_speed_m_s", "f8"),
        ("acceleration_m_s2", "f8"),
        ("scan_time_s", "f8"),
        ("body_radius", "f8"),  # voxel edges
        ("silent", "?"),  # whether it counts as silent
    ],
)
"""A teammate that was heard."""


class RecipeNumbers(NamedTuple):
    """A Recipe as compiled code takes it; spreads in radians."""

    exponent: float
    leave_below: float
    behind: float
    gap_probability: float
    gazes: int
    turns: int
    places: int
    yaw_spread: float
    pitch_spread: float
    vary_spread: float
    refinements: int
    refined: int
    thinned: bool
    """Whether those drawn are imagined with fewer rays than those refined."""
    far_places: int
    far_gazes: int
    waypoint_gazes: int
    far_below: float
    keep: float
    dregs: float
    path_scans: int


class Pool(NamedTuple):
    """N viewpoints out of which candidates are taken."""

    viewpoints: np.ndarray
    """(N, 5) float64, grid units."""
    goals: np.ndarray
    """(N, 5) float64, the far viewpoint to which one leads, or itself."""
    bits: np.ndarray
    """(N,) float64, that a scan at the goal should bring."""
    stop_bits: np.ndarray
    """(N,) float64, that one at the viewpoint should bring."""
    seconds: np.ndarray
    """(N,) float64 until the scan at the goal is taken; inf = there is no path."""
    values: np.ndarray
    """(N,) float64, what it is worth to the planner."""
    kinds: np.ndarray
    """(N,) int64, a Kind each."""


class ProposalScratch(NamedTuple):
    """Memory of one thread, shared by the kinds of robots: V voxels, K candidates, L of the longest ray."""

    scan: ScanScratch
    search: Search
    source: np.ndarray
    """(1,) int32."""
    path: np.ndarray
    """(V,) int32."""
    waypoints: np.ndarray
    """(WAYPOINTS, 3) float64."""
    ends: np.ndarray
    """(2, 3) float64."""
    pool: Pool
    found: np.ndarray
    """(N,) int64, those of the pool that were refined last."""
    far: Pool
    """Far viewpoints."""
    further: Pool
    """Those that are looked at after them."""
    worth: np.ndarray
    """(N,) float64 of the far places that are worth most."""
    gazes: np.ndarray
    """(G, 5) float64, gazes at a stop."""
    gaze_bits: np.ndarray
    """(G,) float64."""
    scan_poses: np.ndarray
    """(S, 5) float64, of scans on the path to a viewpoint."""
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
    cone_bits: np.ndarray
    """(M,) float64."""
    cones: np.ndarray
    """(M,) CONE, what teammates have announced to see."""
    mates: np.ndarray
    """(M,) MATE."""
    here: np.ndarray
    """(5,) float64, the robot in grid units."""
    target: np.ndarray
    """(5,) float64, the viewpoint that it chose last, in grid units."""
    target_m: np.ndarray
    """(5,) float64, the same in the map frame."""


class Proposer(NamedTuple):
    """What candidates of one kind of robot are proposed with."""

    recipe: RecipeNumbers
    drawn: ScanModel
    exact: ScanModel
    drive: DriveModel
    lattice: Lattice
    layer: int
    """Of a planar robot; -1 = it flies."""
    planar: bool
    level: bool
    """Whether it never looks up or down."""
    planned: bool
    all_around: bool
    axes: int
    """2 for planar robots, else 3."""
    within: float
    """Largest distance at which places are drawn, voxel edges."""
    reach: float
    """Longest drive, voxel edges."""
    scan_every: float
    """Voxel edges from one scan under way to the next; inf = it takes none."""
    view_width_rad: float
    """Of the sensor's view, the wider one of its two sides."""
    target_precision: float
    """1/σ² of a voxel at which nothing remains to be gained."""
    unknown_cost: float
    blocks: Blocks
    scratch: ProposalScratch


def recipe_numbers(recipe: Recipe, kind: RobotKind) -> RecipeNumbers:
    """A recipe for a kind of robot, as compiled code takes it."""
    width, height = kind.sensor.field_of_view_rad
    return RecipeNumbers(
        exponent=float(recipe.exponent),
        leave_below=float(recipe.leave_below),
        behind=float(recipe.behind),
        gap_probability=float(recipe.gap_probability),
        gazes=int(recipe.gazes),
        turns=int(recipe.turns),
        places=int(recipe.places),
        yaw_spread=float(recipe.yaw_spread * width),
        pitch_spread=float(recipe.pitch_spread * height),
        vary_spread=float(angular_spread(kind)),
        refinements=int(recipe.refinements),
        refined=int(recipe.refined),
        thinned=recipe.thinning != recipe.draw_thinning,
        far_places=int(recipe.far_places),
        far_gazes=int(recipe.far_gazes),
        waypoint_gazes=int(recipe.waypoint_gazes),
        far_below=float(recipe.far_below),
        keep=float(recipe.keep),
        dregs=float(recipe.dregs),
        path_scans=int(recipe.path_scans),
    )


def _new_pool(size: int) -> Pool:
    return Pool(
        np.zeros((size, 5)),
        np.zeros((size, 5)),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size, np.int64),
    )


def _recipes_of(scenario: Scenario, given: Mapping[int, Recipe] | None = None) -> list[Recipe]:
    """The recipe of each kind of robot of a team."""
    return [(given or {}).get(number) or recipe_for(kind) for number, kind in enumerate(scenario.kinds)]


def _sizes(scenario: Scenario, recipes: Sequence[Recipe]) -> tuple[int, int, int, int]:
    """The largest pool, far places and gazes of the team's recipes, and the longest ray."""
    candidates = scenario.action.candidates
    near = max(r.gazes + r.turns + r.places + r.refinements * max(r.refined, 3) for r in recipes)
    far = max(r.far_places * r.far_gazes for r in recipes) + 1
    gazes = max(max(r.waypoint_gazes for r in recipes), 8)
    edge_m, shape = scenario.grid.voxel_size_m, scenario.grid.shape
    longest = max(
        longest_crossing(*shape, kind.sensor.max_range_m / edge_m, kind.sensor.voxels_behind + 1)
        for kind in scenario.kinds
    )
    return near + candidates + _SPARE, far, gazes, longest + sum(shape)


def _new_scratch(scenario: Scenario, recipes: Sequence[Recipe]) -> ProposalScratch:
    voxels, candidates = scenario.grid.voxels, scenario.action.candidates
    pool, far, gazes, longest = _sizes(scenario, recipes)
    mates = max(scenario.robots - 1, 0)
    return ProposalScratch(
        scan=new_scan_scratch(voxels, longest, max(kind.sensor.rows for kind in scenario.kinds)),
        search=new_search(voxels),
        source=np.zeros(1, np.int32),
        path=np.empty(voxels, np.int32),
        waypoints=np.zeros((WAYPOINTS, 3)),
        ends=np.zeros((2, 3)),
        pool=_new_pool(pool),
        found=np.zeros(pool, np.int64),
        far=_new_pool(far),
        further=_new_pool(far),
        worth=np.zeros(far),
        gazes=np.zeros((gazes, 5)),
        gaze_bits=np.zeros(gazes),
        scan_poses=np.zeros((max(recipe.path_scans for recipe in recipes), 5)),
        marks=np.zeros(voxels, np.uint64),
        seen=np.zeros(voxels, np.int32),
        views=np.zeros(candidates, VIEW),
        taken=np.zeros(candidates, np.int64),
        common=np.zeros((candidates, candidates), np.int64),
        cone_bits=np.zeros(mates),
        cones=np.zeros(mates, CONE),
        mates=np.zeros(mates, MATE),
        here=np.zeros(5),
        target=np.zeros(5),
        target_m=np.zeros(5),
    )


def proposal_bytes(scenario: Scenario) -> int:
    """Bytes of the memory that a thread's proposers share, once searches have reached all voxels."""
    voxels, candidates = scenario.grid.voxels, scenario.action.candidates
    recipes = _recipes_of(scenario)
    pool, far, _, longest = _sizes(scenario, recipes)
    blocks = sum(_block_count(scenario, recipe) for recipe in recipes)
    per_voxel = 9 + 4 + 8 + 4  # added, touched and left, path, marks, seen
    kept = 14 * 8 * (pool + 2 * far) + candidates * (8 * candidates + VIEW.itemsize)
    return search_bytes(voxels) + per_voxel * voxels + 12 * longest + kept + 24 * blocks


def _edge(scenario: Scenario, recipe: Recipe) -> int:
    return max(1, round(recipe.block_m / scenario.grid.voxel_size_m))


def _block_count(scenario: Scenario, recipe: Recipe) -> int:
    return math.prod(math.ceil(n / _edge(scenario, recipe)) for n in scenario.grid.shape)


def new_proposers(scenario: Scenario, recipes: Mapping[int, Recipe] | None = None) -> list[Proposer]:
    """A proposer for each kind of robot of a team; they share memory, for one thread.

    Args:
        scenario: With candidates as actions.
        recipes: Number of a kind → its recipe; None, and of others: `recipe_for`.
    """
    used = _recipes_of(scenario, recipes)
    scratch = _new_scratch(scenario, used)
    return [
        _proposer(scenario, kind, recipe, scratch) for kind, recipe in zip(scenario.kinds, used, strict=True)
    ]


def thinned(proposer: Proposer, divisor: int) -> Proposer:
    """A proposer in the same memory that draws and refines so many times fewer viewpoints.

    Args:
        proposer: Which stays as it is.
        divisor: 1 = it does not change.
    """
    recipe = proposer.recipe
    fewer = {
        name: -(-getattr(recipe, name) // divisor)
        for name in ("gazes", "turns", "places", "refined", "far_places", "waypoint_gazes")
    }
    refinements = min(recipe.refinements, max(1, recipe.refinements // divisor))
    return proposer._replace(recipe=recipe._replace(**fewer, refinements=refinements))


def _proposer(scenario: Scenario, kind: RobotKind, recipe: Recipe, scratch: ProposalScratch) -> Proposer:
    grid = scenario.grid
    drawn = robot_model(scenario, kind, recipe.draw_thinning, recipe.stop_probability)
    exact = robot_model(scenario, kind, recipe.thinning, recipe.stop_probability)
    layer = scenario.layer_of(kind.robot)
    planar = layer is not None
    within = surroundings(grid, kind.robot, planar)
    return Proposer(
        recipe=recipe_numbers(recipe, kind),
        drawn=drawn.scan,
        exact=exact.scan,
        drive=exact.drive,
        lattice=exact.lattice,
        layer=-1 if layer is None else int(layer),
        planar=planar,
        level=bool(scenario.looks_level(kind.robot)),
        planned=kind.robot.navigator == "planned",
        all_around=bool(sees_all_around(kind.sensor)),
        axes=int(within.axes),
        within=float(within.reach),
        reach=float(min(kind.robot.reach_m / grid.voxel_size_m, float(sum(grid.shape)))),
        scan_every=float(kind.sensor.scan_every_m / grid.voxel_size_m),
        view_width_rad=float(max(*kind.sensor.field_of_view_rad, kind.sensor.angular_step_rad)),
        target_precision=min(float(scenario.ending.sigma_end**-2), exact.scan.wanted_precision),
        unknown_cost=float(kind.robot.unknown_cost),
        blocks=new_blocks(grid.shape, _edge(scenario, recipe)),
        scratch=scratch,
    )
