"""Every part of an observation against slow NumPy, from the state after steps of random actions."""

import math

import numpy as np
import pytest

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.missions.poses import pose_at
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.settings.ending import gaussian_entropy_bits
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.observation import MOST_PREDICTED
from entropy_explore_env.viewpoints.evaluation import robot_model
from tests.reference import rocha04
from tests.reference.scenes import as_reference, free_box, put, random_actions, started, wander

EVERYTHING = {
    "panorama": True,
    "drive": True,
    "patch": True,
    "patch_shape": (5, 7, 3),
    "overview": True,
    "overview_shape": (3, 4, 2),
    "prediction": True,
    "prediction_shape": (5, 9),
    "action_mask": True,
}
SETTINGS = {
    "three robots": {"robots": 3, "observation": EVERYTHING},
    "furnished": {
        "world": "furnished",
        "robots": 2,
        "sensor": {"max_range_m": 1.3, "voxels_behind": 2},
        "observation": {**EVERYTHING, "panorama_utility": "log2", "panorama_pitches": 5},
    },
    "flat": {
        "grid": Grid((13, 9, 1), 0.5, (-1.0, 2.0, 0.0)),
        "robots": 2,
        "world": "furnished",
        "observation": {
            **EVERYTHING,
            "patch_shape": (5, 7, 1),
            "overview_shape": (4, 3, 1),
            "prediction_shape": (MOST_PREDICTED, 3),
        },
    },
    "planar, discrete": {
        "robots": 2,
        "robot": {"motion": "planar", "sensor_height_m": 1.1},
        "action": {"kind": "discrete"},
        "observation": EVERYTHING,
    },
    "never heard": {"robots": 2, "channel": {"loss_probability": 1.0}, "observation": EVERYTHING},
    "blind close by": {"robots": 2, "sensor": {"min_range_m": 1.3}, "observation": EVERYTHING},
    "late": {
        "robots": 3,
        "decision_period_s": 0.7,
        "channel": {"delay_s": 0.9},
        "ending": {"time_limit_s": 1e3},
        "observation": EVERYTHING,
    },
    "under way": {"robots": 2, "robot": {"redecide": 0.3}, "observation": EVERYTHING},
}


@pytest.fixture(scope="module", params=SETTINGS, ids=lambda name: name.replace(" ", "_"))
def mission(request):
    """A mission after twelve steps of random actions, and its robots' observations by part."""
    missions = started(free_box(**SETTINGS[request.param]), seed=3)
    wander(missions, 12, 5)
    parts = [missions.layout.split(row) for row in missions.observations[0].copy()]
    return missions, parts


def pose_of(missions, robot):
    """Where a robot is now, by the reference's trapezoid."""
    own, time_s = missions.state.robots[0, robot], missions.state.missions[0]["time_s"]
    settings = missions.scenario.robot
    origin, goal, since = own["origin"].copy(), own["goal"].copy(), time_s - own["depart_s"]
    length, pace = math.dist(origin[:3], goal[:3]), (settings.max_speed_m_s, settings.acceleration_m_s2)
    pose = goal.copy()
    if since < rocha04.drive_s(length, *pace):
        pose[:3] = origin[:3] + (goal - origin)[:3] * rocha04.way_at_m(since, length, *pace) / length
    for angle in (3, 4):
        turn = goal[angle] - origin[angle]
        turn = (turn + math.pi) % (2 * math.pi) - math.pi if angle == 3 else turn
        if abs(turn) > settings.turn_rate_rad_s * since:
            pose[angle] = origin[angle] + math.copysign(settings.turn_rate_rad_s * since, turn)
    return pose


def normalised(missions, precision):
    """Voxel entropy, 1 at the prior and 0 at the end."""
    high = gaussian_entropy_bits(missions.scenario.sigma_prior)
    low = gaussian_entropy_bits(missions.scenario.ending.sigma_end)
    entropy = gaussian_entropy_bits(1.0) - 0.5 * np.log2(precision.astype(np.float64))
    return np.clip((entropy - low) / (high - low), 0.0, 1.0)


def test_the_parts_are_those_asked_for(mission):
    missions, parts = mission
    expected = ["panorama", "self", "drive", "team", "patch", "overview", "prediction"]
    if missions.scenario.action.kind == "discrete":
        expected.append("action_mask")
    assert list(parts[0]) == expected
    for robot_parts in parts:
        assert missions.layout.space().contains(robot_parts)


