"""From missions to pictures: what is shown, of which moment, and that nothing is done unasked."""

import math

import numpy as np
import pytest

from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports import painting
from entropy_explore_env.reports.painting import Painter, entropy_share, remaining_share
from entropy_explore_env.reports.recording import poses_now
from entropy_explore_env.reports.rendering import Frame, draw_frame
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import free_box, random_actions, started, wander

FLAT = {"grid": Grid((13, 9, 1), 0.5, (-3.0, 1.0, 0.0)), "world": "furnished"}
SCENES = [pytest.param({}, id="box"), pytest.param(FLAT, id="flat")]


def watch(missions: Missions, painter: Painter, steps: int) -> None:
    """Watch the moment and some steps."""
    rng = np.random.default_rng(0)
    for step in range(steps + 1):
        if step:
            missions.step(*random_actions(missions, rng))
        painter.watch(missions)


@pytest.fixture
def frames(monkeypatch):
    """The frames that were drawn."""
    drawn: list[Frame] = []

    def draw(frame: Frame) -> np.ndarray:
        drawn.append(frame)
        return draw_frame(frame)

    monkeypatch.setattr(painting, "draw_frame", draw)
    return drawn


# --- shares


def test_a_robot_s_shares_run_from_the_prior_to_sigma_end():
    """h is linear in log σ: from σ = 30 to 0.03 a tenth of it each factor of 10^0.3."""
    missions = started(free_box(robots=2), missions=2)
    missions.precision[1, 1][6, 10, 4] = (30.0 * 10**-1.5) ** -2
    expected = np.ones((7, 11, 5))
    for mission, robot in ((0, 1), (1, 0)):
        np.testing.assert_array_equal(entropy_share(missions, mission, robot), expected)
    expected[6, 10, 4] = 0.5
    np.testing.assert_allclose(entropy_share(missions, 1, 1), expected, atol=1e-5)


def test_what_remains_runs_from_one_to_nought():
    missions = started(free_box(robots=3), missions=2)
    assert remaining_share(missions, 0).tolist() == [1.0, 1.0, 1.0]
    clock = missions.state.missions[1]
    clock["entropy_start_bits"], clock["entropy_end_bits"] = 1000.0, -200.0
    missions.state.robots[1]["entropy_bits"] = [1000.0, 400.0, -200.0]
    assert remaining_share(missions, 1).tolist() == pytest.approx([1.0, 0.5, 0.0])


# --- pictures


@pytest.mark.parametrize("changes", SCENES)
def test_a_picture_shows_the_first_mission_as_robot_0_knows_it(changes, frames):
    missions = started(free_box(robots=3, **changes), seed=3, missions=2)
    painter = Painter("rgb_array")
    rng, times, shares, starts = np.random.default_rng(0), [], [], poses_now(missions, 0)[:, :3]
    for _ in range(6):
        missions.step(*random_actions(missions, rng))
        painter.watch(missions)
        times.append(float(missions.state.missions[0]["time_s"]))
        shares.append(remaining_share(missions, 0))
    painter.paint(missions)
    (frame,) = frames
    robots, grid = missions.state.robots[0], missions.grid
    np.testing.assert_array_equal(frame.entropy_share, entropy_share(missions, 0, 0))
    np.testing.assert_array_equal(frame.coverage, missions.mean[0, 0])
    assert frame.voxel_size_m == grid.voxel_size_m and frame.origin_m.tolist() == list(grid.origin_m)
    np.testing.assert_array_equal(frame.targets_m, robots["target"][:, :3])
    assert frame.curve_s.tolist() == times
    np.testing.assert_array_equal(frame.curve_share, shares)
    here = robots["deciding"]
    np.testing.assert_allclose(frame.positions_m[here], robots["goal"][here, :3])
    np.testing.assert_allclose(frame.gazes_rad[here], robots["goal"][here, 3:])
    assert here.any() and len(frame.paths_m) == 3
    for robot, path in enumerate(frame.paths_m):
        np.testing.assert_array_equal(path[0], starts[robot])
        np.testing.assert_array_equal(path[-1], frame.positions_m[robot])
        driven_m = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        assert 0.0 < driven_m == pytest.approx(robots["distance_m"][robot])
    assert "box-7x11x5" in frame.title and "robot_0" in frame.title
    said = " ".join(frame.status)
    assert f"time {times[-1]:,.0f} s" in said and f"scans {robots['scans'].sum():,}" in said
    assert f"rays sent {robots['measurements_sent'].sum():,}" in said


