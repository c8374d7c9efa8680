"""Whole missions: against the slow reference, and what must hold in every step of any mission."""

import itertools
import math
import pickle

import numpy as np
import pytest

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.errors import ActionError, CallOrderError, SettingError
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.tick import step_missions
from entropy_explore_env.reports.recording import poses_now
from entropy_explore_env.robots.range_sensor import Return
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import ROOM
from tests.reference import rocha04
from tests.reference.scenes import ENDLESS, NO_PARTS, as_arrays, free_box, random_actions, started, wander

# --- A mission of the reference


class SlowMission:
    """A mission at instants of the library's clock, computed by the reference from poses alone."""

    def __init__(self, missions):
        self.scenario, self.missions = missions.scenario, missions
        self.size = missions.grid.shape
        self.truth = missions.state.truth[0].reshape(self.size) > 0.5
        prior = (0.5, self.scenario.sigma_prior)
        robots = range(self.scenario.robots)
        self.beliefs = [dict.fromkeys(np.ndindex(*self.size), prior) for _ in robots]
        sensor = self.scenario.sensor
        self.numbers = rocha04.Sensor(missions.grid.voxel_size_m, sensor.sigma_min, sensor.sigma_slope_per_m)
        self.sent = [0 for _ in robots]

    def grid_units(self, place_m):
        return (np.asarray(place_m) - self.missions.grid.origin_m) / self.missions.grid.voxel_size_m

    def gazes(self, pose):
        """Yaw and pitch of every ray, column by column."""
        sensor = self.scenario.sensor
        angles = [
            pose[3 + axis] + (np.arange(count) - (count - 1) / 2) * sensor.angular_step_rad
            for axis, count in enumerate((sensor.columns, sensor.rows))
        ]
        return list(itertools.product(*angles))

    def where(self, robot, time_s):
        """A robot's place in grid units: its drive by the integrated trapezoid."""
        own, pace = self.missions.state.robots[0, robot], self.scenario.robot
        origin, goal, since = own["origin"][:3], own["goal"][:3], time_s - own["depart_s"]
        length, limits = math.dist(origin, goal), (pace.max_speed_m_s, pace.acceleration_m_s2)
        if since >= rocha04.drive_s(length, *limits):
            return self.grid_units(goal)
        share = rocha04.way_at_m(since, length, *limits, steps=400) / length
        return self.grid_units(origin + share * (goal - origin))

    def scan(self, robot, time_s):
        """What a robot that stands at its goal measures: rays' ends, voxels and lengths."""
        pose, sensor = self.missions.state.robots[0, robot]["goal"], self.scenario.sensor
        start, radius = (
            self.grid_units(pose[:3]),
            self.scenario.robot.body_radius_m / self.numbers.voxel_size_m,
        )
        mates = [self.where(mate, time_s) for mate in range(self.scenario.robots) if mate != robot]
        rays = []
        for gaze in self.gazes(pose):
            direction, longest = rocha04.gaze(*gaze), sensor.max_range_m / self.numbers.voxel_size_m
            assert rocha04.is_generic(start, direction, self.size, longest, 1e-9), "take another seed"
            ray = rocha04.trace(
                lambda v: self.truth[v], start, direction, self.size, longest, sensor.voxels_behind
            )
            bodies = [rocha04.distance_to_ball(start, direction, mate, radius) for mate in mates]
            hidden = radius > 0.0 and min(bodies, default=math.inf) < ray.length
            code = Return.NOTHING if hidden else Return.FREE if ray.end == rocha04.OPEN else Return.HIT
            rays.append((code, ray))
        return start, rays

    def fuse(self, robot, start, code, ray):
        range_m = ray.length * self.numbers.voxel_size_m
        return rocha04.integrate(
            self.beliefs[robot], ray.voxels, start, range_m, code == Return.HIT, self.numbers
        )

    def arrive(self, robot, time_s):
        """A robot scans, fuses and shares; compares the rays with the library's."""
        state, channel = self.missions.state, self.scenario.channel
        start, rays = self.scan(robot, time_s)
        assert state.scan_returned[0, robot].tolist() == [code for code, _ in rays]
        measured = [code != Return.NOTHING for code, _ in rays]
        ranges = [ray.length * self.numbers.voxel_size_m for _, ray in rays]
        assert state.scan_range_m[0, robot][measured] == pytest.approx(np.array(ranges)[measured], rel=1e-9)
        utility = [self.fuse(robot, start, code, ray) if code else -1.0 for code, ray in rays]
        ours = np.where(measured, state.scan_utility_bits[0, robot], -1.0)
        assert ours == pytest.approx(utility, rel=2e-5, abs=2e-5)
        chosen = rocha04.select(ours.tolist(), channel.burst, channel.i_min_bits)
        assert rocha04.is_valid_selection(ours.tolist(), chosen, channel.burst, channel.i_min_bits)
        self.sent[robot] += len(chosen)
        for mate in range(self.scenario.robots):
            if mate != robot:
                for ray in chosen:
                    self.fuse(mate, start, *rays[ray])