def test_self(mission):
    missions, parts = mission
    grid, state = missions.grid, missions.state
    for robot, part in enumerate(parts):
        pose, own = pose_of(missions, robot), state.robots[0, robot]
        place = 2 * (pose[:3] - grid.origin_m) / grid.size_m - 1
        yaw, pitch = pose[3:]
        high = grid.voxels * gaussian_entropy_bits(missions.scenario.sigma_prior)
        low = grid.voxels * gaussian_entropy_bits(missions.scenario.ending.sigma_end)
        entropy = map_entropy_bits(missions.precision[0, robot])
        expected = [
            *place,
            *(math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)),
            state.missions[0]["time_s"] / missions.scenario.ending.time_limit_s,
            (entropy - low) / (high - low),
            float(own["deciding"]),
        ]
        assert part["self"] == pytest.approx(expected, abs=2e-5)


def test_drive(mission):
    missions, parts = mission
    size_m, time_s, moving = missions.grid.size_m, float(missions.state.missions[0]["time_s"]), 0
    for robot, part in enumerate(parts):
        own, params = missions.state.robots[0, robot], missions.rules.params[robot]
        expected = relative(own["target"], pose_of(missions, robot), size_m)
        assert part["drive"][1:] == pytest.approx(expected, abs=2e-5)
        before, after = (np.array(pose_at(params, own, time_s + gap)[:3]) for gap in (-1e-4, 1e-4))
        standing = own["deciding"] and not own["under_way"]
        speed_m_s = 0.0 if standing else np.linalg.norm(after - before) / 2e-4
        assert part["drive"][0] * params["max_speed_m_s"] == pytest.approx(speed_m_s, abs=1e-3)
        moving += part["drive"][0] > 0.0
    if missions.scenario.robot.redecide != "at_stop":
        assert moving


def relative(other, pose, size_m):
    """Seven numbers: the place in workspace sizes, and the gaze."""
    gaze = (f(angle) for angle in other[3:5] for f in (math.cos, math.sin))
    return [*np.clip((other[:3] - pose[:3]) / size_m, -1, 1), *gaze]


def test_team(mission):
    missions, parts = mission
    grid, heard = missions.grid, missions.state.heard[0]
    some = False
    for robot, part in enumerate(parts):
        pose = pose_of(missions, robot)
        mates = [mate for mate in range(len(parts)) if mate != robot]
        assert part["team"].shape == (len(mates), 19)
        for row, mate in zip(part["team"], mates, strict=True):
            news, expected = heard[robot, mate], np.zeros(19)
            if news["heard_s"] >= 0:
                some = True
                age = missions.state.missions[0]["time_s"] - news["heard_s"]
                expected[0], expected[8] = 1, age / (age + 60)
                expected[1:8] = relative(news["pose"], pose, grid.size_m)
            if news["announced_s"] >= 0:
                told = news["announced"]
                expected[9] = 1
                expected[10:17] = relative(told, pose, grid.size_m)
                expected[17] = min(told[5] / np.linalg.norm(grid.size_m), 1)
                expected[18] = told[6] / math.pi
            assert row == pytest.approx(expected, abs=2e-5)
    assert some is (missions.scenario.channel.loss_probability == 0.0)


