"""Features of candidates against a slow reference, in the small box with two robots that drive straight."""

import math

import numpy as np
import pytest

from entropy_explore_env import EntropyExploreVectorEnv
from entropy_explore_env.belief.visibility import CONE, cone_of
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.planner.candidate_features import COLUMNS, CONTEXT, CONTEXT_COLUMNS, FEATURES
from entropy_explore_env.planner.memory import trust_in
from entropy_explore_env.planner.recipe import recipe_for
from entropy_explore_env.planner.records import Kind
from tests.reference import rocha04
from tests.reference.candidate_views import Map, remaining_blocks, slivers, view_from

MOST = 12
MARGIN_BITS = 1e-5


class Moment:
    """A robot's decision: its candidates' features, and all that the reference needs."""

    def __init__(self, env, observations, mission, robot):
        missions = env.missions
        state, scenario = missions.state, missions.scenario
        grid, kind = scenario.grid, scenario.kind_of(robot)
        self.grid, self.kind, self.recipe = grid, kind, recipe_for(scenario, kind)
        self.rows = observations["candidates"][mission, robot].astype(float)
        self.context = observations["context"][mission, robot].astype(float)
        self.overlaps = observations["overlaps"][mission, robot].astype(float)
        candidates = state.candidates[mission, robot]
        self.count = int((candidates["kind"] != Kind.NONE).sum())
        self.kinds = candidates["kind"][: self.count].copy()
        self.goals = candidates["goal"][: self.count].copy()
        given = candidates["viewpoint"][: self.count]
        self.viewpoints = np.stack([grid.in_grid_units(viewpoint) for viewpoint in given])
        self.experience = state.experience[mission, robot].copy()
        own = state.robots[mission, robot]
        self.here, self.time_s = grid.in_grid_units(own["goal"]), float(state.missions[mission]["time_s"])
        self.gained, self.reported = float(own["gained_bits"]), float(own["heard_bits"])
        shape, here = grid.shape, (mission, robot)
        prior = float(np.float32(scenario.sigma_prior**-2))
        self.map = Map(
            state.mean[here].reshape(shape).copy(),
            state.precision[here].reshape(shape).copy(),
            prior,
            grid.voxel_size_m,
            self.recipe.stop_probability,
        )
        self.mates, self.cones = [], []
        for mate, heard in view_of(missions, mission, robot).teammates.items():
            if heard.heard_s >= 0.0 and not heard.silent:
                self.mates.append((mate, grid.in_grid_units(heard.pose)))
            if heard.announced_s >= 0.0 and heard.depth_m > 0.0:
                cone = np.zeros((), CONE)
                radius = heard.depth_m / grid.voxel_size_m
                cone[...] = cone_of(grid.in_grid_units(heard.viewpoint), radius, heard.half_angle_rad)
                self.cones.append(cone)
        self.views = [view_from(self.map, kind.sensor, at, self.cones) for at in self.goals]
        self.blocks = remaining_blocks(self.map, scenario.ending.sigma_end**-2, self.block_edge)

    @property
    def block_edge(self):
        return max(1, round(self.recipe.block_m / self.grid.voxel_size_m))

    def column(self, name):
        return self.rows[: self.count, COLUMNS[name]]

    def about(self, name):
        return self.context[CONTEXT_COLUMNS[name]]

    @property
    def clear_cut(self):
        """Whether rounding decides of no voxel whether it is seen."""
        return min(view.margin for view in self.views) > MARGIN_BITS

    def seconds(self, goal, pose, robot, scan_time_s, turning=True):
        length_m = float(np.linalg.norm(goal[:3] - pose[:3])) * self.grid.voxel_size_m
        drive_s = rocha04.drive_s(length_m, robot.max_speed_m_s, robot.acceleration_m_s2)
        turns = (goal[3] - pose[3] + math.pi) % (2 * math.pi) - math.pi, goal[4] - pose[4]
        turn_s = max(map(abs, turns)) / robot.turn_rate_rad_s if turning else 0.0
        return max(drive_s, turn_s) + scan_time_s


