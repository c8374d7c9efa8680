"""Pictures of missions: what lies where, on worlds with no two edges equal."""

import dataclasses

import numpy as np
import pytest
from PIL import Image, ImageDraw

from entropy_explore_env.errors import SettingError
from entropy_explore_env.reports import annotations
from entropy_explore_env.reports.annotations import Box, Mark, draw_legend, legend_rows
from entropy_explore_env.reports.colours import COLOURS, INK, PAPER, ROBOT_COLOURS, UNKNOWN_COLOUR
from entropy_explore_env.reports.page_layout import View, lay_out
from entropy_explore_env.reports.rendering import Frame, draw_frame

SHAPE = (7, 11, 5)
VOXEL_M = 0.5
PLAIN = (Mark.VIEWPOINT,)
ORIGIN_M = np.array([-2.0, 1.0, 0.25])
WORLDS = [(7, 11, 5), (41, 41, 17), (120, 80, 1), (300, 120, 30), (20, 23, 90), (400, 40, 1), (1, 2, 3)]


def frame_of(shape: tuple[int, int, int] = SHAPE, robots: int = 2, times: int = 9) -> Frame:
    """A mission in which nothing is known and the robots stand in the workspace's lower corner."""
    corner = np.tile(ORIGIN_M, (robots, 1))
    return Frame(
        entropy_share=np.ones(shape, np.float32),
        coverage=np.full(shape, 0.5, np.float32),
        voxel_size_m=VOXEL_M,
        origin_m=ORIGIN_M,
        positions_m=corner,
        gazes_rad=np.zeros((robots, 2)),
        targets_m=np.full((robots, 3), np.nan),
        paths_m=[],
        curve_s=np.linspace(0.0, 60.0, times),
        curve_share=np.linspace(1.0, 0.4, times)[:, None] * np.ones(robots),
        title="box, nobody moves",
        status=("t 60 s", "entropy 40 %"),
    )


def views_of(frame: Frame, width: int = 640, height: int = 480) -> dict[tuple[str, int], View]:
    """The maps of the picture by what they show and the axis that points up."""
    shape, robots = frame.entropy_share.shape, len(frame.positions_m)
    layout = lay_out(shape, frame.voxel_size_m, robots, frame.marks, len(frame.status), width, height)
    return {(view.quantity, view.up): view for view in layout.views}


def part(picture: np.ndarray, box: Box) -> np.ndarray:
    """What lies inside a box of a picture; not a copy."""
    return picture[box.top : box.bottom, box.left : box.right]


def pixel_of(view: View, voxel: tuple[float, float, float]) -> tuple[int, int]:
    """Row and column of a place in voxels, worked out by hand: x to the right, `up` upwards."""
    column = view.left + voxel[0] / SHAPE[0] * view.width
    row = view.top + view.height - voxel[view.up] / SHAPE[view.up] * view.height
    return int(row), int(column)


@pytest.mark.parametrize("shape", WORLDS)
@pytest.mark.parametrize("robots", [0, 12])
def test_picture_has_the_wanted_size_and_maps_their_proportions_and_places(
    shape: tuple[int, int, int], robots: int
) -> None:
    frame = frame_of(shape, robots)
    for width, height in ((640, 480), (480, 360), (1280, 720)):
        picture = draw_frame(frame, width, height)
        assert picture.shape == (height, width, 3)
        assert picture.dtype == np.uint8
        views = views_of(frame, width, height)
        ups = (1,) if shape[2] == 1 else (1, 2)
        assert set(views) == {(quantity, up) for quantity in ("entropy", "coverage") for up in ups}
        taken = np.zeros((height, width), int)
        for (_, up), view in views.items():
            taken[view.top : view.top + view.height, view.left : view.left + view.width] += 1
            assert view.left >= 0 and view.top >= 0
            assert view.left + view.width <= width and view.top + view.height <= height
            voxel_px = view.width / shape[0]
            assert abs(view.height - voxel_px * shape[up]) <= 1 + 0.5 * shape[up] / shape[0]
        assert taken.max() == 1


def metres(*voxels: tuple[float, float, float]) -> np.ndarray:
    """Return places in the map frame (N, 3) of places in voxels."""
    return ORIGIN_M + VOXEL_M * np.array(voxels)


