"""Settings: what is out of range, of the wrong kind or unknown is refused by name, value and range."""

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.channel import Channel, Signal
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.faults import Faults, Outage, RadioFault, SensorFault
from entropy_explore_env.settings.fiducials import Fiducials
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.reward import Reward
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import BOX, SCENARIOS, find_scenario
from entropy_explore_env.settings.sensor import RangeSensor
from tests.settings.refusals import refusal

NAN, INF = math.nan, math.inf
NO_NUMBERS = ("1", None, True, [1.0], NAN)
"""Never a number > 0, nor one of another range."""
POSITIVE = (*NO_NUMBERS, 0.0, -1.0)
TINY, HUGE = 5e-324, 1e300
"""Numbers with which a drive or a scan would take for ever, or a sum be infinite."""
NOT_NEGATIVE = (*NO_NUMBERS, -1e-9, INF)
COUNT = (*NO_NUMBERS, 1.5, -1)
KIND = (None, 1, "free ", "FREE", NAN, [])
SWITCH = (None, 1, 0.0, "yes", NAN)
ROBOTS = ((1, 1), [1], (-1,), (True,), (1000,), None)


def fields_of(kind, names):
    """Keys of the table: settings of one kind that refuse the same values."""
    return [(kind, name) for name in names.split()]