REFERENCE_CASES = {
    "empty": {"robots": 2},
    "furnished": {"robots": 3, "world": "furnished", "robot": {"body_radius_m": 0.2}},
    "short": {"robots": 2, "sensor": {"max_range_m": 1.1, "voxels_behind": 0}, "channel": {"burst": 30}},
    "planar": {
        "robots": 2,
        "world": "furnished",
        "robot": {"motion": "planar", "sensor_height_m": 0.6},
        "sensor": {"voxels_behind": 2},
        "channel": {"i_min_bits": 20.0, "burst": 5},
    },
    "flat": {
        "robots": 3,
        "world": "furnished",
        "grid": Grid((13, 9, 1), 0.4, (-1.0, 0.3, 0.0)),
        "sensor": {"field_of_view_rad": (math.pi, 0.0)},
        "channel": {"i_min_bits": 5.0},
    },
}


@pytest.mark.parametrize("case", REFERENCE_CASES)
def test_a_mission_is_what_the_reference_computes(case):
    """Scans, utilities, selections and all beliefs, from the poses and the truth alone."""
    missions = started(free_box(**REFERENCE_CASES[case], ending=ENDLESS), seed=2)
    slow, rng, batches = SlowMission(missions), np.random.default_rng(1), 0
    robots = missions.state.robots[0]
    for _ in range(30):
        scans = robots["scans"].copy()
        missions.step(*random_actions(missions, rng))
        time_s = missions.state.missions[0]["time_s"]
        for robot in np.flatnonzero(robots["scans"] > scans):
            assert robots["ready_s"][robot] == time_s
            slow.arrive(int(robot), time_s)
            batches += 1
    assert batches >= 30
    assert robots["measurements_sent"].tolist() == slow.sent
    assert min(slow.sent) > 0
    for robot, beliefs in enumerate(slow.beliefs):
        mean, precision = as_arrays(beliefs, missions.grid.shape)
        np.testing.assert_allclose(missions.mean[0, robot], mean, atol=5e-5)
        np.testing.assert_allclose(missions.precision[0, robot], precision, rtol=1e-4)
        entropy = rocha04.map_entropy_bits(sigma for _, sigma in beliefs.values())
        assert robots["entropy_bits"][robot] == pytest.approx(entropy, abs=0.01)


# --- Invariants

