"""The planner restricted to the discrete actions of `training.ppo`: what that set of actions costs.

At each decision every move and gaze that makes sense is scored as the planner scores its candidates, by
expected bits / s^c, and the best is taken; c is the recipe's at all times (`Recipe.leave_below` has no say).
An action that brought nothing at a place is not tried there again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import belief_costs
from entropy_explore_env.belief.paths.planning import ANY_GOAL, search_paths
from entropy_explore_env.decision_settings import Action, Observation
from entropy_explore_env.frontiers.knowledge import announced_cones, belief_of
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_observation import ViewObserver
from entropy_explore_env.planner.model import Proposer, new_proposers
from entropy_explore_env.planner.thresholds import FAILED_SHARE, PATHS_WITHIN
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import straight_seconds, travel_seconds
from entropy_explore_env.viewpoints.expected_scan import fill_expected_bits

ACTIONS = Action(kind="discrete", moves="axes", yaws=16, pitches=7)
"""Those of `training.ppo`: 7 moves × 16 yaws × 7 pitches; of planar robots 5 × 16."""
_MASK = Observation(panorama=False, self_state=False, team=False, action_mask=True, flat=True)


class RestrictedPlanner:
    """A strategy: the best of the discrete actions by the planner's own score."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._rng = rng
        self._proposers = new_proposers(scenario)
        self._observer = ViewObserver(scenario, _MASK, ACTIONS)
        self._tried: dict[int, set[tuple[float, ...]]] = {}
        self._latest: dict[int, tuple[tuple[float, ...], float]] = {}

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoint (5,) of one robot."""
        return self.choose_all([view])[0]

    def choose_all(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """The viewpoint of each view."""
        return [self._choose(view) for view in views]

    def _choose(self, view: RobotView) -> np.ndarray:
        self._remember(view)
        sensible = np.flatnonzero(self._observer.observe(view) > 0.5)
        viewpoints = np.stack([self._observer.viewpoint(view, int(action)) for action in sensible])
        grid = view.scenario.grid
        here = grid.in_grid_units(view.pose)
        places = np.stack([grid.in_grid_units(viewpoint) for viewpoint in viewpoints])
        proposer, belief = self._proposers[view.robot % len(self._proposers)], belief_of(view)
        bits = np.empty(len(places))
        fill_expected_bits(belief, proposer.exact, places, announced_cones(view), proposer.scratch.scan, bits)
        seconds = _seconds(view, proposer, belief, here, places)
        exponent = proposer.recipe.exponent
        worth = np.where(np.isfinite(seconds), bits / np.maximum(seconds, 1e-9) ** exponent, 0.0)
        tried = self._tried.get(view.robot, set())
        worth[[_key(viewpoint) in tried for viewpoint in viewpoints]] = 0.0
        best = int(worth.argmax()) if worth.max() > 0.0 else int(self._rng.integers(len(worth)))
        self._latest[view.robot] = (_key(viewpoints[best]), float(bits[best]))
        return viewpoints[best]

    def _remember(self, view: RobotView) -> None:
        """Note what brought nothing."""
        latest = self._latest.get(view.robot)
        if latest is not None and float(view.scan.utility_bits.sum()) < FAILED_SHARE * latest[1]:
            self._tried.setdefault(view.robot, set()).add(latest[0])


def _seconds(
    view: RobotView, proposer: Proposer, belief: Belief, here: np.ndarray, places: np.ndarray
) -> np.ndarray:
    """(K,) seconds until scans at viewpoints (K, 5), grid units; inf = there is no path."""
    edge_m, scratch, drive = view.scenario.grid.voxel_size_m, proposer.scratch, proposer.drive
    if not proposer.planned:
        return np.array(
            [straight_seconds(belief, edge_m, drive, here, place, scratch.scan) for place in places]
        )
    no_fly, prior = view.no_fly_mask(), view.scenario.sigma_prior**-2
    no_fly = None if no_fly is None else no_fly.reshape(-1)
    costs = belief_costs(belief.mean, belief.precision, prior, proposer.unknown_cost, no_fly)
    at = np.clip(here[:3].astype(np.int64), 0, np.array(belief.size) - 1)
    source = np.array([np.ravel_multi_index(tuple(at), belief.size)], np.int32)
    farthest = PATHS_WITHIN * proposer.within + 1.0
    search_paths(scratch.search, proposer.lattice, costs, source, ANY_GOAL, farthest)
    search, size = scratch.search, belief.size
    return np.array([travel_seconds(search, size, drive, edge_m, here, place, math.inf) for place in places])


def _key(viewpoint: np.ndarray) -> tuple[float, ...]:
    """A viewpoint to compare with others: those of the set are the same numbers each time."""
    return tuple(np.round(viewpoint, 6).tolist())
