"""Candidate viewpoints of a robot: nearby ones, drawn and refined, and far places on planned paths.

Scripted strategies choose among them, and learned policies can: of each candidate there are the expected
bits, the seconds until its scan, and whether it is a gaze from the spot, a place within reach, or far away.
"""

from __future__ import annotations

import enum
import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import belief_costs
from entropy_explore_env.belief.paths.planning import resume_search, start_search
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.viewpoints.drawing import Surroundings, draw_places, surroundings
from entropy_explore_env.viewpoints.evaluation import (
    RobotModel,
    new_scratch,
    robot_model,
    sees_all_around,
    straight_seconds,
)
from entropy_explore_env.viewpoints.far_places import bits_around, fill_blocks, new_blocks
from entropy_explore_env.viewpoints.imagined_scan import imagined_bits
from entropy_explore_env.viewpoints.recipe import Recipe, angular_spread, recipe_for
from entropy_explore_env.viewpoints.travel import Travel, first_stop, travel_seconds

_BEST = 3
"""Number of candidates around which others are drawn."""
_SHRINK = 0.7
"""How much less refined viewpoints differ from one refinement to the next."""
_AROUND_CORNERS = 1.6
"""Longest path to a place within reach, in reaches."""
_FIRST_RADIUS = 3.0
"""Length of the paths that are searched first for far places, in reaches; then twice as much, and so on."""
_AWAY = 2
"""Who gets so many voxels beyond what its body touches is not shut in."""
_PITCH_SPREAD = 0.5
"""Standard deviation of the pitch at far places, radians."""


class Kind(enum.IntEnum):
    """Where a candidate lies."""

    SPOT = 0
    """Where the robot is: another gaze."""
    REACH = 1
    """Within reach."""
    FAR = 2
    """Beyond: several decisions away."""


class Candidates(NamedTuple):
    """K candidate viewpoints of one robot."""

    viewpoints: np.ndarray
    """(K, 5) float64: x, y, z in grid units, yaw, pitch."""
    bits: np.ndarray
    """(K,) float64, what a scan there should bring."""
    seconds: np.ndarray
    """(K,) float64 until that scan is taken; inf = there is no path."""
    kind: np.ndarray
    """(K,) int8, a Kind each."""

    def values(self, exponent: float) -> np.ndarray:
        """(K,) bits / s^c; 0 where there is no path."""
        return np.where(np.isfinite(self.seconds), self.bits / self.seconds**exponent, 0.0)

    def taken(self, which: np.ndarray) -> Candidates:
        """Some of them."""
        return Candidates(*(part[which] for part in self))

    def joined(self, other: Candidates) -> Candidates:
        """These and others."""
        return Candidates(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))


NO_CANDIDATES = Candidates(np.zeros((0, 5)), np.zeros(0), np.zeros(0), np.zeros(0, np.int8))
"""None."""


def as_expected(viewpoints: np.ndarray, bits: np.ndarray) -> np.ndarray:
    """(K,) the bits as they are expected."""
    del viewpoints
    return bits


def fully_trusted(viewpoints: np.ndarray) -> np.ndarray:
    """(K,) ones: every viewpoint (K, 5) is taken to bring what is expected of it."""
    return np.ones(len(viewpoints))


@dataclass(frozen=True)
class Situation:
    """What a robot's candidates depend on.

    Attributes:
        robot: Its number.
        here: (5,) its pose, place in grid units.
        belief: Its belief.
        cones: (M,) CONE, which are left to teammates.
        no_fly: (X, Y, Z) bool, voxels that may not be entered; None = all may.
        weigh: Changes the expected bits (K,) of viewpoints (K, 5) by what the robot has experienced.
        trust: Share in [0, 1] of the expected bits that viewpoints (K, 5) like these brought, (K,); 0 where a
            teammate is in the way.
    """

    robot: int
    here: np.ndarray
    belief: Belief
    cones: np.ndarray
    no_fly: np.ndarray | None = None
    weigh: Callable[[np.ndarray, np.ndarray], np.ndarray] = as_expected
    trust: Callable[[np.ndarray], np.ndarray] = fully_trusted


