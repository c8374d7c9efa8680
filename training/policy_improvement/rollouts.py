"""Roll-outs: what choosing another candidate than the planner's would have saved, in simulated seconds.

From a moment of a mission in which a robot decides, the mission is branched: in each branch the robot begins
with another of its candidates, and then all robots take the planner's choices. Branches share their random
numbers (common random numbers: Bertsekas & Castañón 1999), and several draws of these are averaged. A branch
goes on to the mission's end or to a horizon of decisions; what follows is left to a learned time to go.

Letters: N states, B branches of each, D draws, P privileged numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from baselines.experiments.mission import Surroundings
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.missions.observation.layout import ObservationLayout, Part
from entropy_explore_env.missions.privileged import (
    PRIVILEGED,
    copy_missions,
    deciding,
    mission_times,
    privileged_numbers,
    reseed,
    running,
    stop,
)
from entropy_explore_env.scenario import Scenario, with_settings
from training.candidate_network import CandidateParts, candidate_parts
from training.errors import RollOutError

_NOTHING = dict.fromkeys(("panorama", "self_state", "team", "candidates", "overlaps", "action_mask"), False)
MOST_STEPS = 200_000
"""Of a mission that is led to its end: no mission should take so many."""
_MOST_STEPS = 50
"""Steps for each decision of a roll-out's horizon, at most; each should bring at least one decision."""


PLANNER = 0
"""Number of the candidate that is the planner's own choice."""


class BatchMissions:
    """E missions whose robots choose among candidates, without autoreset and without infos.

    Attributes:
        scenario: Of the missions, with the grid of their worlds.
        missions: The library's arrays.
        parts: Where observations hold what of candidates.
    """

    def __init__(
        self, scenario: Scenario, count: int, threads: int, surroundings: Surroundings | None = None
    ) -> None:
        """Make room for E missions."""
        around = {} if surroundings is None else surroundings.settings()
        made = EntropyExploreVectorEnv(scenario, count, threads=threads, action_masks=False, **around)
        self.missions, self.scenario = made.missions, made.scenario
        self.parts: CandidateParts = candidate_parts(ObservationLayout(self.scenario))
        self._no_numbers = np.zeros((count, self.scenario.robots, 5))

    def step(self, actions: np.ndarray) -> None:
        """Take the candidates with these numbers, (E, A) int64."""
        self.missions.step(self._no_numbers, actions)

    def led(self, acts: Callable[[BatchMissions], np.ndarray]) -> Iterator[np.ndarray]:
        """Lead the missions to their ends.

        Args:
            acts: From missions to the candidates (E, A) that their robots take.

        Yields:
            Before every step, (E,) bool: which missions go on.

        Raises:
            RollOutError: A mission makes no headway.
        """
        missions = self.missions
        for _ in range(MOST_STEPS):
            going = running(missions)
            if not going.any():
                return
            yield going
            self.step(acts(self))
        clock_s = float(mission_times(missions).max())
        raise RollOutError(self.scenario.name, missions.seeds[0], missions.episodes[0], MOST_STEPS, clock_s)

    def features(self) -> np.ndarray:
        """(E, A, K, F) float32 of the candidates; a view."""
        return self._part(self.parts.candidates)

    def exists(self) -> np.ndarray:
        """(E, A, K) bool, which candidates there are."""
        return self._part(self.parts.mask) > 0.5

    def _part(self, part: Part) -> np.ndarray:
        seen = self.missions.observations[:, :, part.start : part.stop]
        return seen.reshape(*seen.shape[:2], *part.shape)

    def told(self) -> np.ndarray:
        """(E, A, size + P) float32, what robots observe and what only training knows."""
        return np.concatenate([self.missions.observations, privileged_numbers(self.missions)], axis=2)

    def close(self) -> None:
        """End the threads."""
        self.missions.close()


class Outcomes(NamedTuple):
    """What N states' branches came to; branches that a state lacks hold NaN."""

    seconds: np.ndarray
    """(N, B, D) float32 from the state to the branch's end or horizon."""
    ended: np.ndarray
    """(N, B, D) bool, whether the mission ended there."""
    at_end: np.ndarray
    """(N, B, D, P) float32, the first robot's privileged numbers there."""


class RollOutEffort(NamedTuple):
    """How far branches go, and how many viewpoints the planner draws that leads them."""

    horizon: int = 30
    """Decisions a robot until a branch is cut off; 0 = never."""
    divisor: int = 4
    """So many times fewer viewpoints are drawn and refined than by the planner itself."""


class Branch(NamedTuple):
    """A state whose branches are run."""

    mission: int
    """Its mission's number among those that it is branched from."""
    robot: int
    candidates: np.ndarray
    """(≤ B,) int64, numbers of the candidates that its branches begin with; the planner's choice first."""
    key: int | None
    """Of its random numbers: draw d of all of its branches has key + d. None = the mission's own."""


