"""Robots that change their mind while they drive keep to their limits, and out of walls and bodies."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.missions.poses import pose_at, speed_at
from entropy_explore_env.missions.view import view_of
from tests.reference.scenes import build, drawn, free_box, random_actions, seeds, started

SAMPLES = 9
"""Moments of each step at which poses are looked at."""


class Motions:
    """Looks at robots' poses between decisions: do they keep to the limits, and out of what is solid."""

    def __init__(self, missions):
        self.missions = missions
        self.last = self.motions(0.0)
        self.time_s = 0.0

    def motions(self, time_s):
        """(A, 4): places and speeds."""
        params, robots = self.missions.rules.params, self.missions.state.robots[0]
        pairs = list(zip(params, robots, strict=True))
        return np.array([(*pose_at(p, r, time_s)[:3], speed_at(p, r, time_s)) for p, r in pairs])

    def check(self, decided):
        """After a step in which the robots `decided`."""
        missions = self.missions
        now_s, robots = float(missions.state.missions[0]["time_s"]), missions.state.robots[0]
        settings = missions.scenario.robot
        gap_s = (now_s - self.time_s) / SAMPLES
        for sample in range(SAMPLES + 1):
            time_s = now_s if sample == SAMPLES else self.time_s + sample * gap_s
            motions, passed_s = self.motions(time_s), gap_s if sample else 0.0
            moved_m = np.linalg.norm((motions - self.last)[:, :3], axis=1)
            assert (moved_m <= settings.max_speed_m_s * passed_s + 1e-6).all()
            changed = np.abs(motions - self.last)[:, 3]
            assert (motions[:, 3] <= settings.max_speed_m_s + 1e-9).all()
            assert (changed <= settings.acceleration_m_s2 * passed_s + 1e-4).all()
            self.outside_of_solid(motions[:, :3])
            self.last = motions
        assert (robots["decided_s"][decided] == self.time_s).all()
        assert ((robots["decided_s"] < now_s) | ~robots["deciding"]).all()  # time has passed since
        self.time_s = now_s

    def outside_of_solid(self, places):
        missions = self.missions
        voxels = missions.grid.voxel_of(places)
        truth = missions.state.truth[0].reshape(missions.grid.shape)
        for voxel, place in zip(voxels, places, strict=True):
            faces = np.abs(np.mod(place / 0.5 + 0.5, 1.0) - 0.5) * 0.5
            assert faces.min() < 1e-6 or truth[tuple(voxel)] == 0.0, place
        apart = np.linalg.norm(places[0] - places[1])
        assert apart >= 2.0 * missions.scenario.robot.body_radius_m - 1e-6


MOVERS = {
    "flying": {"reach_m": 2.0},
    "flying by plan": {"reach_m": math.inf, "navigator": "planned"},
    "planar": {"motion": "planar", "sensor_height_m": 0.75, "reach_m": 2.0},
    "planar by plan": {"motion": "planar", "sensor_height_m": 0.75, "reach_m": 4.0, "navigator": "planned"},
}


@drawn(40)
@given(
    seeds,
    st.sampled_from(sorted(MOVERS)),
    st.sampled_from(["on_scan", 0.2, 0.9]),
    st.sampled_from([None, 0.35]),
)
def test_robots_that_change_their_mind_keep_to_their_limits_and_out_of_walls_and_bodies(
    seed, mover, redecide, period_s
):
    rng = np.random.default_rng(seed)
    scenario = free_box(
        robot={**MOVERS[mover], "redecide": redecide, "body_radius_m": 0.2},
        sensor={"scan_every_m": 0.4, "scan_time_s": 0.2},
        ending={"sigma_end": 1e-4},
        decision_period_s=period_s,
    )
    missions = started(scenario, seed=seed)
    solid = rng.random(scenario.grid.shape) < 0.08
    for robot in missions.state.robots[0]:
        solid[tuple(missions.grid.voxel_of(robot["goal"][:3]))] = False
    build(missions, solid)
    motions = Motions(missions)
    robots = missions.state.robots[0]
    for _ in range(50):
        boxes, numbers = random_actions(missions, rng)
        for robot in range(2):
            view = view_of(missions, 0, robot)
            if view.under_way and rng.random() < 0.5:
                boxes[0, robot] = view.action_for(view.target)
        decided = robots["deciding"].copy()
        missions.step(boxes, numbers)
        motions.check(decided)