@pytest.fixture(scope="module")
def moments():
    """Decisions with few candidates far away: paths are those of straight lines."""
    env = EntropyExploreVectorEnv(
        "box-7x11x5",
        2,
        robots=3,
        decision_period_s=None,
        action={"kind": "candidates", "candidates": MOST},
        observation={"action_mask": True, "overlaps": True},
        channel={"i_min_bits": 0.01},
    )
    observations, _ = env.reset(seed=11)
    rng, found = np.random.default_rng(2), []
    for step in range(36):
        observations, _, ended, cut, _ = env.step(rng.integers(0, MOST, (2, 3)))
        if (ended | cut).any():
            break
        if step % 3 == 2:
            for mission, robot in np.argwhere(env.missions.state.robots["deciding"]):
                found.append(Moment(env, observations, int(mission), int(robot)))
    assert len(found) > 10 and any(moment.cones for moment in found)
    return [moment for moment in found if moment.clear_cut]


def test_there_are_moments_to_look_at(moments):
    assert len(moments) > 8
    assert any(Kind.NEAR in moment.kinds and Kind.SPOT in moment.kinds for moment in moments)


def test_bits_and_seconds_are_those_of_the_reference(moments):
    compared = 0
    for moment in moments:
        bits = np.array([view.bits for view in moment.views])
        trusted = np.array([trust_in(moment.experience, False, goal) for goal in moment.goals])
        scan_time_s = moment.kind.sensor.scan_time_s
        seconds = np.array(
            [moment.seconds(goal, moment.here, moment.kind.robot, scan_time_s) for goal in moment.goals]
        )
        there = moment.column("seconds") < 1.0  # else it is where to go when nothing is left
        near = there & (moment.kinds != Kind.FAR)
        worth = np.where(there, bits * trusted, 0.0)
        np.testing.assert_allclose(moment.column("bits_log") * 20.0, np.log2(1.0 + worth), rtol=1e-4)
        given = moment.column("seconds")
        np.testing.assert_allclose(given[near], (seconds / (seconds + 10.0))[near], rtol=1e-5)
        fewest = 10.0 * given.min() / (1.0 - given.min())
        np.testing.assert_allclose(moment.column("soonness")[near], fewest / seconds[near], rtol=1e-4)
        compared += int(near.sum())
    assert compared > 100


def test_what_candidates_see_is_what_the_reference_sees(moments):
    for moment in moments:
        seen = [view.seen for view in moment.views]
        counts = {voxel: sum(voxel in each for each in seen) for each in seen for voxel in each}
        diagonal = float(np.linalg.norm(moment.grid.shape))
        longest = min(moment.kind.sensor.max_range_m / moment.grid.voxel_size_m, diagonal)
        expected = {name: [] for name in ("unique", "common", "slivers", "unknown", "depth", "again")}
        for k, (view, goal) in enumerate(zip(moment.views, moment.goals, strict=True)):
            n = max(len(view.seen), 1)
            expected["unique"].append(sum(1.0 / counts[voxel] for voxel in view.seen) / n)
            expected["common"].append(1.0 if k == 0 else len(view.seen & seen[0]) / n)
            expected["slivers"].append(min(slivers(moment.map, view.seen) / n, 1.0))
            unknown = sum(moment.map.precision[voxel] < 2.0 * moment.map.prior for voxel in view.seen)
            expected["unknown"].append(unknown / n)
            away = sum(math.dist(goal[:3], np.array(voxel) + 0.5) for voxel in view.seen)
            expected["depth"].append(min(away / n / longest, 1.0))
            expected["again"].append(view.again_bits / view.bits if view.bits > 0.0 else 0.0)
        for name, values in expected.items():
            np.testing.assert_allclose(moment.column(name), values, atol=2e-4, err_msg=name)
        for k in range(moment.count):
            for other in range(k):
                fewer = max(min(len(seen[k]), len(seen[other])), 1)
                share = len(seen[k] & seen[other]) / fewer
                assert moment.overlaps[k, other] == pytest.approx(share, abs=1e-6)


def test_candidates_differ_in_what_they_see(moments):
    for moment in moments:
        apart = moment.overlaps[1 : moment.count, 1 : moment.count] - np.eye(moment.count - 1)
        assert apart.max(initial=0.0) <= 0.9 + 1e-6