class RollOuts:
    """Room for the branches of several states at once."""

    def __init__(
        self, scenario: Scenario, shape: tuple[int, int, int], effort: RollOutEffort, threads: int
    ) -> None:
        """Make missions for them.

        Args:
            scenario: Of the missions that are branched, with the grid of their worlds.
            shape: (N, B, D).
            effort: How far branches go, and how many viewpoints their planner draws.
            threads: Threads that share the missions.
        """
        self.shape, self._horizon = shape, effort.horizon
        unseen = with_settings(
            scenario, {"observation": _NOTHING}
        )  # features would cost more than the choice
        self._env = EntropyExploreVectorEnv(unseen, int(np.prod(shape)), threads=threads, action_masks=False)
        self._missions = self._env.missions
        self._missions.thin_candidates(effort.divisor)
        self._waiting: list[Branch] = []

    @property
    def full(self) -> bool:
        """Whether there is no room for another state."""
        return len(self._waiting) == self.shape[0]

    def add(self, source: BatchMissions, branch: Branch) -> None:
        """Copy a mission as it is into room for its branches."""
        place, (_, branches, draws) = len(self._waiting), self.shape
        first = place * branches * draws
        used = len(branch.candidates) * draws
        unbegun = [row for row, episode in enumerate(self._missions.episodes) if episode < 0]
        if unbegun:  # rows that no branch uses must be missions, too, if only to be left alone
            copy_missions(source.missions, [branch.mission] * len(unbegun), self._missions, unbegun)
        at = np.arange(first, first + used)
        copy_missions(source.missions, [branch.mission] * used, self._missions, at.tolist())
        if branch.key is not None:
            reseed(self._missions, at.tolist(), [branch.key + row % draws for row in range(used)])
        self._waiting.append(branch)

    def run(self) -> Outcomes:
        """Run the branches of all states that were added, and forget these.

        Raises:
            RollOutError: A branch makes no headway.
        """
        missions, team = self._missions, self._env.scenario.robots
        waiting, self._waiting = self._waiting, []
        actions, alive = self._first_actions(waiting)
        stop(missions, ~alive)
        rows = missions.count
        began_s, decisions = mission_times(missions), np.zeros(rows, np.int64)
        most = self._horizon * team if self._horizon else np.iinfo(np.int64).max
        seconds, ended = np.full(rows, np.nan, np.float32), np.zeros(rows, bool)
        at_end, steps = np.zeros((rows, len(PRIVILEGED)), np.float32), 0
        no_numbers = np.zeros((rows, team, 5))
        while alive.any():
            decisions += deciding(missions).sum(axis=1)
            missions.step(no_numbers, actions)
            actions[:] = PLANNER
            steps += 1
            over = ~running(missions)
            done = alive & (over | (decisions >= most))
            if done.any():
                seconds[done] = (mission_times(missions) - began_s)[done]
                ended[done] = over[done]
                at_end[done] = privileged_numbers(missions)[done, 0]
                stop(missions, done)
                alive &= ~done
            self._check_headway(alive, steps)
        whole = (each.reshape(*self.shape, *each.shape[1:]) for each in (seconds, ended, at_end))
        return Outcomes(*(each[: len(waiting)] for each in whole))

    def _first_actions(self, waiting: list[Branch]) -> tuple[np.ndarray, np.ndarray]:
        """What the robots of all rows do first (E, A), and which rows are branches, (E,) bool."""
        _, branches, draws = self.shape
        rows = self._missions.count
        actions, alive = np.full((rows, self._env.scenario.robots), PLANNER, np.int64), np.zeros(rows, bool)
        for place, branch in enumerate(waiting):
            first = place * branches * draws
            own = slice(first, first + len(branch.candidates) * draws)
            actions[own, branch.robot] = branch.candidates.repeat(draws)
            alive[own] = True
        return actions, alive

    def _check_headway(self, alive: np.ndarray, steps: int) -> None:
        """Raise a RollOutError where a branch has taken more steps than any should."""
        limit = _MOST_STEPS * max(self._horizon, 1000) * self._env.scenario.robots
        if steps <= limit or not alive.any():
            return
        missions, row = self._missions, int(np.flatnonzero(alive)[0])
        clock_s, name = float(mission_times(missions)[row]), self._env.scenario.name
        raise RollOutError(name, missions.seeds[row], missions.episodes[row], steps, clock_s)

    def close(self) -> None:
        """End the threads."""
        self._env.close()


def candidates_to_try(
    features: np.ndarray, exists: np.ndarray, parts: CandidateParts, branches: int, rng: np.random.Generator
) -> np.ndarray:
    """Numbers of the candidates that branches begin with: the planner's choice, then good ones and any.

    Half of the others have the best scores, the rest are drawn from what is left, so that labels say
    something of all kinds of candidates.

    Args:
        features: (K, F) of a robot's candidates.
        exists: (K,) bool.
        parts: Which feature is what.
        branches: B, at most so many.
        rng: Draws.

    Returns:
        (≤ B,) int64, none twice.
    """
    chosen = int(features[:, parts.chosen].argmax())
    order = np.argsort(-features[:, parts.score], kind="stable")
    others = [each for each in order.tolist() if exists[each] and each != chosen]
    good = others[: branches // 2]
    rest = rng.permutation(np.array(others[len(good) :], np.int64))[: branches - 1 - len(good)]
    return np.concatenate([[chosen], np.array(good, np.int64), rest]).astype(np.int64)[:branches]