INVARIANT_CASES = {
    "events": {"robots": 3},
    "individual": {"robots": 2, "reward": {"kind": "individual"}},
    "period": {"robots": 4, "decision_period_s": 0.75, "world": "furnished"},
    "late": {"robots": 3, "decision_period_s": 0.5, "channel": {"delay_s": 1.3}},
    "lossy": {"robots": 3, "channel": {"loss_probability": 0.4, "range_m": 2.5}},
    "noisy": {"robots": 2, "sensor": {"range_noise_m": 0.2, "max_range_m": 1.5, "voxels_behind": 3}},
    "team": {"robots": 2, "reward": {"kind": "team", "cost_per_s": 1e-3}, "world": "furnished"},
    "alone": {"robots": 1, "decision_period_s": 2.0},
    "no announcements": {"robots": 2, "channel": {"announcements": False, "burst": 3}},
    "no sharing": {"robots": 2, "channel": {"burst": 0}},
    "big bodies": {"robots": 5, "robot": {"body_radius_m": 0.3}, "decision_period_s": 0.5},
    "flat": {
        "robots": 3,
        "world": "furnished",
        "grid": Grid((13, 9, 1), 0.4, (-1.0, 0.3, 0.0)),
        "sensor": {"field_of_view_rad": (2.0, 0.0)},
    },
    "discrete": {"robots": 2, "action": {"kind": "discrete"}, "robot": {"motion": "planar"}},
}