REFUSED = {
    (Grid, "shape"): (
        (7, 11),
        (7, 11, 5, 2),
        [7, 11, 5],
        (7, 11, 0),
        (7.0, 11, 5),
        (7, -1, 5),
        (True, 11, 5),
        "7x11x5",
        None,
        (2048, 2048, 2048),
    ),
    (Grid, "voxel_size_m"): (*POSITIVE, INF),
    (Grid, "origin_m"): (
        (0.0, 0.0),
        [0.0, 0.0, 0.0],
        (0.0, NAN, 0.0),
        (0.0, INF, 0.0),
        None,
        (0, "0", 0),
        (0, True, 0),
    ),
    (Scenario, "split"): (None, 1, "Train", "holdout", "", NAN, []),
    **dict.fromkeys(fields_of(Robot, "motion navigator when_blocked"), KIND),
    (Robot, "unknown_cost"): (*NO_NUMBERS, 0.0, 0.999, INF, 1.1e6),
    (Robot, "reach_m"): (*POSITIVE, TINY, 0.9e-6, 1.1e6, HUGE),
    (Robot, "max_speed_m_s"): (*POSITIVE, TINY, 0.9e-4, 1.1e4, HUGE, INF),
    (Robot, "acceleration_m_s2"): (*POSITIVE, TINY, 0.9e-4, 1.1e6, HUGE, INF),
    (Robot, "turn_rate_rad_s"): (*POSITIVE, TINY, 0.9e-4, 1.1e6, HUGE),
    **dict.fromkeys(fields_of(Robot, "body_radius_m sensor_height_m"), (*NOT_NEGATIVE, 1.1e6)),
    (Robot, "tilts"): SWITCH,
    (Robot, "above_ground_m"): (*(v for v in POSITIVE if v is not None), TINY, 0.9e-6, 1.1e6, INF),
    (Robot, "blocked_wait_s"): (*POSITIVE, TINY, 0.9e-4, 1.1e5, INF),
    (Robot, "redecide"): (None, True, [1.0], NAN, INF, 0.0, -1.0, 0.0099, "on_scans", "AT_STOP", "1", ""),
    (Robot, "localization"): (None, Reward(), "exact"),
    (Scenario, "start_radius_m"): (*POSITIVE, TINY, 1.1e6),
    (RangeSensor, "field_of_view_rad"): (
        0.5,
        (0.5,),
        [0.5, 0.5],
        (0.5, NAN),
        (-0.1, 0.5),
        (0.5, -0.1),
        (7.0, 0.5),
        (0.5, 3.2),
        ("0.5", 0.5),
        (True, 0.5),
        None,
    ),
    (RangeSensor, "angular_step_rad"): (*POSITIVE, INF, 1e-5, 1e-320),
    (RangeSensor, "max_range_m"): (*POSITIVE, TINY, 0.9e-6, 1.1e6, HUGE),
    (RangeSensor, "min_range_m"): (*NOT_NEGATIVE, INF),
    (RangeSensor, "sigma_min"): (*POSITIVE, INF, 0.9e-4, 1.1e4),
    **dict.fromkeys(fields_of(RangeSensor, "sigma_slope_per_m range_noise_m"), (*NOT_NEGATIVE, 1.1e6, HUGE)),
    (RangeSensor, "sigma_exponent"): (*POSITIVE, INF, 0.2, 4.1),
    (RangeSensor, "voxels_behind"): (*COUNT, 1001),
    (RangeSensor, "scan_time_s"): (*POSITIVE, TINY, 0.9e-4, 1.1e5, INF),
    (RangeSensor, "scan_every_m"): (*POSITIVE, 0.9e-3, 1.1e6),
    **dict.fromkeys(fields_of(Channel, "content order reach"), KIND),
    **dict.fromkeys(fields_of(Channel, "summary_every_s phase_s"), (*NO_NUMBERS, -0.01, 0.9e-3, 3601.0, INF)),
    (Channel, "summary_threshold_bits"): (*NO_NUMBERS, -0.01, 5.01, INF),
    (Channel, "burst"): (*COUNT, 1_000_001),
    (Channel, "i_min_bits"): (*NOT_NEGATIVE, 1.1e6),
    (Channel, "i_min_fill"): ("1", True, NAN, 0.0, -0.5, 10.01, INF),
    (Channel, "range_m"): (*POSITIVE, TINY, 1.1e6),
    (Channel, "loss_probability"): (*NO_NUMBERS, -0.01, 1.01, INF),
    (Channel, "delay_s"): (*NO_NUMBERS, -0.01, 3601.0, INF),
    (Channel, "announcements"): SWITCH,
    (Channel, "repeats"): (*COUNT, 0, 1001),
    (Channel, "signal"): (None, Reward(), "strong"),
    (Ending, "sigma_end"): (*POSITIVE, INF, 0.9e-4, 30.0),
    (Ending, "termination"): KIND,
    (Ending, "seen_share"): ("1", True, [1.0], NAN, 0.0, -0.5, 1.0001, INF),
    (Ending, "unseen_free_voxels"): ("1", True, [1], NAN, -1, 1.5, 2**31),
    (Ending, "return_to_start"): SWITCH,
    (Ending, "time_limit_s"): (*POSITIVE, TINY, 0.9e-3, 1.1e9, HUGE),
    (Ending, "max_cycles"): ("1", True, [1], NAN, 0, -1, 1.5, 2**63),
    (Reward, "kind"): KIND,
    (Reward, "cost_per_s"): (*NOT_NEGATIVE, 1.1e6, HUGE),
    **dict.fromkeys(fields_of(Action, "kind moves"), KIND),
    (Action, "yaws"): (*COUNT, 0, 361),
    (Action, "pitches"): (*COUNT, 0, 91),
    (Action, "candidates"): (*COUNT, 0, 65),
    **dict.fromkeys(
        fields_of(
            Observation,
            "panorama self_state drive team patch overview prediction action_mask candidates overlaps "
            "flat while_busy",
        ),
        SWITCH,
    ),
    (Observation, "panorama_yaws"): ("16", True, NAN, 0, 361, 16.0),
    (Observation, "panorama_pitches"): (*COUNT, 0, 91),
    (Observation, "panorama_utility"): KIND,
    (Observation, "patch_shape"): (
        (11, 11),
        [11, 11, 5],
        (10, 11, 5),
        (11, 11, 257),
        (11.0, 11, 5),
        11,
        None,
    ),
    (Observation, "prediction_shape"): (
        (65, 65, 1),
        [65, 65],
        (64, 65),
        (65, 113),
        (0, 1),
        (65.0, 65),
        65,
        None,
    ),
    (Observation, "overview_shape"): ((8, 8), [8, 8, 4], (0, 8, 4), (65, 8, 4), (8.0, 8, 4), None),
    **dict.fromkeys(fields_of(Scenario, "name world"), (None, 1)),
    (Scenario, "grid"): (None, (7, 11, 5)),
    (Scenario, "robots"): (*COUNT, 0, 1001),
    (Scenario, "decision_period_s"): ("1", True, [1.0], NAN, 0.0, -1.0, TINY, 0.9e-3, 1.1e5, HUGE, INF),
    (Scenario, "track_truth"): SWITCH,
    (Scenario, "robot"): (None, Reward(), "free"),
    **dict.fromkeys(fields_of(Scenario, "sensor channel ending observation"), (None, Reward())),
    (Scenario, "extra_kinds"): (None, [], 1, (Reward(),), (None,)),
    (RobotKind, "robot"): (None, Reward(), "free"),
    (RobotKind, "sensor"): (None, Reward()),
    (Scenario, "faults"): (None, Reward(), "none"),
    (Scenario, "fiducials"): (None, Reward(), 3),
    (Scenario, "reward"): (None, Ending(), "team"),
    (Scenario, "action"): (None, Reward(), "discrete"),
    **dict.fromkeys(fields_of(Outage, "at_s mean_s lasts_s"), (*POSITIVE, 0.9e-3, 1.1e9)),
    (Outage, "robots"): ROBOTS,
    (SensorFault, "lost_rays"): (*NO_NUMBERS, -0.1, 1.1),
    (SensorFault, "range_factor"): (*POSITIVE, 0.09, 10.1, INF),
    (SensorFault, "range_bias_m"): (*NO_NUMBERS, -1.1e6, 1.1e6, INF),
    (SensorFault, "robots"): ROBOTS,
    (RadioFault, "garbled"): (*NO_NUMBERS, -0.1, 1.1),
    (RadioFault, "repeated"): (*NO_NUMBERS, -0.1, 2),
    (RadioFault, "late"): (*NO_NUMBERS, -0.1, 1.1, "often"),
    (RadioFault, "late_s"): (*POSITIVE, 3601.0, INF),
    (RadioFault, "robots"): ROBOTS,
    **dict.fromkeys(fields_of(Faults, "stop blind silent sensor radio"), (None, Reward(), "always")),
    (Signal, "budget_db"): (*NO_NUMBERS, -401.0, 501.0, INF),
    (Signal, "exponent"): (*NO_NUMBERS, -1.0, 10.1, INF),
    (Signal, "wall_loss_db_per_m"): (*NO_NUMBERS, -1.0, 1.1e4, INF),
    **dict.fromkeys(
        fields_of(Localization, "xy_m_per_sqrt_m z_m_per_sqrt_m margin_m"), (*NOT_NEGATIVE, 100.1)
    ),
    **dict.fromkeys(
        fields_of(Localization, "yaw_rad_per_sqrt_m yaw_rad_per_sqrt_rad"), (*NOT_NEGATIVE, 10.1)
    ),
    (Fiducials, "number"): (*COUNT, 1001),
    (Fiducials, "positions_m"): (
        "abc",
        {(1.0, 2.0, 3.0)},
        ((0.0, 0.0),),
        ((0.0, 0.0, NAN),),
        (1.0, 2.0, 3.0),
    ),
    (Fiducials, "range_m"): (*POSITIVE, TINY, 1.1e6),
    (Fiducials, "range_sigma_m"): (*POSITIVE, TINY, 1.1e6, INF),
    (Fiducials, "bearing_sigma_rad"): (*POSITIVE, TINY, 10.1, INF),
    (Fiducials, "own_number"): (*COUNT, 65),
    (Fiducials, "own_score"): (*NO_NUMBERS, -0.1, 2.1, INF),
    (Fiducials, "own_apart_m"): (*NOT_NEGATIVE, 1.1e6),
}
SLOW_TURNS = {"robot": {"turn_rate_rad_s": 0.009}}
"""Half a turn takes 349 s, a drive across the box 14 s and 1 s, a scan 0.5 s, a wait 5 s: 369.5 s in all."""
DEFAULTS = {Grid: {"shape": (7, 11, 5), "voxel_size_m": 0.5}, Scenario: {"name": "a", "grid": BOX.grid}}
CASES = [(kind, name, value) for (kind, name), values in REFUSED.items() for value in values]


