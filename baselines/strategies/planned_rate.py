"""The strategy `planned-rate`: viewpoints nearby and far places on planned paths, by expected bits per time.

Ours, not a paper's: the successor of `information-rate-v0`. Candidates and their expected bits are those of
`viewpoints.candidates`, drawn and scored by what the robot is (`viewpoints.recipe`). A far place is driven to
if it is worth more than every viewpoint nearby, along the shortest path by the robot's belief, and the robot
decides anew at every stop. What did not come, and what could not be reached, is remembered: no place and gaze
is tried again that brought nothing, and robots whose bodies block each other part.

What a robot is, and what its mission asks for, decides how it explores:

- Flying robots, and all in 3-D worlds: bits per time, with the recipe of narrow or of wide views.
- Ground robots with a scanner that sees all around, in a plan, deciding at stops until the map has so little
  entropy: bits per time.
- The same robots where they decide under way (`Robot.redecide`), or where the mission ends by what is seen:
  frontier cells, by `explorers.advantage_ahead`. Bits per time would change its mind at every scan, and
  would leave what is small until the end.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from baselines.strategies.explorers.advantage_ahead import AdvantageAhead
from baselines.strategies.knowledge import announced_cones, belief_of
from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.viewpoints.candidates import CandidatePlanner, Situation
from entropy_explore_env.viewpoints.evaluation import sees_all_around
from entropy_explore_env.viewpoints.planner_rules import (
    ALIKE_EDGES,
    ALIKE_RAD,
    BLOCKED_DECISIONS,
    CLEAR,
    DISAPPOINTING,
    DREGS_SHARE,
    ELSEWHERE,
    FAR_EVERY,
    FORGET_EDGES,
    MISSED_EDGES,
    NOTHING_BITS,
    PATIENCE,
    POOR,
    REMEMBERED,
    TRIED_STOPS,
)
from entropy_explore_env.viewpoints.recipe import Recipe
from entropy_explore_env.viewpoints.travel import Travel

_ARRIVALS = (MoveEnd.ARRIVED, MoveEnd.CORNERS)
"""How drives end that nothing cut short. A robot that drifts may believe to stand elsewhere all the same."""


class _Remembered(NamedTuple):
    """A viewpoint that did not bring what was expected."""

    viewpoint: np.ndarray
    """(5,) in grid units."""
    share: float
    """Of the expected bits that came; 0 = it could not be reached."""
    forget_at: float
    """Distance from it at which it is forgotten, voxel edges."""


@dataclass
class _Memory:
    """What a robot remembers from one decision to the next."""

    chosen: np.ndarray | None = None
    """(5,) in grid units."""
    expected: float = 0.0
    """Bits at `chosen`."""
    most_bits: float = 0.0
    """Most bits ever expected of a viewpoint."""
    avoided: list[_Remembered] = field(default_factory=list)
    goal: np.ndarray | None = None
    """(5,) the far viewpoint that it is driving to."""
    far_value: float = 0.0
    """What the best far place was worth when they were last looked at."""
    far_at: np.ndarray | None = None
    """(3,) where that was."""
    patience: int = 0
    """Decisions until far places are looked at again on the same spot."""
    blocked: int = 0
    """Decisions during which it keeps clear of teammates."""
    free_at: np.ndarray | None = None
    """(3,) the last place from which a path led anywhere."""


def explores_frontiers(scenario: Scenario, kind: RobotKind) -> bool:
    """Whether robots of a kind go for frontier cells, and not for bits."""
    plan = scenario.grid.flat and kind.robot.motion == "planar" and sees_all_around(kind.sensor)
    return plan and (kind.robot.redecide != "at_stop" or scenario.ending.by_seen)


class PlannedRate:
    """Chooses among candidates nearby and far away by bits / s^c; in some plans among frontier cells."""

    def __init__(self, recipes: Mapping[int, Recipe] | None = None) -> None:
        """Take the recipe of each kind of robot by its number; None = by what the robot is."""
        self._recipes = recipes

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._rng = rng
        self._planner = CandidatePlanner(scenario, self._recipes)
        self._memories = [_Memory() for _ in range(scenario.robots)]
        self._frontiers = [explores_frontiers(scenario, kind) for kind in scenario.kinds]
        self._plans = AdvantageAhead()
        if any(self._frontiers):
            self._plans.reset(scenario, rng)

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """The viewpoint of each view, by its own belief and what it has heard."""
        chosen = []
        for view in views:
            frontiers = self._frontiers[view.robot % len(self._frontiers)]
            chosen += self._plans.choose([view]) if frontiers else [self._choose(view)]
        return chosen

    def _choose(self, view: RobotView) -> np.ndarray:
        memory, grid = self._memories[view.robot], view.scenario.grid
        here = grid.in_grid_units(view.pose)
        _experience(memory, view, here)
        weigher = _Weigher(memory, view, self._planner.recipe_of(view.robot).dregs)
        situation = Situation(
            view.robot,
            here,
            belief_of(view),
            announced_cones(view),
            view.no_fly_mask(),
            weigher,
            weigher.trust,
        )
        chosen, expected = self._best(situation, memory, view)
        stays = bool((chosen[:3] == here[:3]).all())
        exits = self._exits(view, situation, memory) if stays and expected < POOR * memory.most_bits else []
        if len(exits) > 0:
            chosen, expected = exits[0], 0.0
        elif expected <= NOTHING_BITS or (memory.blocked and self._rng.uniform() < 0.5):
            chosen, expected = self._elsewhere(view, situation), 0.0
        memory.chosen, memory.expected = chosen.copy(), expected
        viewpoint = chosen.copy()
        viewpoint[:3] = np.asarray(grid.origin_m) + viewpoint[:3] * grid.voxel_size_m
        return viewpoint

    def _best(self, situation: Situation, memory: _Memory, view: RobotView) -> tuple[np.ndarray, float]:
        """The best viewpoint (5,) in grid units, and its expected bits."""
        recipe = self._planner.recipe_of(view.robot)
        planned = view.kind.robot.navigator == "planned"
        travel = self._planner.start_search(situation) if planned else None
        near = self._planner.near(situation, travel, self._rng)
        values = near.values(recipe.exponent)
        best = int(np.argmax(values))
        value, bits = float(values[best]), float(near.bits[best])
        memory.most_bits = max(memory.most_bits, bits)
        if self._look_far(memory, situation.here, value, bits, recipe):
            travel = travel or self._planner.start_search(situation)
            stop = self._far_stop(situation, travel, memory, value, recipe)
            if stop is not None:
                return stop, float(self._planner.bits_at(situation, stop[None])[0])
        return near.viewpoints[best], bits

    def _look_far(self, memory: _Memory, here: np.ndarray, value: float, bits: float, recipe: Recipe) -> bool:
        """Whether far places could be worth more than a viewpoint nearby."""
        moved = memory.far_at is None or float(np.linalg.norm(memory.far_at - here[:3])) > 0.5
        memory.patience -= 1
        if memory.goal is not None:
            return True
        if recipe.far_below < 1.0:
            return bits < recipe.far_below * memory.most_bits and memory.patience <= 0
        return moved or value < memory.far_value or memory.patience <= 0

    def _far_stop(
        self, situation: Situation, travel: Travel, memory: _Memory, value: float, recipe: Recipe
    ) -> np.ndarray | None:
        """The first stop (5,) on the way to a far place that is worth more than `value`; None = none is."""
        far = self._planner.far(situation, travel, memory.most_bits, memory.goal, self._rng)
        values = far.values(recipe.exponent)
        memory.far_value, memory.far_at = float(values.max(initial=0.0)), situation.here[:3].copy()
        memory.patience = FAR_EVERY if recipe.far_below >= 1.0 else PATIENCE
        if memory.goal is not None and len(values) > 0:
            values[-1] *= recipe.keep
        memory.goal = None
        for best in np.argsort(-values)[:TRIED_STOPS].tolist():
            if values[best] <= value:
                break
            stop = self._planner.towards(situation, travel, far.viewpoints[best], self._rng)
            if stop is not None and situation.trust(stop[None])[0] >= DISAPPOINTING:
                memory.goal = far.viewpoints[best].copy()
                memory.most_bits = max(memory.most_bits, float(far.bits[best]))
                return stop
        return None

    def _exits(self, view: RobotView, situation: Situation, memory: _Memory) -> np.ndarray:
        """(K, 5) viewpoints next to a robot that its belief shuts in; none where it can get anywhere else.

        The way out is the way that it came, so the nearest to where it was last free comes first.
        """
        if view.kind.robot.navigator != "planned":
            return np.zeros((0, 5))
        if not self._planner.is_shut_in(situation, self._planner.start_search(situation)):
            memory.free_at = situation.here[:3].copy()
            return np.zeros((0, 5))
        exits = self._planner.exits(situation)
        exits = exits[situation.trust(exits) > 0.0]
        if memory.free_at is None or np.linalg.norm(memory.free_at - situation.here[:3]) < 1.0:
            return self._rng.permutation(exits)
        return exits[np.argsort(np.linalg.norm(exits[:, :3] - memory.free_at, axis=1), kind="stable")]

    def _elsewhere(self, view: RobotView, situation: Situation) -> np.ndarray:
        """(5,) a random viewpoint in grid units: of some, one that a path leads to, past all teammates."""
        grid = view.scenario.grid
        drawn = np.stack([grid.in_grid_units(random_viewpoint(view, self._rng)) for _ in range(ELSEWHERE)])
        trust = situation.trust(drawn)
        if view.kind.robot.navigator == "planned":
            travel = self._planner.start_search(situation)
            trust *= np.isfinite(self._planner.seconds_to(situation, travel, drawn))
            exits = self._planner.exits(situation)
            if not trust.any() and len(exits) > 0:
                drawn, trust = exits, situation.trust(exits)
        return drawn[int(self._rng.choice(np.flatnonzero(trust == trust.max())))]


class _Weigher:
    """What expected bits are worth to a robot that has experienced what it remembers."""

    def __init__(self, memory: _Memory, view: RobotView, dregs: float = 0.0) -> None:
        self._dregs = dregs * memory.most_bits
        self._avoided, self._all_around = memory.avoided, sees_all_around(view.kind.sensor)
        grid = view.scenario.grid
        self._here = grid.in_grid_units(view.pose)[:3]
        self._bodies: list[tuple[np.ndarray, float]] = []
        if memory.blocked:
            for mate, heard in view.teammates.items():
                radius_m = view.scenario.kind_of(mate).robot.body_radius_m
                if heard.heard_s >= 0.0 and radius_m > 0.0:
                    touching = (radius_m + view.kind.robot.body_radius_m) / grid.voxel_size_m
                    self._bodies.append((grid.in_grid_units(heard.pose)[:3], CLEAR * touching))

    def __call__(self, viewpoints: np.ndarray, bits: np.ndarray) -> np.ndarray:
        """(K,) the bits of viewpoints (K, 5) in grid units, or less."""
        if self._dregs > 0.0:
            bits = np.maximum(bits - self._dregs, DREGS_SHARE * bits)
        return self._lessened(viewpoints, bits)

    def trust(self, viewpoints: np.ndarray) -> np.ndarray:
        """(K,) share of the expected bits that viewpoints (K, 5) like these brought; 0 past a body.

        Whether a place is worth driving to at all is asked of this share: dregs are bits, and no part of it.
        """
        return self._lessened(viewpoints, np.ones(len(viewpoints)))

    def _lessened(self, viewpoints: np.ndarray, bits: np.ndarray) -> np.ndarray:
        """(K,) bits, less where viewpoints like these brought less, and 0 past a teammate's body."""
        for viewpoint, share, _ in self._avoided:
            alike = np.linalg.norm(viewpoints[:, :3] - viewpoint[:3], axis=1) < ALIKE_EDGES
            if share > 0.0 and not self._all_around:
                turn = np.abs((viewpoints[:, 3] - viewpoint[3] + math.pi) % (2.0 * math.pi) - math.pi)
                alike &= np.maximum(turn, np.abs(viewpoints[:, 4] - viewpoint[4])) < ALIKE_RAD
            bits = np.where(alike, bits * share, bits)
        for body, touching in self._bodies:
            bits = np.where(_comes_near(self._here, viewpoints[:, :3], body, touching), 0.0, bits)
        return bits