class Watch:
    """Looks at a mission before and after each step, and complains."""

    def __init__(self, missions):
        self.missions, self.channel = missions, missions.scenario.channel
        self.mates = missions.scenario.robots - 1
        self.announcements = np.zeros(self.mates + 1, int)
        self.batches = np.zeros(self.mates + 1, int)
        self.gained = np.zeros(self.mates + 1)
        self.remember()

    def remember(self):
        state = self.missions.state
        self.mean, self.precision = state.mean[0].copy(), state.precision[0].copy()
        self.robots, self.clock = state.robots[0].copy(), state.missions[0].copy()

    def check(self, _step):
        self.beliefs()
        self.rewards()
        self.clocks()
        self.sharing()
        self.remember()

    def beliefs(self):
        state, robots = self.missions.state, self.missions.state.robots[0]
        assert (state.precision[0] >= self.precision).all()
        assert np.isfinite(state.precision[0]).all()
        assert ((state.mean[0] >= 0.0) & (state.mean[0] <= 1.0)).all()
        assert (robots["entropy_bits"] <= self.robots["entropy_bits"]).all()
        assert (robots["own_bits"] >= 0.0).all()
        assert (robots["received_bits"] >= 0.0).all()
        self.gained += robots["own_bits"] + robots["received_bits"]
        start = state.missions[0]["entropy_start_bits"]
        assert start - robots["entropy_bits"] == pytest.approx(self.gained, abs=1e-6)
        full = map_entropy_bits(self.missions.precision[0])
        assert robots["entropy_bits"] == pytest.approx(full, rel=1e-6, abs=1e-6 * start)
        unchanged = (state.precision[0] == self.precision) & (state.mean[0] != self.mean)
        assert not unchanged.any()  # what no ray crossed keeps its mean, too

    def rewards(self):
        state, settings = self.missions.state, self.missions.scenario.reward
        robots, clock = state.robots[0], state.missions[0]
        cost = settings.cost_per_s * (clock["time_s"] - self.clock["time_s"])
        gained = robots["own_bits"].copy()
        if settings.kind == "team":
            gained[:] = (self.robots["entropy_bits"] - robots["entropy_bits"]).mean()
        expected = gained / (clock["entropy_start_bits"] - clock["entropy_end_bits"]) - cost
        assert robots["reward"] == pytest.approx(expected, rel=1e-9, abs=1e-12)

    def clocks(self):
        state, period = self.missions.state, self.missions.scenario.decision_period_s
        robots, clock = state.robots[0], state.missions[0]
        assert clock["end"] == MissionEnd.RUNNING.code
        assert clock["cycles"] == self.clock["cycles"] + 1
        if period is not None:
            assert clock["time_s"] == self.clock["time_s"] + period
        else:
            assert clock["time_s"] == robots["ready_s"][robots["deciding"]].max()
            assert (robots["ready_s"][~robots["deciding"]] > clock["time_s"]).all()
            assert robots["deciding"].any()
        assert (robots["deciding"] == (robots["ready_s"] <= clock["time_s"])).all()
        departed = self.robots["deciding"]
        assert (robots["depart_s"][departed] == self.clock["time_s"]).all()
        for field in ("origin", "goal", "depart_s", "target"):
            assert (robots[field][~departed] == self.robots[field][~departed]).all()
        longest = robots["ready_s"] - robots["depart_s"]
        assert (longest >= self.missions.scenario.sensor.scan_time_s).all()
        assert (
            robots["departed_m"] == np.where(departed, self.robots["distance_m"], self.robots["departed_m"])
        ).all()
        driven_m = np.linalg.norm(poses_now(self.missions, 0)[:, :3] - robots["origin"][:, :3], axis=1)
        assert robots["distance_m"] == pytest.approx(robots["departed_m"] + driven_m, abs=1e-9)
        assert (robots["scans"] - self.robots["scans"])[robots["deciding"]].tolist() == [1] * robots[
            "deciding"
        ].sum()

    def sharing(self):
        state, robots = self.missions.state, self.missions.state.robots[0]
        scanned = robots["scans"] > self.robots["scans"]
        sent = robots["measurements_sent"] - self.robots["measurements_sent"]
        assert (sent[~scanned] == 0).all()
        for robot in np.flatnonzero(scanned):
            returned, bits = state.scan_returned[0, robot], state.scan_utility_bits[0, robot]
            measured = returned != Return.NOTHING
            assert (bits[~measured] == 0.0).all()
            assert (bits[measured] >= 0.0).all()
            more = robots["measurements"][robot] - self.robots["measurements"][robot]
            assert more == measured.sum()
            worth = (bits[measured] >= self.channel.i_min_bits).sum()
            assert sent[robot] == (min(self.channel.burst, worth) if self.mates else 0)
            assert robots["scan_pose"][robot].tolist() == robots["goal"][robot].tolist()
        if self.mates:
            self.batches += sent > 0
            self.announcements += self.robots["deciding"] & self.channel.announcements
        assert (robots["messages_sent"] == self.batches + self.announcements).all()
        cost = 96 * robots["measurements_sent"] + 160 * self.batches + 384 * self.announcements
        assert (robots["bits_sent"] == cost).all()
        self.receiving(robots)

    def receiving(self, robots):
        """Every message is heard once by each teammate, lost, out of range, or still under way."""
        waiting = sum(
            state["due_s"] < math.inf and to
            for state, row in zip(
                self.missions.state.in_flight[0], self.missions.state.in_flight_to[0], strict=True
            )
            for to in row
        )
        arrived = robots["messages_received"].sum()
        missed = robots["messages_lost"].sum() + robots["messages_out_of_range"].sum()
        assert arrived + missed + waiting == self.mates * robots["messages_sent"].sum()
        if missed + waiting == 0:
            for counted in ("messages", "measurements", "bits"):
                sent, received = robots[f"{counted}_sent"], robots[f"{counted}_received"]
                assert received.tolist() == (sent.sum() - sent).tolist()
        assert (robots["bits_received"] >= 96 * robots["measurements_received"]).all()


@pytest.mark.parametrize("case", INVARIANT_CASES)
def test_what_holds_in_every_step_of_a_mission(case):
    settings = {**INVARIANT_CASES[case], "ending": ENDLESS}
    missions = started(free_box(**settings), seed=11)
    watch = Watch(missions)
    wander(missions, 60, 7, watch.check)
    robots = missions.state.robots[0]
    assert (robots["scans"] > 5).all()
    if case == "lossy":
        assert robots["messages_lost"].min() > 0
        assert robots["messages_out_of_range"].max() > 0
    if case == "late":
        assert robots["messages_received"].min() > 0