def test_pictures_name_the_world_of_their_own_mission(frames):
    grid = Grid((9, 12, 7), 0.5)
    given = [World(grid, np.zeros(grid.shape, bool), name) for name in ("kitchen", "cellar")]
    missions = Missions(free_box(robots=2), 2, given=given)
    missions.reset_some(range(2), [4, 5])
    for number in range(2):
        painter = Painter("rgb_array", number)
        painter.watch(missions)
        painter.paint(missions)
    assert [frame.title.split(":")[0] for frame in frames] == ["kitchen", "cellar"]


def test_a_robot_under_way_is_drawn_where_it_is(frames):
    """From rest at 1 m/s² for 0.5 s: an eighth of a metre on its way along x."""
    robot = {"max_speed_m_s": 1.0, "acceleration_m_s2": 1.0, "turn_rate_rad_s": math.inf}
    missions = started(free_box(robots=1, decision_period_s=0.5, robot=robot), seed=3)
    for field in ("origin", "goal", "target", "scan_pose"):
        missions.state.robots[0, 0][field] = (0.75, 2.75, 1.25, 0.0, 0.0)
    missions.step(np.array([[[1.0, 0.0, 0.0, 0.0, 0.0]]]), np.zeros((1, 1), np.int64))
    Painter("rgb_array").paint(missions)
    (frame,) = frames
    assert frame.positions_m[0] == pytest.approx((0.875, 2.75, 1.25))
    assert frame.targets_m[0] == pytest.approx((1.75, 2.75, 1.25))


@pytest.mark.parametrize("steps", [0, 5])
@pytest.mark.parametrize("changes", SCENES)
def test_a_painter_forgets_at_a_reset(changes, steps, frames):
    """Also when nothing had happened yet."""
    missions = started(free_box(robots=2, **changes), seed=3)
    painter = Painter("rgb_array")
    watch(missions, painter, steps)
    missions.reset(0, 8)
    painter.watch(missions)
    fresh = Painter("rgb_array")
    fresh.watch(missions)
    np.testing.assert_array_equal(painter.paint(missions), fresh.paint(missions))
    assert frames[0].curve_s.tolist() == [0.0]
    assert [len(path) for path in frames[0].paths_m] == [2, 2]


# --- modes


def test_without_a_mode_nothing_is_painted_and_a_warning_says_why(monkeypatch):
    def must_not(*_: object, **__: object) -> None:
        raise AssertionError("something was painted")

    for name in ("draw_frame", "Window", "remaining_share", "entropy_share"):
        monkeypatch.setattr(painting, name, must_not)
    missions = started(free_box(robots=2), seed=3)
    painter = Painter(None)
    watch(missions, painter, 3)
    with pytest.warns(UserWarning, match="give the environment render_mode"):
        assert painter.picture(missions) is None
    painter.close()


def test_robots_that_drift_are_drawn_where_they_believe_to_be(frames):
    missions = started(free_box(robot={"localization": {"xy_m_per_sqrt_m": 0.1}}, decision_period_s=1.0))
    wander(missions, 8, 0)
    Painter("rgb_array").paint(missions)
    frame, estimates = frames[-1], missions.state.estimates[0]
    views = [view_of(missions, 0, robot) for robot in range(2)]
    np.testing.assert_array_equal(frame.positions_m, [view.pose[:3] for view in views])
    np.testing.assert_array_equal(frame.true_m, poses_now(missions, 0)[:, :3])
    np.testing.assert_array_equal(frame.covariances_m2, estimates["covariance"][:, :3, :3])
    assert (frame.true_m[:, :2] != frame.positions_m[:, :2]).all()
    largest = np.linalg.norm(estimates["error"][:, :3], axis=1).max()
    assert frame.status[-1] == f"pose error {largest:.2f} m at most"


def test_a_picture_says_how_many_robots_have_stopped(frames):
    """Only where faults happen; whose body stands there is crossed out."""
    for faults in ({}, {"stop": {"at_s": 0.001, "robots": (1,)}}):
        missions = started(free_box(robots=3, faults=faults))
        painter = Painter("rgb_array")
        watch(missions, painter, 2)
        painter.paint(missions)
    sound, failing = frames[-2], frames[-1]
    assert not any(line.startswith("stopped") for line in sound.status) and list(sound.stopped) == []
    assert "stopped 1 of 3" in failing.status and list(failing.stopped) == [1]