def test_the_announced_view_that_shares_most_is_compared(moments):
    shared_any = 0.0
    for moment in moments:
        for k, view in enumerate(moment.views):
            most = max(view.shared_bits, default=0.0) / view.all_bits if view.all_bits > 0.0 else 0.0
            given = moment.column("announced_most")[k]
            assert given == pytest.approx(most, abs=2e-4)
            shared_any = max(shared_any, given)
    assert shared_any > 0.05


def test_places_are_described_as_the_reference_does(moments):
    for moment in moments:
        diagonal, edge = float(np.linalg.norm(moment.grid.shape)), moment.block_edge
        total = sum(moment.blocks.values())
        for k, (goal, at) in enumerate(zip(moment.goals, moment.viewpoints, strict=True)):
            if moment.kinds[k] == Kind.FAR:
                continue
            block = np.array(goal[:3]).astype(int) // edge
            near = sum(b for i, b in moment.blocks.items() if np.abs(np.array(i) - block).max() <= 1)
            assert moment.column("elsewhere")[k] == pytest.approx(1.0 - near / total, abs=1e-5)
            away = sum(b * math.dist((np.array(i) + 0.5) * edge, goal[:3]) for i, b in moment.blocks.items())
            straight = float(np.linalg.norm(goal[:3] - moment.here[:3]))
            expected = max(-1.0, min(1.0, (away / total - straight) / diagonal))
            assert moment.column("advantage")[k] == pytest.approx(expected, abs=1e-5)
            assert moment.column("directness")[k] == pytest.approx(1.0)
            assert moment.column("distance")[k] == pytest.approx(straight / diagonal, abs=1e-6)
            assert moment.column("turn_cos")[k] == pytest.approx(math.cos(at[3] - moment.here[3]), abs=1e-5)


def test_the_nearest_teammate_s_time_is_compared(moments):
    heard = 0
    for moment in moments:
        robot, scan_s = moment.kind.robot, moment.kind.sensor.scan_time_s
        for k, goal in enumerate(moment.goals):
            own = moment.column("seconds")[k]
            if own >= 1.0 or moment.kinds[k] == Kind.FAR:
                continue
            own_s = 10.0 * own / (1.0 - own)
            theirs = [moment.seconds(goal, pose, robot, scan_s, turning=False) for _, pose in moment.mates]
            expected = (min(theirs) - own_s) / (min(theirs) + own_s) if theirs else 1.0
            assert moment.column("contest")[k] == pytest.approx(expected, abs=1e-4)
            heard += len(theirs)
    assert heard


def test_flags_and_scores_say_which_comes_first(moments):
    for moment in moments:
        np.testing.assert_array_equal(moment.column("spot"), moment.kinds == Kind.SPOT)
        np.testing.assert_array_equal(moment.column("far"), moment.kinds == Kind.FAR)
        np.testing.assert_array_equal(moment.column("chosen"), np.eye(1, moment.count)[0])
        score = moment.column("score")
        assert score[0] == 1.0 and score[1:].max(initial=0.0) <= 0.99 + 1e-6
        assert not moment.rows[moment.count :].any()


def test_the_context_says_what_is_true_of_all(moments):
    for moment in moments:
        assert moment.about("time") == pytest.approx(moment.time_s / (moment.time_s + 300.0), rel=1e-5)
        bits = moment.gained + moment.reported
        share = moment.reported / bits if bits > 0.0 else 0.0
        assert moment.about("reported") == pytest.approx(share, abs=1e-5)
        assert moment.about("mates") == pytest.approx(0.5)
        assert moment.about("heard") == pytest.approx(len(moment.mates) / 2)
        assert moment.about("under_way") == 0.0
        block = np.array(moment.here[:3]).astype(int) // moment.block_edge
        near = sum(b for i, b in moment.blocks.items() if np.abs(np.array(i) - block).max() <= 1)
        assert moment.about("around") == pytest.approx(near / sum(moment.blocks.values()), abs=1e-5)
        assert len(FEATURES) == moment.rows.shape[1]


@pytest.mark.parametrize(("table", "columns"), [(FEATURES, COLUMNS), (CONTEXT, CONTEXT_COLUMNS)])
def test_columns_number_the_names_of_the_table(table, columns):
    assert [columns[feature.name] for feature in table] == list(range(len(table)))
    assert all(feature.meaning and feature.least in (-1.0, 0.0) for feature in table)
