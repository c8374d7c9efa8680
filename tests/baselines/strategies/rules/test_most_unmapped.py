"""Rules that choose among drawn poses: each takes the best by its own measure, and maps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.strategies import make_strategy
from baselines.strategies.rules.most_unmapped import LeastMapped, MostUnmapped, RandomKnown
from baselines.strategies.rules.next_best_view import NextBestView
from entropy_explore_env.missions.view import view_of
from tests.baselines.strategies.rules.scenes import missions_of, play

COUNTED = {MostUnmapped: (1, 1.0), LeastMapped: (0, -1.0)}
"""Rule → which of the counts in view it compares, and with which sign."""


@pytest.mark.parametrize("rule", [NextBestView, MostUnmapped, LeastMapped, RandomKnown])
def test_each_rule_takes_the_pose_that_is_best_by_its_own_measure(monkeypatch, rule):
    poses, worths, counts, worth = [], [], [], rule.worth

    def noted(self, scene, known, pose):
        poses.append(pose)
        worths.append(worth(self, scene, known, pose))
        counts.append(self.seen.counts.copy())
        return worths[-1]

    monkeypatch.setattr(rule, "worth", noted)
    missions, strategy = missions_of(robot={"reach_m": math.inf}), rule()
    (_, chosen) = play(missions, strategy, 2)[1]
    assert len(poses) == (1 if rule is RandomKnown else 100)
    np.testing.assert_array_equal(chosen, poses[int(np.argmax(worths))])
    if rule in COUNTED:
        row, sign = COUNTED[rule]
        assert worths == [sign * count[row] for count in counts] and max(c[1] for c in counts) > 100
    poses.clear()
    view = view_of(missions, 0, 0)
    for _ in range(2):  # the second time there is nothing new in the map
        strategy.forget_goal(view)
        strategy.choose(view)
    assert (len(poses) <= 100) == (rule in COUNTED or rule is RandomKnown)


@pytest.mark.parametrize(
    "name", ["next-best-view", "most-unmapped", "least-mapped", "random-known", "raster"]
)
def test_every_method_maps_with_and_without_a_reach_and_with_a_teammate(name):
    for settings in ({}, {"robot": {"reach_m": math.inf}}, {"robots": 2}):
        missions = missions_of(**settings)
        chosen = play(missions, make_strategy(name), 40)
        clock = missions.state.missions[0]
        assert clock["explored_visible"] / clock["visible"] > 0.1
        assert len({tuple(viewpoint) for _, viewpoint in chosen}) > 10