def _comes_near(here: np.ndarray, places: np.ndarray, body: np.ndarray, touching: float) -> np.ndarray:
    """(K,) bool, whether a straight drive to a place (K, 3) brings a robot nearer to a body than allowed.

    Where they touch already, only drives away from it are free.
    """
    step, to_body = places - here, body - here
    length = (step**2).sum(axis=1)
    share = np.clip((step @ to_body) / np.maximum(length, 1e-12), 0.0, 1.0)
    gap = np.linalg.norm(here + share[:, None] * step - body, axis=1)
    return (length > 1e-12) & (gap < touching) & (share > 0.0)


def _experience(memory: _Memory, view: RobotView, here: np.ndarray) -> None:
    """Compare what came with what was expected, and remember what is not worth another try."""
    memory.avoided = [
        each for each in memory.avoided if np.linalg.norm(each.viewpoint[:3] - here[:3]) < each.forget_at
    ][-REMEMBERED:]
    memory.blocked = max(memory.blocked - 1, 0)
    if memory.chosen is None:
        return
    missed = float(np.linalg.norm(memory.chosen[:3] - here[:3]))
    came = max(float(view.scan.utility_bits.sum()), 0.0)
    if view.move_end is MoveEnd.TEAMMATE:
        memory.blocked = BLOCKED_DECISIONS
    drifted = view.move_end in _ARRIVALS and bool(view.covariance.any())
    if missed > MISSED_EDGES and not drifted:
        memory.avoided.append(_Remembered(memory.chosen, 0.0, max(2.0 * missed, FORGET_EDGES)))
        memory.goal = None
    elif came < DISAPPOINTING * memory.expected:
        memory.avoided.append(_Remembered(memory.chosen, came / memory.expected, FORGET_EDGES))
