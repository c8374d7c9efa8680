"""Candidates out of what one robot knows, for strategies and policies in whatever form actions have."""

from __future__ import annotations

import numpy as np

from entropy_explore_env.belief.paths.lattice import NO_FLY_NOWHERE
from entropy_explore_env.belief.paths.search import Search
from entropy_explore_env.missions.foresight import Foresight
from entropy_explore_env.missions.proposals import Known, locate, propose_to
from entropy_explore_env.missions.rules import Rules, rules_of
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.planner.candidate_features import CONTEXT, FEATURES
from entropy_explore_env.planner.model import Proposer, new_proposers
from entropy_explore_env.planner.records import CANDIDATE, EXPERIENCE, Kind
from entropy_explore_env.planner.thresholds import NO_GAIN_BITS
from entropy_explore_env.prediction.crop import UNPREDICTED
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.expected_scan import MOST_SCANS, ScanScratch


class ViewProposer:
    """Proposes candidates to the robots of one mission, decision by decision, as missions do.

    What a robot remembers from one decision to the next is in here. The draws are the same as in missions
    whose actions are candidates, but for the random numbers.
    """

    def __init__(
        self,
        scenario: Scenario,
        rng: np.random.Generator,
        overlaps: bool = False,
        foresight: Foresight | None = None,
    ) -> None:
        """Begin a mission.

        Args:
            scenario: With candidates as actions; views may be of a scenario with others.
            rng: The random streams of the robots are drawn from it.
            overlaps: Whether overlaps are wanted.
            foresight: What is predicted of voxels that a robot never measured; None = nothing.
        """
        self._foresight = foresight
        team, most = scenario.robots, scenario.action.candidates
        self._rules: Rules = rules_of(scenario)
        self._proposers = self._new_proposers(scenario)
        self._candidates = np.zeros((team, most), CANDIDATE)
        self._experience = np.zeros(team, EXPERIENCE)
        self._experience["candidates_rng"][:, 0] = rng.integers(0, 2**64, team, np.uint64)
        described = int(most > 1)  # a single one is the planner's own choice, with nothing to compare
        self._features = np.zeros((team, most, described * len(FEATURES)), np.float32)
        self._context = np.zeros((team, described * len(CONTEXT)), np.float32)
        self._overlaps = np.zeros((team, most, most if overlaps else 0), np.float32)
        self._proposed: list[tuple[float, float] | None] = [None] * team
        """Time and entropy of the map of the view by which each robot's candidates were proposed."""

    def _new_proposers(self, scenario: Scenario) -> list[Proposer]:
        return new_proposers(scenario, predicted=self._foresight is not None)

    def grow(self, scenario: Scenario, shift: np.ndarray) -> None:
        """Go on in a larger grid, in which voxel (0, 0, 0) of the one before has the indices `shift`."""
        self._rules, self._proposers = rules_of(scenario), self._new_proposers(scenario)
        for name in ("goal", "far_at", "stood_at", "edge_at", "failed"):
            self._experience[name][..., :3] += shift

    @property
    def search(self) -> Search:
        """Memory of its path searches, which nothing needs from one decision to the next."""
        return self._proposers[0].scratch.search

    def propose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoints that are proposed to a robot that decides.

        They stay the same until the time or the map is another one.

        Returns:
            (n, 5) float64, map frame, the planner's own choice first; n ≥ 1.
        """
        robot, moment = view.robot, (view.time_s, view.entropy_bits)
        if self._proposed[robot] != moment:
            self._proposed[robot] = moment
            self._propose(view)
        candidates = self._candidates[robot]
        return candidates["viewpoint"][candidates["kind"] != Kind.NONE]

    def _propose(self, view: RobotView) -> None:
        robot, no_fly, params = view.robot, view.no_fly_mask(), self._rules.params
        proposer = self._proposers[int(params[robot]["kind"])]
        if self._foresight is not None:
            _foresee(self._foresight(view), proposer.scratch.scan)
        known = proposer.scratch.knowledge[0]
        variances = float(np.trace(view.covariance[:3, :3])), float(view.covariance[3, 3])
        pose, target = view.pose.copy(), view.target.copy()
        locate(params[robot], pose, target, variances, view.entropy_bits, known)
        known["time_s"], known["came_bits"] = view.time_s, view.scan.utility_bits.sum()
        known["gained_bits"], known["heard_bits"] = view.gained_bits, view.heard_bits
        known["move_end"], known["under_way"] = view.move_end.code, view.under_way
        known["teammates"] = len(params) - 1
        about = Known(
            known,
            view.heard.copy(),
            writable(view.mean),
            writable(view.precision),
            NO_FLY_NOWHERE if no_fly is None else no_fly.reshape(-1),
            self._candidates[robot],
            self._experience[robot],
        )
        parts = (self._features[robot].reshape(-1), self._context[robot], self._overlaps[robot].reshape(-1))
        propose_to(params, robot, about, proposer, parts)

    def found_nothing(self, robot: int) -> bool:
        """Return whether nothing is expected of any viewpoint that was evaluated for a robot last."""
        first = self._candidates[robot, 0]
        return bool(first["bits"] <= NO_GAIN_BITS and self._experience[robot]["blocked"] == 0)

    def forget_goal(self, robot: int) -> None:
        """Forget to which far place a robot was going, since it goes elsewhere now."""
        self._experience[robot]["going"] = False

    def features(self, robot: int) -> np.ndarray:
        """Return (K, F) float32 of the candidates proposed to a robot last: `candidate_features.FEATURES`."""
        return self._features[robot]

    def context(self, robot: int) -> np.ndarray:
        """Return (C,) float32 of the same moment: `candidate_features.CONTEXT`."""
        return self._context[robot]

    def overlaps(self, robot: int) -> np.ndarray:
        """Return (K, K) float32 of the same candidates, where overlaps are wanted."""
        return self._overlaps[robot]

    def viewpoint(self, robot: int, number: int) -> np.ndarray:
        """Return (5,) the viewpoint of a candidate proposed last, map frame; else the first one."""
        return self._candidates[robot, number]["viewpoint"].copy()


def _foresee(solid: np.ndarray | None, scratch: ScanScratch) -> None:
    """Have scans imagined in a predicted map, and several of them at one place, if anything is predicted."""
    if solid is not None:
        scratch.solid[:] = solid
    elif scratch.scans[0] > 1:
        scratch.solid[:] = UNPREDICTED
    scratch.scans[0] = 1 if solid is None else MOST_SCANS


def writable(array: np.ndarray) -> np.ndarray:
    """Return (V,) an array of a view in the one type for which kernels are compiled; nothing writes to it."""
    flat = array.reshape(-1).view()
    flat.setflags(write=True)
    return flat