@pytest.mark.parametrize(
    ("kind", "name", "value"), CASES, ids=lambda part: getattr(part, "__name__", None) or repr(part)
)
def test_a_setting_that_is_not_allowed_is_refused(kind, name, value):
    error = refusal(lambda: kind(**{**DEFAULTS.get(kind, {}), name: value}))
    assert error.field == f"{kind.__name__}.{name}"
    assert repr(error.value) == repr(value)


def test_every_setting_is_in_the_list():
    fields = {
        (kind, field.name) for kind in {kind for kind, _ in REFUSED} for field in dataclasses.fields(kind)
    }
    assert fields == set(REFUSED)


ACCEPTED = [
    (Grid, {"shape": (1, 1, 1), "voxel_size_m": 1e-3, "origin_m": (-1, 2.5, 0)}),
    (Grid, {"shape": (np.int64(7), np.int32(11), 5), "voxel_size_m": np.float64(0.5)}),
    (Robot, {"reach_m": 1e-6, "max_speed_m_s": 1e-4, "acceleration_m_s2": 1e6, "turn_rate_rad_s": 1e-4}),
    (Robot, {"reach_m": 1e6, "max_speed_m_s": 1e4, "acceleration_m_s2": 1e-4, "blocked_wait_s": 1e-4}),
    (Robot, {"reach_m": INF, "turn_rate_rad_s": INF, "body_radius_m": 0, "sensor_height_m": 0}),
    (Robot, {"motion": "planar", "reach_m": 3, "navigator": "planned", "unknown_cost": 1}),
    (Robot, {"redecide": "on_scan"}),
    (Robot, {"redecide": 0.01}),
    (Robot, {"redecide": np.float32(1e6)}),
    (RangeSensor, {"scan_every_m": 1e-3, "scan_time_s": 1e-4, "max_range_m": 1e-6}),
    (RangeSensor, {"scan_every_m": 1e6, "scan_time_s": 1e5, "max_range_m": 1e6, "range_noise_m": 1e6}),
    (RangeSensor, {"scan_every_m": INF}),
    (RangeSensor, {"field_of_view_rad": (2 * math.pi, math.pi), "max_range_m": INF, "voxels_behind": 0}),
    (RangeSensor, {"field_of_view_rad": (0, 0), "sigma_min": 1e-4, "sigma_slope_per_m": 0}),
    (Channel, {"burst": 0, "i_min_bits": 0, "range_m": 1e-9, "loss_probability": 1, "delay_s": 3600}),
    (Ending, {"sigma_end": 1e-4, "termination": "all", "time_limit_s": INF, "max_cycles": 1}),
    (Ending, {"seen_share": 1}),
    (Ending, {"seen_share": 1e-9}),
    (Ending, {"unseen_free_voxels": 0}),
    (Ending, {"time_limit_s": 1e-3}),
    (Channel, {"phase_s": 1.0, "repeats": 1000, "range_m": 1e6, "i_min_bits": 1e6}),
    (Channel, {"phase_s": 1e-3, "repeats": 1}),
    (Channel, {"burst": 0, "summary_every_s": 10}),
    (Channel, {"order": "need", "burst": 0}),
    (Channel, {"content": "summaries", "summary_every_s": 0, "summary_threshold_bits": 0}),
    (Channel, {"content": "summaries", "summary_every_s": 3600, "summary_threshold_bits": 5}),
    (Reward, {"kind": "team", "cost_per_s": 0}),
    (Action, {"kind": "discrete", "yaws": 1, "pitches": 1}),
    (Observation, {"panorama_yaws": 1, "panorama_utility": "log2", "patch_shape": (1, 1, 1)}),
    (Observation, {"prediction_shape": (1, 111)}),
]