HERE = (3.5, 5.5, 2.5)
WAY = [metres((0.5, 9.5, 4.5), (4.5, 9.5, 4.5))]
DRAWN = [
    ({"positions_m": metres(HERE)}, HERE, 1, (0, 0), ROBOT_COLOURS[0]),
    ({"positions_m": metres(HERE)}, HERE, 2, (0, 0), ROBOT_COLOURS[0]),
    ({"targets_m": metres(HERE)}, HERE, 1, (4, 0), ROBOT_COLOURS[0]),  # a ring
    ({"targets_m": metres(HERE)}, HERE, 1, (0, -4), ROBOT_COLOURS[0]),
    ({"targets_m": metres(HERE)}, HERE, 1, (0, 0), None),
    ({"paths_m": WAY}, (1.0, 9.5, 4.5), 1, (0, 0), ROBOT_COLOURS[0]),
    ({"paths_m": WAY}, (2.5, 9.5, 4.5), 1, (0, 0), ROBOT_COLOURS[0]),
    ({"paths_m": WAY}, (4.0, 9.5, 4.5), 2, (0, 0), ROBOT_COLOURS[0]),
    ({"positions_m": metres(HERE), "stopped": (0,)}, HERE, 2, (0, 0), INK),  # a cross
    ({"fiducials_m": metres(HERE)}, HERE, 1, (0, 0), PAPER),  # a light triangle
    ({"fiducials_m": metres(HERE)}, HERE, 2, (0, 0), PAPER),
    ({"true_m": metres(HERE)}, HERE, 1, (0, 0), PAPER),
    ({"positions_m": metres(HERE), "true_m": metres(HERE)}, HERE, 1, (0, 0), PAPER),  # it stands out
]


@pytest.mark.parametrize(("changes", "voxel", "up", "offset", "colour"), DRAWN)
def test_marks_are_drawn_where_they_lie(changes, voxel, up, offset, colour) -> None:
    """No colour: nothing is drawn there."""
    plain = frame_of(robots=1)
    frame = dataclasses.replace(plain, **changes)
    for quantity in ("entropy", "coverage"):
        row, column = pixel_of(views_of(frame)[quantity, up], voxel)
        at = (row + offset[0], column + offset[1])
        assert tuple(draw_frame(frame)[at]) == (colour or tuple(draw_frame(plain)[at]))


@pytest.mark.parametrize(
    ("gaze", "up", "offset"),
    [
        ((0.0, 0.0), 1, (0, 9)),
        ((np.pi / 2, 0.0), 1, (-9, 0)),
        ((np.pi, 0.0), 2, (0, -9)),
        ((0.0, np.pi / 2), 2, (9, 0)),
    ],
)
def test_gazes_point_by_yaw_from_above_and_by_pitch_downwards_from_the_side(gaze, up, offset) -> None:
    frame = dataclasses.replace(frame_of(robots=1), positions_m=metres(HERE), gazes_rad=np.array([gaze]))
    picture, (row, column) = draw_frame(frame), pixel_of(views_of(frame)["entropy", up], HERE)
    assert tuple(picture[row + offset[0], column + offset[1]]) == ROBOT_COLOURS[0]
    assert tuple(picture[row - offset[0], column - offset[1]]) != ROBOT_COLOURS[0]


def test_one_known_voxel_lights_its_own_rectangle_of_the_coverage_maps() -> None:
    voxel = (5, 2, 3)
    frame = frame_of(robots=0)
    frame.entropy_share[voxel], frame.coverage[voxel] = 0.0, 1.0
    picture, views = draw_frame(frame), views_of(frame)
    for up in (1, 2):
        view = views["coverage", up]
        lit = (part(picture, view) != UNKNOWN_COLOUR).any(axis=-1)
        rows, columns = np.nonzero(lit)
        assert lit[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1].all()
        edges = np.array([columns.min(), columns.max() + 1]) * SHAPE[0] / view.width
        np.testing.assert_allclose(edges, [5, 6], atol=SHAPE[0] / view.width)
        edges = (view.height - np.array([rows.max() + 1, rows.min()])) * SHAPE[up] / view.height
        np.testing.assert_allclose(edges, [voxel[up], voxel[up] + 1], atol=SHAPE[up] / view.height)
        assert (part(picture, view)[lit] == COLOURS["coverage"][254]).all()


def test_entropy_maps_show_the_mean_along_the_line_of_sight() -> None:
    frame = frame_of(robots=0)
    frame.entropy_share[2, 7] = [0.0, 0.0, 0.0, 1.0, 1.0]
    picture, views = draw_frame(frame), views_of(frame)
    above = picture[pixel_of(views["entropy", 1], (2.5, 7.5, 0.0))]
    side = picture[pixel_of(views["entropy", 2], (2.5, 0.0, 0.5))]
    np.testing.assert_array_equal(above, COLOURS["entropy"][round(0.4 * 255)])
    np.testing.assert_array_equal(side, COLOURS["entropy"][round(10 / 11 * 255)])


