"""The planner restricted to the discrete actions of `training.ppo`: what that set of actions costs.

At each decision every move and gaze that makes sense is scored as the planner scores its candidates, by
expected bits / s^c, and the best is taken. An action that brought nothing at a place is not tried there
again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from baselines.strategies.knowledge import announced_cones, belief_of
from entropy_explore_env.decision_settings import Action, Observation
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_observation import ViewObserver
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.viewpoints.candidates import CandidatePlanner, Situation
from entropy_explore_env.viewpoints.evaluation import new_scratch, robot_model, straight_seconds
from entropy_explore_env.viewpoints.planner_rules import DISAPPOINTING

ACTIONS = Action(kind="discrete", moves="axes", yaws=16, pitches=7)
"""Those of `training.ppo`: 7 moves × 16 yaws × 7 pitches; of planar robots 5 × 16."""
_MASK = Observation(panorama=False, self_state=False, team=False, action_mask=True, flat=True)


class RestrictedPlanner:
    """A strategy: the best of the discrete actions by the planner's own score."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._rng = rng
        self._planner = CandidatePlanner(scenario)
        self._observer = ViewObserver(scenario, _MASK, ACTIONS)
        self._models = [
            robot_model(scenario, kind, 1, self._planner.recipe_of(number).stop_probability)
            for number, kind in enumerate(scenario.kinds)
        ]
        self._scratch = new_scratch(scenario.grid, self._models)
        self._tried: dict[int, set[tuple[float, ...]]] = {}
        self._latest: dict[int, tuple[tuple[float, ...], float]] = {}

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """The viewpoint of each view."""
        return [self._choose(view) for view in views]

    def _choose(self, view: RobotView) -> np.ndarray:
        self._remember(view)
        sensible = np.flatnonzero(self._observer.observe(view) > 0.5)
        viewpoints = np.stack([self._observer.viewpoint(view, int(action)) for action in sensible])
        grid = view.scenario.grid
        here = grid.in_grid_units(view.pose)
        places = np.stack([grid.in_grid_units(viewpoint) for viewpoint in viewpoints])
        situation = Situation(view.robot, here, belief_of(view), announced_cones(view), view.no_fly_mask())
        bits = self._planner.bits_at(situation, places)
        seconds = self._seconds(view, situation, places)
        exponent = self._planner.recipe_of(view.robot).exponent
        worth = np.where(np.isfinite(seconds), bits / np.maximum(seconds, 1e-9) ** exponent, 0.0)
        tried = self._tried.get(view.robot, set())
        worth[[_key(viewpoint) in tried for viewpoint in viewpoints]] = 0.0
        best = int(worth.argmax()) if worth.max() > 0.0 else int(self._rng.integers(len(worth)))
        self._latest[view.robot] = (_key(viewpoints[best]), float(bits[best]))
        return viewpoints[best]

    def _remember(self, view: RobotView) -> None:
        """Note what brought nothing."""
        latest = self._latest.get(view.robot)
        if latest is not None and float(view.scan.utility_bits.sum()) < DISAPPOINTING * latest[1]:
            self._tried.setdefault(view.robot, set()).add(latest[0])

    def _seconds(self, view: RobotView, situation: Situation, places: np.ndarray) -> np.ndarray:
        """(K,) seconds until scans at viewpoints (K, 5), grid units; inf = there is no path."""
        if view.kind.robot.navigator == "planned":
            return self._planner.seconds_to(situation, self._planner.start_search(situation), places)
        model, seconds = self._models[view.robot % len(self._models)], np.empty(len(places))
        edge_m = model.scan.voxel_size_m
        straight_seconds(
            situation.belief, edge_m, model.drive, situation.here, places, self._scratch, seconds
        )
        return seconds


def _key(viewpoint: np.ndarray) -> tuple[float, ...]:
    """A viewpoint to compare with others: those of the set are the same numbers each time."""
    return tuple(np.round(viewpoint, 6).tolist())