@pytest.mark.parametrize(("kind", "settings"), ACCEPTED)
def test_the_ends_of_the_ranges_are_allowed(kind, settings):
    made = kind(**settings)
    for name, value in settings.items():
        assert getattr(made, name) == value


def test_a_number_that_no_float_holds_is_refused_in_a_short_line():
    with pytest.raises(SettingError) as caught:
        Robot(reach_m=10**400)
    assert caught.value.field == "Robot.reach_m"
    assert len(str(caught.value)) < 300


def test_rovers_stay_in_their_plane_and_look_up_and_down_but_not_in_plans():
    rover = {"motion": "planar", "sensor_height_m": 1.75, "above_ground_m": 0.75, "tilts": True}
    scenario = with_settings(BOX, {"robot": rover})
    assert scenario.in_planes and not scenario.planar and not scenario.looks_level(scenario.robot)
    assert (scenario.layer_of(scenario.robot), scenario.ground_layer_of(scenario.robot)) == (3, 1)
    level = with_settings(scenario, {"robot": {"tilts": False, "above_ground_m": None}})
    assert level.planar and level.in_planes and level.ground_layer_of(level.robot) is None
    flying = with_settings(scenario, {"robot": {"motion": "free"}})
    assert not flying.in_planes and flying.ground_layer_of(flying.robot) is None
    plan = with_settings(scenario, {"grid": Grid((7, 11, 1), 0.5)})
    assert plan.planar and plan.ground_layer_of(plan.robot) is None


