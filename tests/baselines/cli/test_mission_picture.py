"""The picture of a whole mission: what lies on which of its maps."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from baselines.cli import mission_picture as pictures
from baselines.cli.mission_picture import mission_picture
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.recording import Recorder, believed_poses_now, poses_now
from entropy_explore_env.settings.fiducials import Fiducials
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import free_box, random_actions, started

GRID = Grid((7, 11, 5), 0.5, (-2.0, 1.0, 0.25))
DRIFT = {"localization": {"xy_m_per_sqrt_m": 0.2, "yaw_rad_per_sqrt_m": 0.05}}
LANDMARKS = ((-1.0, 2.0, 1.5), (0.5, 5.0, 1.0), (1.0, 3.0, 2.0))


def recorded(missions: Missions, steps: int = 6) -> Recorder:
    """A mission of some random steps."""
    recorder, rng = Recorder(missions), np.random.default_rng(0)
    for step in range(steps + 1):
        if step:
            missions.step(*random_actions(missions, rng))
        recorder.note()
    return recorder


@pytest.fixture
def drawn(monkeypatch):
    """The figures that were drawn."""
    figures: list[Figure] = []
    monkeypatch.setattr(pictures, "png", lambda figure: figures.append(figure) or b"")
    return figures


def marks(axes, marker: str) -> np.ndarray:
    """(N, 2) where marks of a kind are."""
    places = [np.stack(line.get_data(), axis=1) for line in axes.lines if line.get_marker() == marker]
    return np.concatenate(places) if places else np.zeros((0, 2))


def panels_of(figure: Figure) -> list:
    """The axes of the maps: entropy left, what is known, the true world."""
    return [axes for axes in figure.axes if axes.images and axes.get_title()]


def test_robots_that_drift_stand_where_they_believe_to_be_beside_where_they_are(drawn):
    fiducials = Fiducials(positions_m=LANDMARKS)
    scenario = free_box(robots=2, robot=DRIFT, fiducials=fiducials, grid=GRID)
    recorder = recorded(started(scenario))
    mission_picture(recorder, "box", "random", truth=True)
    missions, figure = recorder.missions, drawn[0]
    believed, true = (poses(missions, 0)[:, :2] for poses in (believed_poses_now, poses_now))
    assert np.abs(believed - true).min(axis=1).max() > 0.0
    panels = panels_of(figure)
    assert len(panels) == 3
    for axes in panels:
        np.testing.assert_allclose(marks(axes, "^"), np.array(LANDMARKS)[:, :2])
        np.testing.assert_allclose(marks(axes, "D"), true)
        knows = axes.get_title().startswith("What")
        np.testing.assert_allclose(marks(axes, "s"), believed if knows else np.zeros((0, 2)))
        for robot in range(2 if knows else 0):
            lines = [np.stack(line.get_data(), axis=1) for line in axes.lines]
            assert any(np.array_equal(line, np.stack([believed[robot], true[robot]])) for line in lines)
            around = [line for line in lines if len(line) > 40 and np.allclose(line[0], line[-1])]
            sigma = np.sqrt(missions.state.estimates[0][robot]["covariance"][0, 0])
            reach = [np.abs(line[:, 0] - believed[robot, 0]).max() for line in around]
            assert any(np.isclose(each, 2.0 * sigma, rtol=0.01) for each in reach)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.texts] == [
        "start",
        "end: where it believes to be, with an ellipse of 2 σ",
        "where it truly is",
        "fiducial",
    ]


@pytest.mark.parametrize(("content", "label"), [("measurements", "measurements"), ("summaries", "kbit")])
def test_what_a_team_sends_is_drawn_by_what_it_is(drawn, content, label):
    channel = {"content": content, "summary_every_s": 0.5} if content == "summaries" else {}
    recorder = recorded(started(free_box(robots=2, grid=GRID, channel=channel)))
    mission_picture(recorder, "box", "random")
    (axes,) = (axes for axes in drawn[0].axes if axes.get_title().endswith("cumulative"))
    sent = axes.lines[0].get_ydata()
    assert label in axes.get_ylabel() and sent[-1] > 0.0
    robots = recorder.missions.state.robots[0]
    whole = robots["bits_sent"].sum() / 1000 if content == "summaries" else robots["measurements_sent"].sum()
    assert sent[-1] == pytest.approx(whole)


def test_robots_that_know_where_they_are_have_no_estimates(drawn):
    mission_picture(recorded(started(free_box(robots=1))), "box", "random")
    (figure,) = drawn
    assert [text.get_text() for text in figure.legends[0].texts] == ["start", "end"]
    assert not any(len(marks(axes, mark)) for axes in figure.axes for mark in "D^")


def test_ground_below_open_sky_is_shown_from_above(drawn):
    """Heights of 0.25 + 0.5 k metres where robot_0 has measured; elsewhere nothing is claimed."""
    heights = np.random.default_rng(1).integers(1, 3, (7, 11))
    solid = np.arange(5) < heights[..., None]
    missions = Missions(free_box(robots=1, grid=GRID, world="given"), given=[World(GRID, solid, "hills")])
    missions.reset(0, 0)
    missions.state.mean[0, 0], missions.state.precision[0, 0] = solid.ravel(), 1e6
    missions.state.precision[0, 0].reshape(7, 11, 5)[:3] = missions.rules.params["prior_precision"][0]
    recorder = Recorder(missions)
    recorder.note()
    mission_picture(recorder, "hills", "random", truth=True)
    panels = panels_of(drawn[0])
    left, known_m, true_m = (np.ma.asarray(axes.images[0].get_array()).T for axes in panels)
    np.testing.assert_allclose(true_m, 0.25 + 0.5 * heights)
    np.testing.assert_allclose(known_m[3:], 0.25 + 0.5 * heights[3:])
    assert np.ma.getmaskarray(known_m)[:3].all() and not np.ma.getmaskarray(known_m)[3:].any()
    np.testing.assert_allclose(left[:3], 1.0)
    np.testing.assert_allclose(left[3:], 0.0)
    assert all("from above" in axes.get_title() for axes in panels)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda solid: solid[2:4, 3, 4].fill(True), id="overhang"),
        pytest.param(lambda solid: solid[:, 1:].fill(False), id="empty"),
        pytest.param(lambda solid: solid[:, 1:].fill(True), id="walls to the roof"),
    ],
)
def test_what_is_no_open_ground_is_projected(change):
    solid = np.arange(5) < np.random.default_rng(2).integers(1, 4, (7, 11, 1))
    np.testing.assert_array_equal(pictures._open_ground(solid), solid.sum(axis=2))
    change(solid)
    assert pictures._open_ground(solid) is None


def test_a_volume_is_shown_from_above_and_from_the_side_at_all_heights(drawn):
    """A slab at each height hides nothing of the others: both appear in the view from the side."""
    solid = np.zeros((7, 11, 5), bool)
    solid[1, :, 1] = solid[4, :, 3] = True
    missions = Missions(free_box(robots=1, grid=GRID, world="given"), given=[World(GRID, solid, "shelves")])
    missions.reset(0, 0)
    missions.state.mean[0, 0], missions.state.precision[0, 0] = solid.ravel(), 1e6
    recorder = Recorder(missions)
    recorder.note()
    mission_picture(recorder, "shelves", "random", truth=True)
    sides = [axes for axes in drawn[0].axes if axes.images and axes.get_ylabel().startswith("z")]
    assert len(sides) == 3 and len(panels_of(drawn[0])) == 3
    for axes in sides[1:]:
        seen = np.ma.asarray(axes.images[0].get_array()).T
        assert sorted(map(tuple, np.argwhere(seen > 0.9))) == [(1, 1), (4, 3)]
        assert axes.images[0].get_extent() == [-2.0, 1.5, 0.25, 2.75]


def test_kinds_differ_in_their_marks_and_who_stopped_is_crossed_out(drawn):
    kinds = (RobotKind(Robot(motion="planar", sensor_height_m=1.0)),)
    faults = {"stop": {"at_s": 0.5, "robots": (1,)}}
    scenario = free_box(robots=3, grid=GRID, extra_kinds=kinds, faults=faults)
    mission_picture(recorded(started(scenario)), "box", "random")
    labels = [text.get_text() for text in drawn[0].legends[0].texts]
    assert labels == ["start", "end, flying robot", "end, ground robot", "stopped by a fault"]
    axes = panels_of(drawn[0])[0]
    assert [len(marks(axes, mark)) for mark in "svx"] == [2, 1, 1]


def test_coordinates_of_utm_are_written_from_a_round_number(drawn):
    far = Grid((7, 11, 1), 0.5, (448_262.0, 5_411_932.5, 0.0))
    mission_picture(recorded(started(free_box(robots=1, grid=far))), "box", "random")
    axes = panels_of(drawn[0])[0]
    assert axes.get_xlabel() == "x - 448,000 (m)" and axes.get_ylabel() == "y - 5,411,000 (m)"
    assert axes.yaxis.get_major_formatter()(5_411_934.5, 0) == "934.5"


def test_a_plan_is_no_open_ground():
    assert pictures._open_ground(np.random.default_rng(3).random((13, 9, 1)) < 0.9) is None


def test_heights_far_below_others_have_colours_of_their_own():
    """Of a cliff most ground is low and the plateau high: half of the columns get half of the colours."""
    low = np.linspace(0.4, 0.9, 60)
    scale = pictures._scale_of(np.concatenate([low, np.full(40, 3.0)]))
    assert scale(0.4) == 0.0 and scale(3.0) == 1.0 and 0.4 < scale(np.float64(low[50])) < 0.6
    even = pictures._scale_of(np.linspace(2.0, 4.0, 101))
    assert even(2.5) == pytest.approx(0.25) and even(3.0) == pytest.approx(0.5)
    assert pictures._scale_of(np.full((3, 4), 2.0))(2.0) == 0.0


def test_the_ellipse_lies_over_the_marks_which_are_hollow(drawn):
    mission_picture(recorded(started(free_box(robots=1, robot=DRIFT, grid=GRID))), "box", "random")
    axes = panels_of(drawn[0])[0]
    kinds = [line.get_marker() for line in axes.lines]
    assert kinds[-2:] == ["None", "None"] and len(axes.lines[-2].get_xdata()) > 8
    for line in axes.lines:
        if line.get_marker() in "sD":
            assert line.get_markerfacecolor() == "none"
