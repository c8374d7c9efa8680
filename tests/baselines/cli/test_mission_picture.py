"""The picture of a whole mission: its curves, and the true world below its end."""

from __future__ import annotations

import io

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from baselines.cli import mission_picture as pictures
from baselines.cli.mission_picture import mission_picture, true_world
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.painting import Painter
from entropy_explore_env.reports.recording import Recorder, poses_now
from entropy_explore_env.reports.rendering import Frame
from entropy_explore_env.settings.grid import Grid
from tests.reference.scenes import free_box, random_actions, started

GRID = Grid((7, 11, 5), 0.5, (-2.0, 1.0, 0.25))
DRIFT = {"localization": {"xy_m_per_sqrt_m": 0.2, "yaw_rad_per_sqrt_m": 0.05}}


def recorded(missions: Missions, steps: int = 6) -> tuple[Recorder, Frame]:
    """A mission of some random steps, and its last moment."""
    recorder, painter, rng = Recorder(missions), Painter("rgb_array"), np.random.default_rng(0)
    for step in range(steps + 1):
        if step:
            missions.step(*random_actions(missions, rng))
        recorder.note()
        painter.watch(missions)
    return recorder, painter.frame(missions)


@pytest.mark.parametrize("robot", [{}, DRIFT])
def test_the_true_world_has_the_robots_where_they_truly_are(robot):
    missions = started(free_box(robots=2, robot=robot, grid=GRID, world="furnished"))
    recorder, end = recorded(missions)
    shown = true_world(end, recorder)
    np.testing.assert_array_equal(shown.coverage.ravel(), missions.state.truth[0])
    np.testing.assert_allclose(shown.positions_m, poses_now(missions, 0)[:, :3])
    assert np.allclose(shown.positions_m, end.positions_m) == (not robot)
    assert shown.coverage.any() and not shown.entropy_share.any() and not len(shown.covariances_m2)


def test_the_true_world_stands_below_the_end():
    sizes = []
    for truth in (False, True):
        picture = mission_picture(*recorded(started(free_box(robots=2, grid=GRID))), "box", "random", truth)
        sizes.append(Image.open(io.BytesIO(picture)).size)
    assert sizes == [(1110, 830), (1110, 2 * 830)]


def test_labels_of_curves_have_room_below_maps_that_take_most_of_the_height(monkeypatch):
    figures: list[Figure] = []
    draw = pictures.png
    monkeypatch.setattr(pictures, "png", lambda figure: figures.append(figure) or draw(figure))
    terrain = Grid((70, 50, 35), 1.0, (0.0, 0.0, 0.0))
    picture = mission_picture(*recorded(started(free_box(robots=2, grid=terrain)), steps=1), "box", "random")
    assert Image.open(io.BytesIO(picture)).size[1] > 830
    for axes in figures[0].axes:
        box = axes.yaxis.label.get_window_extent()
        assert 0 <= box.y0 < box.y1 <= figures[0].bbox.height


@pytest.mark.parametrize(
    ("robots", "content", "label"),
    [(2, "measurements", "measurements"), (2, "summaries", "kbit"), (1, "measurements", "scans")],
)
def test_curves_are_of_entropy_and_of_what_a_team_sends(monkeypatch, robots, content, label):
    figures: list[Figure] = []
    draw = pictures.png
    monkeypatch.setattr(pictures, "png", lambda figure: figures.append(figure) or draw(figure))
    channel = {"content": content, "summary_every_s": 0.5} if content == "summaries" else {}
    recorder, end = recorded(started(free_box(robots=robots, grid=GRID, channel=channel)))
    mission_picture(recorder, end, "box", "random")
    entropies, sent = figures[0].axes
    drawn = np.stack([line.get_ydata() for line in entropies.lines[:robots]], axis=1)
    np.testing.assert_allclose(1000 * drawn, recorder.series().entropy_bits)
    state = recorder.missions.state.robots[0]
    found = {"measurements": state["measurements_sent"], "kbit": state["bits_sent"] / 1000}
    assert label in sent.get_ylabel()
    assert sent.lines[0].get_ydata()[-1] == pytest.approx(found.get(label, state["scans"]).sum())
