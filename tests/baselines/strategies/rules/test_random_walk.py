"""The strategy `random`: a viewpoint of its own for each view."""

from __future__ import annotations

import numpy as np

from baselines.strategies.protocol import random_viewpoint
from baselines.strategies.rules.random_walk import RandomWalk
from entropy_explore_env.missions.view import view_of
from tests.reference.scenes import free_box, started


def test_each_view_gets_a_viewpoint_of_its_own_from_the_stream():
    missions = started(free_box(robots=3))
    views = [view_of(missions, 0, robot) for robot in range(3)]
    walk = RandomWalk()
    walk.reset(missions.scenario, np.random.default_rng(4))
    ours, rng = [walk.choose(view) for view in views], np.random.default_rng(4)
    assert [a.tolist() for a in ours] == [random_viewpoint(view, rng).tolist() for view in views]
    walk.reset(missions.scenario, np.random.default_rng(4))
    assert [walk.choose(view).tolist() for view in views[:2]] == [a.tolist() for a in ours[:2]]