def test_patch(mission):
    missions, parts = mission
    shape, size = missions.scenario.observation.patch_shape, np.array(missions.grid.shape)
    heard = missions.state.heard[0]
    outside_seen = False
    for robot, part in enumerate(parts):
        here = missions.grid.voxel_of(pose_of(missions, robot)[:3])
        entropy = normalised(missions, missions.precision[0, robot])
        expected = np.zeros((4, *shape))
        for cell in np.ndindex(*shape):
            voxel = here + cell - np.array(shape) // 2
            if (voxel >= 0).all() and (voxel < size).all():
                expected[(0, *cell)] = missions.mean[(0, robot, *voxel)]
                expected[(1, *cell)] = entropy[tuple(voxel)]
            else:
                expected[(0, *cell)] = expected[(2, *cell)] = 1.0
                outside_seen = True
            for mate in range(len(parts)):
                if mate != robot and heard[robot, mate]["heard_s"] >= 0:
                    there = missions.grid.voxel_of(heard[robot, mate]["pose"][:3])
                    expected[(3, *cell)] = max(expected[(3, *cell)], float((there == voxel).all()))
        np.testing.assert_allclose(part["patch"], expected, atol=1e-5)
        centre = tuple(n // 2 for n in shape)
        assert part["patch"][(2, *centre)] == 0.0
    assert outside_seen


def test_overview(mission):
    missions, parts = mission
    size = missions.grid.shape
    cells = tuple(min(a, b) for a, b in zip(missions.scenario.observation.overview_shape, size, strict=True))
    for robot, part in enumerate(parts):
        entropy = normalised(missions, missions.precision[0, robot])
        mean = missions.mean[0, robot]
        assert part["overview"].shape == (2, *cells)
        for cell in np.ndindex(*cells):
            block = tuple(
                slice(index * n // count, (index + 1) * n // count)
                for index, n, count in zip(cell, size, cells, strict=True)
            )
            assert part["overview"][(0, *cell)] == pytest.approx(entropy[block].mean(), abs=1e-5)
            assert part["overview"][(1, *cell)] == pytest.approx(mean[block].mean(), abs=1e-5)


def test_prediction_is_that_of_the_view(mission):
    """Cells of 0.2 m around the robot's own, whatever the voxels; of the band that its body passes."""
    missions, parts = mission
    told = set()
    for robot, part in enumerate(parts):
        view = view_of(missions, 0, robot)
        found = view.prediction
        x, y = found.cell_of(view.pose)
        across, along = missions.scenario.observation.prediction_shape
        low_x, low_y = x - across // 2, y - along // 2
        cut = np.s_[low_x : low_x + across, low_y : low_y + along]
        np.testing.assert_array_equal(part["prediction"][0], found.solid[cut])
        np.testing.assert_array_equal(part["prediction"][1], found.measured[cut])
        told |= set(part["prediction"][1].ravel().tolist())
        radius = missions.scenario.robot.body_radius_m / missions.grid.voxel_size_m
        height = (view.pose[2] - missions.grid.origin_m[2]) / missions.grid.voxel_size_m
        layers = np.arange(missions.grid.shape[2])
        passed = layers[(layers + 1 > height - radius + 1e-6) & (layers < height + radius - 1e-6)]
        assert found.layers == (passed[0], passed[-1] + 1)
        assert view.prediction is found
    assert told == {0.0, 1.0}


def panorama_gazes(missions):
    """Yaw and pitch of the panorama's directions, in order."""
    settings, planar = missions.scenario.observation, missions.scenario.planar
    yaws = settings.panorama_yaws or (32 if missions.grid.flat else 16)
    count = 1 if planar else settings.panorama_pitches
    pitches = np.linspace(-math.pi / 4, math.pi / 4, count) if count > 1 else [0.0]
    return [(2 * math.pi * number / yaws, pitch) for number in range(yaws) for pitch in pitches]


def test_panorama_is_what_the_paper_s_equations_promise(mission):
    missions, parts = mission
    sensor, size, edge = missions.scenario.sensor, missions.grid.shape, missions.grid.voxel_size_m
    gazes, compared = panorama_gazes(missions), 0
    for robot, part in enumerate(parts):
        start = (pose_of(missions, robot)[:3] - missions.grid.origin_m) / edge
        mean, precision = missions.mean[0, robot], missions.precision[0, robot]
        assert part["panorama"].shape == (2, len(gazes))
        for gaze, bits, range_m in zip(gazes, *part["panorama"].astype(float), strict=True):
            direction, longest = rocha04.gaze(*gaze), sensor.max_range_m / edge
            if not rocha04.is_generic(start, direction, size, longest, margin=1e-4):
                continue
            ray = rocha04.trace(
                lambda v, mean=mean: mean[v] > 0.5, start, direction, size, longest, sensor.voxels_behind
            )
            reference = rocha04.Sensor(edge, sensor.sigma_min, sensor.sigma_slope_per_m)
            beliefs = as_reference(mean, precision)
            promised = rocha04.integrate(beliefs, ray.voxels, start, ray.length * edge, True, reference)
            if rocha04.is_blind(ray.end != rocha04.OPEN, ray.length * edge, sensor.min_range_m):
                promised = 0.0
            if missions.scenario.observation.panorama_utility == "log2":
                promised = math.log2(1 + promised)
            assert range_m == pytest.approx(ray.length * edge, rel=1e-4)
            assert bits == pytest.approx(promised, rel=1e-4, abs=1e-4)
            compared += 1
    assert compared > 0.5 * len(gazes) * len(parts)


def test_parts_left_out_leave_no_numbers():
    nothing = {"panorama": False, "self_state": False, "team": False}
    missions = started(free_box(observation=nothing))
    assert missions.observations.shape == (1, 2, 0)
    only = started(free_box(observation={**nothing, "team": True}))
    assert list(only.layout.split(only.observations[0, 0])) == ["team"]
    alone = started(free_box(robots=1))
    assert list(alone.layout.split(alone.observations[0, 0])) == ["panorama", "self"]


def test_who_does_not_decide_observes_nothing_where_that_is_asked_for():
    missions = started(free_box(robots=2, decision_period_s=0.25, observation={"while_busy": False}))
    put(missions, 0, (1.75, 2.75, 1.25, 0, 0))
    put(missions, 1, (1.25, 3.75, 1.75, 0, 0))
    stay, go = np.zeros(5), np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    seen = []
    for _ in range(2):  # a scan takes ½ s
        missions.step(np.array([[stay, go]]), np.zeros((1, 2), np.int64))
        seen.append(missions.observations[0].any(axis=1).tolist())
    assert seen == [[False, False], [True, False]]
    assert missions.state.robots[0]["deciding"].tolist() == [True, False]


def test_a_place_on_a_face_that_rounding_takes_past_it_is_still_inside():
    """1e9 m from the map's origin, where a metre has eight digits left: no ray begins outside."""
    grid = Grid((7, 11, 5), 0.08945617475586909, (966007922.5094144, 268677512.72424054, 239985185.11960912))
    scenario = free_box(
        grid=grid,
        robots=2,
        robot={"reach_m": math.inf, "body_radius_m": 0.0},
        observation={**EVERYTHING, "panorama_yaws": 8},
    )
    missions = started(scenario)
    low, high = (bound.astype(np.float32) for bound in (missions.layout.low, missions.layout.high))
    past, origin = 0, np.asarray(grid.origin_m)
    for number in range(30):
        place = origin + np.random.default_rng(number).uniform(0.0, 1.0, 3) * grid.size_m
        axis = number % 3
        place[axis] = origin[axis] + grid.size_m[axis]
        past += (place[axis] - origin[axis]) / grid.voxel_size_m > grid.shape[axis]
        put(missions, 0, (*place, 0.3 * number, 0.1))
        missions._compiled_step.observe(missions._arrays(), 0, 1)
        assert ((missions.observations >= low) & (missions.observations <= high)).all()
        missions.step(*random_actions(missions, np.random.default_rng(number)))
        assert ((missions.observations >= low) & (missions.observations <= high)).all()
        assert missions.state.robots["path_m"].min() >= 0.0
        assert missions.state.scan_range_m.min() >= 0.0
    assert past > 5


def test_noise_that_grows_with_a_power_of_the_distance_is_in_scans_and_in_what_is_expected_of_them():
    """Along one ray of length d, ζ dⁿ with n = 2 is what n = 1 gives with ζ d; the panorama's is as long."""
    told = []
    for exponent, slope in ((2.0, 0.03), (1.0, 0.03 * 1.75), (1.0, 0.03)):
        sensor = {"field_of_view_rad": (0.0, 0.0), "sigma_slope_per_m": slope, "sigma_exponent": exponent}
        missions = started(
            free_box(
                robots=1,
                robot={"turn_rate_rad_s": math.inf},
                sensor=sensor,
                observation={"panorama_yaws": 1, "panorama_pitches": 1, "flat": True},
            )
        )
        put(missions, 0, (1.75, 2.75, 1.25, 0.0, 0.0))
        model = robot_model(missions.scenario, missions.scenario.kinds[0], 1)
        missions.step(np.array([[[0.0, 0.0, 0.0, 1.0, 0.0]]]), np.zeros((1, 1), np.int64))
        assert view_of(missions, 0, 0).scan.range_m == pytest.approx([1.75])
        told.append((missions.precision[0, 0].copy(), missions.observations[0, 0, :1].copy()))
        assert (model.scan.sigma_exponent, model.scan.sigma_slope_per_m) == (exponent, slope)
    np.testing.assert_allclose(told[0][0], told[1][0], rtol=1e-6)
    np.testing.assert_allclose(told[0][1], told[1][1], rtol=1e-6)
    assert told[0][0].max() < 0.9 * told[2][0].max() and (told[0][1] < 0.99 * told[2][1]).all()