def test_settings_that_do_not_fit_each_other_are_refused():
    discrete = {"action": {"kind": "discrete"}}
    for settings, field in (
        ({"fiducials": {"number": 2, "positions_m": ((0.0, 0.0, 0.0),)}}, "Fiducials.number"),
        ({**discrete, "robot": {"reach_m": INF}}, "Action.kind"),
        ({**discrete, "observation": {"overlaps": True}}, "Observation.overlaps"),
        ({"observation": {"overlaps": True}}, "Observation.overlaps"),
        ({**discrete, "robot": {"reach_m": 0.49}}, "Robot.reach_m"),
        ({"robot": {"motion": "planar", "sensor_height_m": 2.5}}, "Robot.sensor_height_m"),
        (  # 0.85 < 17 · 0.05 in floating-point numbers, but 0.85 / 0.05 is 17
            {
                "grid": Grid((7, 11, 17), 0.05),
                "robot": {"motion": "planar", "sensor_height_m": 0.85, "body_radius_m": 0.01},
            },
            "Robot.sensor_height_m",
        ),
        (
            {"robot": {"motion": "planar", "sensor_height_m": 1.2, "above_ground_m": 0.8}},
            "Robot.above_ground_m",
        ),
        ({**discrete, "grid": Grid((70, 80, 60), 0.5), "robot": {"reach_m": 30.0}}, "Robot.reach_m"),
        ({"channel": {"delay_s": 3600.0}, "sensor": {"scan_time_s": 1e-4}}, "Channel.delay_s"),
        ({"channel": {"phase_s": 3600.0}, "sensor": {"scan_time_s": 1e-4}}, "Channel.phase_s"),
        ({"channel": {"phase_s": 1.0, "delay_s": 1.0}}, "Channel.delay_s"),
        ({"channel": {"i_min_fill": 1.0, "content": "summaries"}}, "Channel.i_min_fill"),
        ({"channel": {"order": "need", "burst": 3}, "robots": 6}, "Channel.burst"),
        ({"robot": {"redecide": "on_scan"}}, "Robot.redecide"),
        ({"ending": {"seen_share": 1.0, "unseen_free_voxels": 250}}, "Ending.unseen_free_voxels"),
        ({"robot": {"redecide": 0.01}, "channel": {"delay_s": 3600.0}, "robots": 64}, "Channel.delay_s"),
        # A scan each 0.1 ms: two messages a scan, 16,385 scans, two robots.
        ({"channel": {"delay_s": 1.63832, "burst": 1}, "sensor": {"scan_time_s": 1e-4}}, "Channel.delay_s"),
        ({"channel": {"phase_s": 0.9, "repeats": 1000}}, "Channel.repeats"),
        # 200,000 broadcasts in a step: of 1,000 s; at most 369.5 s; and of 300 s in all.
        ({"channel": {"phase_s": 0.0049}, "decision_period_s": 1000.0}, "Channel.phase_s"),
        ({"channel": {"phase_s": 0.0018}, "decision_period_s": None, **SLOW_TURNS}, "Channel.phase_s"),
        (
            {"channel": {"phase_s": 0.0014}, "decision_period_s": 1e5, "time_limit_s": 300.0},
            "Channel.phase_s",
        ),
        # The box is 3.5 × 5.5 × 2.5 m: 6.98 m across; 2 · √(6.98 / 1e-4) s = 528 s.
        ({"robot": {"body_radius_m": 2.751}}, "Robot.body_radius_m"),
        ({"sensor": {"scan_every_m": 0.00349}, "grid": Grid((7, 11, 5), 5.0)}, "RangeSensor.scan_every_m"),
        ({"robot": {"max_speed_m_s": 0.0069}, "grid": Grid((7, 11, 5), 50.0)}, "Robot.max_speed_m_s"),
        (
            {"robot": {"max_speed_m_s": 9.0, "acceleration_m_s2": 1e-4}, "grid": Grid((7, 11, 5), 2e4)},
            "Robot.acceleration_m_s2",
        ),
    ):
        assert refusal(lambda changes=settings: with_settings(BOX, changes)).field == field
    for few in (
        {"channel": {"phase_s": 0.0051}, "decision_period_s": 1000.0},
        {"channel": {"phase_s": 0.0038, "repeats": 2}, "decision_period_s": None, **SLOW_TURNS},
        {"channel": {"phase_s": 0.0016}, "decision_period_s": 1e5, "time_limit_s": 300.0},
    ):
        assert with_settings(BOX, few).channel.phase_s > 0.0
    most = {"channel": {"delay_s": 1.63812, "burst": 1}, "sensor": {"scan_time_s": 1e-4}}
    assert with_settings(BOX, most).message_slots == 4 * 16_383
    edge = {"robot": {"body_radius_m": 2.75}, "sensor": {"scan_every_m": 0.0035}}
    assert with_settings(BOX, {**edge, "grid": Grid((7, 11, 5), 5.0)}).robot.body_radius_m == 2.75
    assert with_settings(BOX, {**discrete, "robot": {"reach_m": 0.5}}).action.kind == "discrete"
    far = {"grid": Grid((70, 80, 60), 0.5), "robot": {"reach_m": 30.0}, "action": {"kind": "discrete"}}
    far["action"]["moves"] = "axes"  # seven, however far
    assert with_settings(BOX, far).robot.reach_m == 30.0
    flat = {"grid": Grid((7, 11, 1), 0.1), "robot": {"motion": "planar", "sensor_height_m": 2.5}}
    assert with_settings(BOX, flat).planar  # in a 2-D world there is no height
    level = with_settings(BOX, {"grid": Grid((7, 11, 1), 0.1)}).sensor
    assert (level.rows, level.columns) == (1, BOX.sensor.columns)  # ... and nothing above the horizon


@pytest.mark.parametrize("scenario", SCENARIOS.values(), ids=SCENARIOS)
def test_scenarios_are_frozen_and_found_by_name(scenario):
    assert find_scenario(scenario.name) is scenario
    assert find_scenario(scenario) is scenario
    for part in (scenario, scenario.grid, scenario.robot, scenario.sensor, scenario.channel, scenario.ending):
        name = dataclasses.fields(part)[0].name
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(part, name, getattr(part, name))
    with pytest.raises(TypeError):
        SCENARIOS["room"] = scenario
    assert pickle.loads(pickle.dumps(scenario)) == scenario == copy.deepcopy(scenario)
    assert hash(pickle.loads(pickle.dumps(scenario))) == hash(scenario)
    assert scenario.agents == tuple(f"robot_{robot}" for robot in range(scenario.robots))


@pytest.mark.parametrize("name", ["castle", "Room", "", None, 3, ["room"]])
def test_a_scenario_that_nobody_knows(name):
    error = refusal(lambda: find_scenario(name))
    assert (error.field, error.value) == ("scenario", name)
    assert all(known in error.allowed for known in SCENARIOS)