def test_the_carried_entropy_agrees_with_the_map_after_a_million_updates():
    room = {"robots": 2, "observation": NO_PARTS, "decision_period_s": None, "ending": ENDLESS}
    missions = started(with_settings(ROOM, room))
    updates, rng = 0.0, np.random.default_rng(0)
    robots, ranges = missions.state.robots[0], missions.state.scan_range_m[0]
    bits = np.zeros(2)
    while updates < 1e6:
        scans = robots["scans"].copy()
        missions.step(*random_actions(missions, rng))
        bits += robots["own_bits"] + robots["received_bits"]
        # A voxel holds at most √3 edges of a ray.
        updates += sum(ranges[r].sum() for r in np.flatnonzero(robots["scans"] > scans)) / (0.25 * 3**0.5)
        assert missions.over(0) is MissionEnd.RUNNING
    full = map_entropy_bits(missions.precision[0])
    assert robots["entropy_bits"] == pytest.approx(full, rel=1e-6)
    start = missions.state.missions[0]["entropy_start_bits"]
    assert start - robots["entropy_bits"] == pytest.approx(bits, abs=1e-6)
    assert (np.abs(full) > 1000.0).all()  # relative to something


def test_the_scratch_space_holds_the_farthest_drive():
    """Compiled code does not check: numbers written beyond its end destroy what lies there."""
    sensor = {"max_range_m": 0.3, "field_of_view_rad": (0.0, 0.0)}
    missions = Missions(free_box(robot={"reach_m": math.inf}, sensor=sensor))
    needed = longest_crossing(*missions.grid.shape, math.inf, 1)
    for work in missions._compiled_step.work:
        assert min(len(work.drive.voxels), len(work.drive.entered)) >= needed


def test_steps_before_a_reset_and_counts_that_are_none():
    with pytest.raises(CallOrderError, match="step before reset"):
        wander(Missions(free_box()), 1, 0)
    for count in (0, -1, 1.5, True, "2"):
        with pytest.raises(SettingError, match=r"missions = .*: expected a whole number ≥ 1"):
            Missions(free_box(), count)
    for threads in (0, -1, 1.5, True, "2", 1025, 10**39):
        with pytest.raises(SettingError, match=r"threads = .*: expected None, or a whole number from 1"):
            Missions(free_box(), 1, threads)


def test_read_only_and_other_kinds_of_actions_need_no_other_kernel():
    """A step is compiled for one kind of array; what else is given is copied."""
    missions, twin = started(free_box(), seed=3), started(free_box(), seed=3)
    continuous = np.random.default_rng(0).uniform(-1.0, 1.0, (1, 2, 5))
    discrete = np.zeros((1, 2), np.int64)
    for _ in range(3):
        missions.step(continuous, discrete)
    compiled = len(step_missions.signatures)
    shown = np.broadcast_to(continuous, continuous.shape)
    assert not shown.flags.writeable
    for _ in range(3):
        twin.step(shown, np.broadcast_to(discrete.astype(np.int32), discrete.shape))
    assert len(step_missions.signatures) == compiled
    np.testing.assert_array_equal(missions.state.mean, twin.state.mean)
    with pytest.raises(ActionError, match="actions"):
        missions.step(continuous[0], discrete)
    with pytest.raises(ActionError, match="actions"):
        missions.step(continuous, discrete[:, :1])


def test_a_step_goes_on_with_arrays_that_were_replaced():
    """A step is bound to its arrays; a world with a ceiling replaces one, and pickling all."""
    missions = started(free_box(), seed=3)
    twin = started(free_box(), seed=3)
    wander(missions, 2, 1)
    wander(twin, 2, 1)
    missions.state = missions.state._replace(mean=missions.state.mean.copy())
    again = pickle.loads(pickle.dumps(missions))
    for each in (missions, again, twin):
        wander(each, 3, 2)
    np.testing.assert_array_equal(missions.state.mean, twin.state.mean)
    np.testing.assert_array_equal(again.state.mean, twin.state.mean)
    np.testing.assert_array_equal(again.observations, twin.observations)