class _Maker:
    """What candidates of one kind of robot are made with."""

    def __init__(self, scenario: Scenario, kind: RobotKind, recipe: Recipe) -> None:
        self.kind, self.recipe = kind, recipe
        self.drawn = robot_model(scenario, kind, recipe.draw_thinning, recipe.stop_probability)
        self.exact = robot_model(scenario, kind, recipe.thinning, recipe.stop_probability)
        layer = scenario.layer_of(kind.robot)
        self.planar, self.layer = layer is not None, -1 if layer is None else int(layer)
        self.level = scenario.looks_level(kind.robot)
        self.planned = kind.robot.navigator == "planned"
        self.within = surroundings(scenario.grid, kind.robot, self.planar)
        self.reach = min(kind.robot.reach_m / scenario.grid.voxel_size_m, float(sum(scenario.grid.shape)))
        self.all_around = sees_all_around(kind.sensor)


class CandidatePlanner:
    """Makes the candidates of a team's robots, for one robot at a time."""

    def __init__(self, scenario: Scenario, recipes: Mapping[int, Recipe] | None = None) -> None:
        """Memory for a mission.

        Args:
            scenario: Its settings.
            recipes: Number of a kind → its recipe; of others it is `recipe_for`.
        """
        given = recipes or {}
        self._makers = [
            _Maker(scenario, kind, given.get(number) or recipe_for(kind))
            for number, kind in enumerate(scenario.kinds)
        ]
        grid = scenario.grid
        self._grid, self._prior = grid, scenario.sigma_prior**-2
        self._target = float(scenario.ending.sigma_end**-2)
        models = [model for maker in self._makers for model in (maker.drawn, maker.exact)]
        self._scratch = new_scratch(grid, models)
        self._search = new_search(grid.voxels)
        edges = [max(1, round(maker.recipe.block_m / grid.voxel_size_m)) for maker in self._makers]
        self._blocks = {edge: new_blocks(grid.shape, edge) for edge in edges}
        self._edges = edges

    def recipe_of(self, robot: int) -> Recipe:
        """The recipe of a robot."""
        return self._maker(robot).recipe

    def _maker(self, robot: int) -> _Maker:
        return self._makers[robot % len(self._makers)]

    def start_search(self, situation: Situation) -> Travel:
        """Begin a search for paths from where the robot is; `near` and `far` continue it."""
        maker, belief = self._maker(situation.robot), situation.belief
        no_fly = None if situation.no_fly is None else situation.no_fly.reshape(-1)
        unknown_cost = maker.kind.robot.unknown_cost
        costs = belief_costs(belief.mean, belief.precision, self._prior, unknown_cost, no_fly)
        at = np.clip(situation.here[:3].astype(np.int64), 0, np.array(self._grid.shape) - 1)
        start = np.array([np.ravel_multi_index(tuple(at), self._grid.shape)], np.int32)
        travel = Travel(self._search, maker.exact.lattice, costs, situation.here[:3].copy())
        start_search(self._search, travel.lattice, costs, start)
        return travel

    def near(self, situation: Situation, travel: Travel | None, rng: np.random.Generator) -> Candidates:
        """Viewpoints on the spot and within reach, drawn, then refined around the best.

        Args:
            situation: The robot's.
            travel: A search that was just started: places around corners are candidates, too, and seconds
                are those of paths. None = only places that a straight line leads to.
            rng: To draw from.
        """
        maker = self._maker(situation.robot)
        recipe = maker.recipe
        if travel is not None:
            self._search_nearby(maker, travel)
        found = self._evaluated(situation, maker, maker.drawn, _drawn(maker, situation.here, rng), travel)
        spread = angular_spread(maker.kind)
        for number in range(recipe.refinements):
            best = found.taken(np.argsort(found.values(recipe.exponent))[-_BEST:])
            copies = max(recipe.refined // len(best.bits), 1)
            near = best.viewpoints.repeat(copies, axis=0)
            _vary(maker, near, situation.here, spread * _SHRINK**number, rng)
            if number == 0 and recipe.thinning != recipe.draw_thinning:
                best = self._evaluated(situation, maker, maker.exact, best.viewpoints, travel)
            found = best.joined(self._evaluated(situation, maker, maker.exact, near, travel))
        return found

    def seconds_to(self, situation: Situation, travel: Travel, viewpoints: np.ndarray) -> np.ndarray:
        """(K,) seconds to viewpoints (K, 5) nearby on planned paths; inf = there is no path."""
        maker = self._maker(situation.robot)
        self._search_nearby(maker, travel)
        seconds = np.empty(len(viewpoints))
        self._fill_seconds(maker, situation.here, viewpoints, math.inf, seconds)
        return seconds

    def _search_nearby(self, maker: _Maker, travel: Travel) -> None:
        farthest = _AROUND_CORNERS * maker.within.reach + 1.0
        resume_search(travel.search, travel.lattice, travel.costs, farthest)

    def is_shut_in(self, situation: Situation, travel: Travel) -> bool:
        """Whether no path leads the robot away from the voxels that its body touches, by its belief."""
        maker = self._maker(situation.robot)
        extent = int(np.abs(travel.lattice.footprint).max(initial=0))
        ring = _cube(extent + _AWAY, maker.planar)
        ring = ring[np.abs(ring).max(axis=1) == extent + _AWAY]
        around = self._beside(situation, ring)
        return not np.isfinite(self.seconds_to(situation, travel, around)).any()

    def exits(self, situation: Situation) -> np.ndarray:
        """(K, 5) viewpoints on the neighbouring voxels that the latest search reached.

        A body that does not fit where it is, by its belief, leaves by one of them, and searches anew there.
        """
        maker = self._maker(situation.robot)
        viewpoints = self._beside(situation, _cube(1, maker.planar))
        seconds = np.empty(len(viewpoints))
        self._fill_seconds(maker, situation.here, viewpoints, math.inf, seconds)
        return viewpoints[np.isfinite(seconds)]

    def _beside(self, situation: Situation, steps: np.ndarray) -> np.ndarray:
        """(K, 5) viewpoints on the voxels that lie (N, 3) steps from the robot's; K ≤ N are in the grid."""
        here = situation.here
        viewpoints = np.tile(here, (len(steps), 1))
        viewpoints[:, :3] = np.floor(here[:3]) + 0.5 + steps
        if self._maker(situation.robot).planar:
            viewpoints[:, 2] = here[2]
        inside = ((viewpoints[:, :3] > 0.0) & (viewpoints[:, :3] < self._grid.shape)).all(axis=1)
        return viewpoints[inside]

    def _evaluated(
        self,
        situation: Situation,
        maker: _Maker,
        model: RobotModel,
        viewpoints: np.ndarray,
        travel: Travel | None,
    ) -> Candidates:
        """Candidates nearby at (K, 5) viewpoints."""
        here = situation.here
        seconds = np.empty(len(viewpoints))
        if travel is None:
            straight_seconds(
                situation.belief,
                model.scan.voxel_size_m,
                model.drive,
                here,
                viewpoints,
                self._scratch,
                seconds,
            )
        else:
            self._fill_seconds(maker, here, viewpoints, math.inf, seconds)
        bits = self._imagined(situation, maker, model, viewpoints)
        kind = np.where((viewpoints[:, :3] == here[:3]).all(axis=1), Kind.SPOT, Kind.REACH).astype(np.int8)
        return Candidates(viewpoints, situation.weigh(viewpoints, bits), seconds, kind)

    def _fill_seconds(
        self, maker: _Maker, here: np.ndarray, viewpoints: np.ndarray, reach: float, seconds: np.ndarray
    ) -> None:
        size, edge_m = self._grid.shape, maker.exact.scan.voxel_size_m
        travel_seconds(self._search, size, maker.exact.drive, edge_m, here, viewpoints, float(reach), seconds)

    def far(
        self,
        situation: Situation,
        travel: Travel,
        most_bits: float,
        kept: np.ndarray | None,
        rng: np.random.Generator,
    ) -> Candidates:
        """Far places that could be worth more than any nearer one; the nearer half of the world first.

        Paths are searched farther and farther until no place beyond could be worth more.

        Args:
            situation: The robot's.
            travel: A search from where it is, which is continued.
            most_bits: Most bits that a scan anywhere may bring.
            kept: (5,) a viewpoint that is a candidate in any case, the last one; None = there is none.
            rng: To draw gazes from.
        """
        maker = self._maker(situation.robot)
        recipe, everywhere = maker.recipe, float(sum(self._grid.shape)) * maker.kind.robot.unknown_cost
        radius, found = _FIRST_RADIUS * maker.within.reach, NO_CANDIDATES
        while True:
            radius = min(radius, everywhere)
            resume_search(travel.search, travel.lattice, travel.costs, radius)
            viewpoints = self._far_viewpoints(situation, maker, radius, kept, rng)
            found = self._far_evaluated(situation, maker, viewpoints)
            best = float(found.values(recipe.exponent).max(initial=0.0))
            if radius >= everywhere or best >= most_bits / self._seconds_to(maker, radius) ** recipe.exponent:
                return found
            radius *= 2.0

    def _seconds_to(self, maker: _Maker, length: float) -> float:
        """Seconds until a scan at the end of a path of this length; never less than those to any beyond."""
        return length * maker.exact.scan.voxel_size_m / maker.exact.drive.max_speed_m_s

    def _far_viewpoints(
        self,
        situation: Situation,
        maker: _Maker,
        radius: float,
        kept: np.ndarray | None,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """(K, 5) the places that are worth most by the bits of their blocks, a few gazes each."""
        recipe, here, shape = maker.recipe, situation.here, self._grid.shape
        blocks = self._blocks[self._edges[situation.robot % len(self._makers)]]
        at = np.clip(here[:3].astype(np.int64), 0, np.array(shape) - 1)
        start, window = int(np.ravel_multi_index(tuple(at), shape)), math.ceil(radius)
        fill_blocks(self._search, situation.belief, self._target, maker.layer, start, window, blocks)
        place, bits = blocks.place.reshape(-1), bits_around(blocks).reshape(-1)
        reached = np.flatnonzero((place >= 0) & (bits > 0.0))
        viewpoints = np.zeros((len(reached), 5))
        viewpoints[:, :3] = np.stack(np.unravel_index(place[reached], shape), axis=-1) + 0.5
        if maker.planar:
            viewpoints[:, 2] = here[2]
        viewpoints[:, 3:] = here[3:]
        seconds = np.empty(len(viewpoints))
        self._fill_seconds(maker, here, viewpoints, maker.reach, seconds)
        worth = bits[reached] / seconds**recipe.exponent
        viewpoints = viewpoints[np.argsort(worth)[-recipe.far_places :]].repeat(recipe.far_gazes, axis=0)
        if not maker.all_around:
            viewpoints[:, 3] = rng.uniform(-math.pi, math.pi, len(viewpoints))
            if not maker.level:
                pitch = _PITCH_SPREAD * rng.normal(size=len(viewpoints))
                viewpoints[:, 4] = np.clip(pitch, -0.5 * math.pi, 0.5 * math.pi)
        return viewpoints if kept is None else np.concatenate([viewpoints, kept[None]])

    def _far_evaluated(self, situation: Situation, maker: _Maker, viewpoints: np.ndarray) -> Candidates:
        bits = self.bits_at(situation, viewpoints)
        seconds = np.empty(len(viewpoints))
        self._fill_seconds(maker, situation.here, viewpoints, maker.reach, seconds)
        return Candidates(viewpoints, bits, seconds, np.full(len(viewpoints), Kind.FAR, np.int8))

    def bits_at(self, situation: Situation, viewpoints: np.ndarray) -> np.ndarray:
        """(K,) expected bits of scans at viewpoints (K, 5), wherever they are."""
        maker = self._maker(situation.robot)
        return situation.weigh(viewpoints, self._imagined(situation, maker, maker.exact, viewpoints))

    def _imagined(
        self, situation: Situation, maker: _Maker, model: RobotModel, viewpoints: np.ndarray
    ) -> np.ndarray:
        bits, gap = np.empty(len(viewpoints)), maker.recipe.gap_probability
        imagined_bits(situation.belief, model.scan, gap, viewpoints, situation.cones, self._scratch, bits)
        return bits

    def towards(
        self, situation: Situation, travel: Travel, goal: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray | None:
        """(5,) the first stop on the path to a far viewpoint, with the best gaze; None = no path."""
        maker = self._maker(situation.robot)
        place = first_stop(travel, goal[:3], maker.reach, maker.planned)
        if place is None:
            return None
        stop = goal.copy()
        stop[:3] = place
        if np.linalg.norm(place - goal[:3]) < 1e-6 or maker.all_around:
            return stop
        gazes = np.tile(stop, (maker.recipe.way_gazes, 1))
        gazes[1:, 3] = rng.uniform(-math.pi, math.pi, len(gazes) - 1)
        if not maker.level:
            pitch = _PITCH_SPREAD * rng.normal(size=len(gazes) - 1)
            gazes[1:, 4] = np.clip(pitch, -0.5 * math.pi, 0.5 * math.pi)
        return gazes[int(np.argmax(self.bits_at(situation, gazes)))]


def _cube(half: int, planar: bool) -> np.ndarray:
    """(N, 3) float64 steps in voxels, all but none, up to `half` along each axis; of planar robots flat."""
    across, layers = range(-half, half + 1), range(1) if planar else range(-half, half + 1)
    return np.array([s for s in itertools.product(across, across, layers) if any(s)], float)


def _drawn(maker: _Maker, here: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(K, 5) viewpoints: gazes around the present one, any gaze on the spot, places within reach."""
    recipe, within = maker.recipe, maker.within
    drawn = np.tile(here, (recipe.gazes + recipe.turns + recipe.places, 1))
    if maker.all_around:
        drawn[1:, 3] += angular_spread(maker.kind) * rng.normal(size=len(drawn) - 1)
    else:
        width, height = maker.kind.sensor.field_of_view_rad
        drawn[: recipe.gazes, 3] += recipe.yaw_spread * width * rng.normal(size=recipe.gazes)
        drawn[: recipe.gazes, 4] += recipe.pitch_spread * height * rng.normal(size=recipe.gazes)
        others = len(drawn) - recipe.gazes
        drawn[recipe.gazes :, 3] = rng.uniform(-math.pi, math.pi, others)
        drawn[recipe.gazes :, 4] = np.arcsin(rng.uniform(-1.0, 1.0, others))
    if recipe.places > 0:
        drawn[-recipe.places :, : within.axes] = draw_places(here, recipe.places, within, rng)
    _normalise(drawn, maker.level, here[4])
    return drawn


def _vary(
    maker: _Maker, viewpoints: np.ndarray, here: np.ndarray, spread: float, rng: np.random.Generator
) -> None:
    """Turn and shift (K, 5) viewpoints a little, in place; those on the spot stay there."""
    viewpoints[:, 3] += spread * rng.normal(size=len(viewpoints))
    viewpoints[:, 4] += spread * rng.normal(size=len(viewpoints))
    _shift(viewpoints, here, maker.within, rng)
    _normalise(viewpoints, maker.level, here[4])


def _shift(viewpoints: np.ndarray, here: np.ndarray, within: Surroundings, rng: np.random.Generator) -> None:
    """Shift places by a fifth of the reach, none out of it."""
    axes = within.axes
    step = viewpoints[:, :axes] - here[:axes]
    moved = np.linalg.norm(step, axis=1) > 0.0
    step[moved] += 0.2 * within.reach * rng.normal(size=(int(moved.sum()), axes))
    length = np.maximum(np.linalg.norm(step, axis=1) / within.reach, 1.0)
    viewpoints[moved, :axes] = np.clip(here[:axes] + step / length[:, None], 0.5, within.last)[moved]


def _normalise(viewpoints: np.ndarray, level: bool, pitch: float) -> None:
    """Bring gazes into their ranges, in place; robots that look level keep their pitch."""
    viewpoints[:, 3] = (viewpoints[:, 3] + math.pi) % (2.0 * math.pi) - math.pi
    if level:
        viewpoints[:, 4] = pitch
    else:
        viewpoints[:, 4] = np.clip(viewpoints[:, 4], -0.5 * math.pi, 0.5 * math.pi)
