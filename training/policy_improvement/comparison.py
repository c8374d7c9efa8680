"""A policy beside the planner among whose candidates it chooses, paired by start, in worlds of validation."""

from __future__ import annotations

import dataclasses
from contextlib import closing
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from baselines.experiments.mission import Surroundings
from baselines.experiments.statistics import Interval, geometric_ratio_interval, median_ratio_interval
from entropy_explore_env.errors import counted
from entropy_explore_env.scenario import Scenario
from training.candidate_network import CandidatePolicy
from training.policy import choose_actions
from training.validation import Validator

FIRST = 1_000
"""Comparisons have other seeds than validations, by which the best policy of a run is chosen."""


@dataclass(frozen=True)
class Comparison:
    """Mission times of a policy and of the planner on the same starts.

    Attributes:
        scenario, robots, missions: What was run.
        policy_s, planner_s: Median mission times.
        ratio, ratio_low, ratio_high: Ratio of the medians with its paired 95 % interval.
        mean_ratio, mean_ratio_low, mean_ratio_high: Geometric mean of the paired ratios, likewise.
        faster: Starts on which the policy was faster.
        finished, planner_finished: Missions that came to what was asked for.
        worst_tenth: Ratio of the 90th percentiles.
    """

    scenario: str
    robots: int
    missions: int
    policy_s: float
    planner_s: float
    ratio: float
    ratio_low: float
    ratio_high: float
    mean_ratio: float
    mean_ratio_low: float
    mean_ratio_high: float
    faster: int
    finished: int
    planner_finished: int
    worst_tenth: float

    def line(self) -> str:
        """The comparison in one line."""
        return (
            f"{self.scenario}, {counted(self.robots, 'robot')}, {self.missions} starts: "
            f"{self.policy_s:.1f} s against {self.planner_s:.1f} s of the planner; "
            f"ratio of medians {self.ratio:.3f} ({self.ratio_low:.3f} … {self.ratio_high:.3f}), "
            f"mean of ratios {self.mean_ratio:.3f} ({self.mean_ratio_low:.3f} … {self.mean_ratio_high:.3f}), "
            f"faster on {self.faster}"
        )

    def as_json(self) -> dict[str, Any]:
        """As JSON holds it."""
        return dataclasses.asdict(self)


class Paired(NamedTuple):
    """Figures of a policy beside those of another strategy on the same starts; smaller is better."""

    medians: tuple[float, float]
    """Of the policy, and of the other."""
    ratio: Interval
    """Of the medians."""
    mean_ratio: Interval
    """Geometric mean of the paired ratios."""
    worst_tenth: float
    """Ratio of the 90th percentiles."""


def paired(own: np.ndarray, other: np.ndarray) -> Paired:
    """Compare figures (N,) of a policy with those of another strategy, start by start."""
    return Paired(
        (float(np.median(own)), float(np.median(other))),
        median_ratio_interval(own, other),
        geometric_ratio_interval([own], [other]),
        float(np.percentile(own, 90) / np.percentile(other, 90)),
    )


def compare_with_planner(
    policy: CandidatePolicy, scenario: Scenario, missions: int, threads: int, first: int = FIRST
) -> Comparison:
    """Run both on the same starts.

    Args:
        policy: Takes its likeliest candidates.
        scenario: With the form of the policy's actions and observations.
        missions: How many starts.
        threads: Threads that share the missions.
        first: Number of the first seed of validation.
    """
    planner = np.zeros(missions * scenario.robots, np.int64)  # candidate 0 is the planner's own choice
    with closing(Validator(scenario, Surroundings(), missions, threads, first)) as validator:
        theirs = validator.run(lambda observations: planner)
        ours = validator.run(lambda observations: choose_actions(policy, observations, None))
    assert ours is not None and theirs is not None
    own_s, planner_s = (np.array([each["t_mission_s"] for each in one]) for one in (ours, theirs))
    found = paired(own_s, planner_s)
    return Comparison(
        scenario.name,
        scenario.robots,
        missions,
        *found.medians,
        *found.ratio,
        *found.mean_ratio,
        int((own_s < planner_s).sum()),
        int(sum(each["finished"] for each in ours)),
        int(sum(each["finished"] for each in theirs)),
        found.worst_tenth,
    )