def test_a_wall_one_voxel_thick_stays_visible_in_a_world_larger_than_the_picture() -> None:
    frame = frame_of((1000, 700, 1), robots=0)
    frame.entropy_share[:] = 0.0
    frame.coverage[:] = 0.0
    frame.coverage[333, 100:600] = 1.0
    view = views_of(frame)["coverage", 1]
    dark = (part(draw_frame(frame), view) == COLOURS["coverage"][254]).all(axis=-1)
    columns = np.flatnonzero(dark.any(axis=0))
    assert len(columns) == 1
    assert abs(columns[0] - 333.5 / 1000 * view.width) <= 1
    assert abs(dark.sum() - 500 / 700 * view.height) <= 2


def test_entropy_is_averaged_not_sampled_in_a_world_larger_than_the_picture() -> None:
    frame = frame_of((1000, 700, 1), robots=0)
    frame.entropy_share[::2] = 0.0
    view = views_of(frame)["entropy", 1]
    seen = np.unique(part(draw_frame(frame), view).reshape(-1, 3), axis=0)
    assert {tuple(colour) for colour in seen} <= {tuple(c) for c in COLOURS["entropy"][80:176]}


def test_drawing_changes_none_of_its_inputs() -> None:
    frame = dataclasses.replace(frame_of(), paths_m=[np.zeros((4, 3)), np.ones((2, 3))])
    arrays = [value for value in vars(frame).values() if isinstance(value, np.ndarray)] + frame.paths_m
    before = [array.copy() for array in arrays]
    for array in arrays:
        array.setflags(write=False)
    first = draw_frame(frame)
    first[:] = 0
    second, third = draw_frame(frame), draw_frame(frame)
    np.testing.assert_array_equal(second, third)
    assert second.any()
    for array, copy in zip(arrays, before, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_curves_begin_at_the_upper_left_and_end_at_the_last_time() -> None:
    times, shares = np.array([0.0, 30.0]), np.array([[1.0], [0.0]])
    picture = draw_frame(dataclasses.replace(frame_of(robots=1), curve_s=times, curve_share=shares))
    box = lay_out(SHAPE, VOXEL_M, 1, PLAIN, 2, 640, 480).curves
    assert tuple(picture[box.top, box.left]) == ROBOT_COLOURS[0]
    assert tuple(picture[box.top + box.height - 1, box.left + box.width - 1]) == ROBOT_COLOURS[0]
    y, x = box.height // 2, box.width // 2
    middle = part(picture, box)[y - 3 : y + 3, x - 3 : x + 3]
    assert (middle == ROBOT_COLOURS[0]).all(axis=-1).any()


def test_points_that_are_far_away_or_not_finite_are_no_trouble() -> None:
    frame = dataclasses.replace(
        frame_of(robots=2),
        positions_m=np.array([[1e12, -1e12, 0.0], [np.nan, 0.0, 0.0]]),
        paths_m=[np.array([[-1e30, 0.0, 0.0], [1e30, 5.0, 1.0]]), np.zeros((0, 3))],
    )
    assert draw_frame(frame).shape == (480, 640, 3)


def test_frame_and_picture_name_what_does_not_fit() -> None:
    frame = frame_of(robots=2)
    for name, value in (
        ("coverage", np.zeros((7, 11, 4))),
        ("targets_m", np.zeros((1, 3))),
        ("gazes_rad", np.zeros((2, 3))),
        ("curve_share", np.zeros((9, 1))),
        ("paths_m", [np.zeros((1, 3))]),
        ("covariances_m2", np.zeros((1, 3, 3))),
        ("fiducials_m", np.zeros((2, 2))),
    ):
        with pytest.raises(SettingError, match=name):
            dataclasses.replace(frame, **{name: value})
    with pytest.raises(SettingError, match="width"):
        draw_frame(frame, 100, 480)
    with pytest.raises(SettingError, match="height"):
        draw_frame(frame, 640, 100)


def test_nothing_of_a_robot_leaves_the_map() -> None:
    """Robots in all corners, looking and going outwards; paths and targets beyond the workspace."""
    size = np.array(SHAPE) * VOXEL_M
    corners = ORIGIN_M + size * np.array([[x, y, x] for x in (0, 1) for y in (0, 1)])
    outwards = np.array([[np.arctan2(2 * y - 1, 2 * x - 1), 0.5 - x] for x in (0, 1) for y in (0, 1)])
    nobody = dataclasses.replace(frame_of(robots=4), positions_m=np.full((4, 3), np.nan))
    frame = dataclasses.replace(
        frame_of(robots=4),
        positions_m=corners,
        gazes_rad=outwards,
        targets_m=corners + (corners - ORIGIN_M - size / 2) * 0.1,
        paths_m=[np.stack([corner, corner * 3 - 2 * ORIGIN_M - size]) for corner in corners],
    )
    empty, full = draw_frame(nobody), draw_frame(frame)
    for view in views_of(frame).values():
        inside = part(full, view)
        for robot in range(4) if view.up == 1 else (1, 3):  # from the side two hide the others
            drawn = (inside == ROBOT_COLOURS[robot]).all(axis=-1).sum()
            assert drawn > 45, "a whole disc has 49 pixels"
        part(empty, view)[:] = part(full, view)[:] = 0
    np.testing.assert_array_equal(empty, full)


def test_thin_side_views_are_drawn_higher_and_say_so() -> None:
    frame = frame_of((300, 200, 4), robots=1)
    views = views_of(frame)
    above, side = views["entropy", 1], views["entropy", 2]
    voxel_px = above.width / 300
    assert above.height == pytest.approx(200 * voxel_px, abs=1) and above.stretch == 1.0
    assert side.height == 16 and side.stretch == pytest.approx(16 / (4 * voxel_px), rel=0.01)
    assert side.title == f"entropy, from the side, height x {side.stretch:.1f}"
    assert "height" not in above.title + views_of(frame_of())["entropy", 2].title
    frame.entropy_share[:, :, 3] = 0.0
    nobody = dataclasses.replace(frame, positions_m=np.full((1, 3), np.nan))
    picture = part(draw_frame(nobody), side)
    assert (picture[:4] == COLOURS["entropy"][0]).all() and (picture[4:] == COLOURS["entropy"][255]).all()
    assert side.left + side.width <= 640 and max(v.top + v.height for v in views.values()) < 480


def test_text_stays_in_the_picture_however_long_it_is() -> None:
    short = dataclasses.replace(frame_of(), title="a", status=("b",) * 12)
    long = dataclasses.replace(short, title="Größe " * 99, status=("c" * 999,) * 12)
    assert (draw_frame(short) != draw_frame(long)).any()
    layout = lay_out(SHAPE, VOXEL_M, 2, tuple(Mark), 8, 640, 480)
    for frame in (short, long):
        picture = draw_frame(frame)
        assert (picture[:, -4:] == PAPER).all(), "nothing runs over the edge"
        lines = part(picture, layout.status)
        ink = (lines != PAPER).any(axis=(1, 2))
        assert np.count_nonzero(np.diff(ink.astype(int)) == 1) == 8, "eight lines"


@pytest.mark.parametrize("up", [1, 2])
def test_an_ellipse_of_two_standard_deviations_is_drawn_around_an_estimate(up: int) -> None:
    """A quarter of a metre along x, half of that upwards: it reaches twice as far."""
    place, along, upwards = (3.5, 5.5, 2.5), 2.0 * 0.25, 2.0 * 0.125
    frame = frame_of(robots=1)
    position = (ORIGIN_M + np.array(place) * VOXEL_M)[None]
    variances = np.full(3, 1e-6)
    variances[0], variances[up] = 0.25**2, 0.125**2
    frame = dataclasses.replace(frame, positions_m=position, targets_m=np.full((1, 3), np.nan))
    drawn = dataclasses.replace(frame, covariances_m2=np.diag(variances)[None])
    before, after = draw_frame(frame), draw_frame(drawn)
    view = views_of(frame)["coverage", up]
    changed = (before != after).any(axis=2)
    for right, above in ((along, 0.0), (-along, 0.0), (0.0, upwards), (0.0, -upwards)):
        voxel = list(place)
        voxel[0] += right / VOXEL_M
        voxel[up] += above / VOXEL_M
        row, column = pixel_of(view, tuple(voxel))
        assert changed[row - 1 : row + 2, column - 1 : column + 2].any()
    row, column = pixel_of(view, place)
    assert not changed[row, column]


def test_the_legend_explains_what_is_marked_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line for each mark, below the robots, and none of them outside the legend's box."""
    frame = frame_of(robots=3)
    assert frame.marks == PLAIN
    drifting = dataclasses.replace(
        frame, covariances_m2=np.zeros((3, 3, 3)), true_m=frame.positions_m, fiducials_m=np.zeros((4, 3))
    )
    assert drifting.marks == tuple(mark for mark in Mark if mark is not Mark.STOPPED)
    assert dataclasses.replace(drifting, stopped=(1,)).marks == tuple(Mark)
    written: dict[str, float] = {}
    monkeypatch.setattr(annotations, "write", lambda _, place, text, *__: written.update({text: place[1]}))
    for marks in (PLAIN, tuple(Mark)):
        written.clear()
        page = Image.new("RGB", (200, 200), PAPER)
        box = Box(20, 30, 150, 14 * legend_rows(3, marks))
        draw_legend(ImageDraw.Draw(page), box, 3, marks, 1)
        assert list(written) == ["robot 0", "robot 1", "robot 2", *(mark.value for mark in marks)]
        assert list(written.values()) == [37.0, 37.0, 51.0, *(65.0 + 14.0 * row for row in range(len(marks)))]
        drawn = np.argwhere((np.asarray(page) != PAPER).any(axis=2))
        assert drawn.min() >= 20 and drawn[:, 0].max() < box.bottom
