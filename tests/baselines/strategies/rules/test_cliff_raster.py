"""Raster scanning above a cliff: where rovers look."""

from __future__ import annotations

import math

from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import make_strategy
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import CLIFF

QUICK = {"sensor": {"angular_step_rad": math.pi / 60}, "robot": {"reach_m": math.inf}}


def test_raster_without_yaw_looks_along_x_and_with_yaw_all_around():
    for name, yaws in (("cliff-raster-fixed-yaw", {0.0}), ("cliff-raster", {0.0, 90.0, 180.0, 270.0})):
        env = scripted_env(with_settings(CLIFF, {**QUICK, "max_cycles": 14}))
        found = []

        def note(env, found=found):
            found.append(round(math.degrees(env.missions.state.robots[0, 0]["origin"][3]), 3) % 360.0)

        run_mission(env, make_strategy(name), 1, note)
        assert set(found[6:]) == yaws, name
