"""Recordings for Rerun, read back with its own reader and held against the mission."""

import math
import sys
from itertools import pairwise

import numpy as np
import pytest

from entropy_explore_env.errors import MissingExtraError
from entropy_explore_env.reports import rerun_view
from entropy_explore_env.reports.painting import entropy_share, remaining_share
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.reports.rerun_view import RerunView, cone_edges, shared_ends_m
from entropy_explore_env.settings.sensor import RangeSensor
from tests.reference.scenes import free_box, random_actions, started


def recorded(path, steps: int = 40, scenario=None):
    """A mission of random actions, written to a file; its series, and what was left of its entropy."""
    missions = started(scenario or free_box(robots=2, grid=free_box().grid), seed=4)
    recorder, rng, left = Recorder(missions), np.random.default_rng(0), []
    with RerunView(missions, path) as view:
        for step in range(steps + 1):
            if step:
                missions.step(*random_actions(missions, rng))
            recorder.note()
            left.append(remaining_share(missions, 0))
            view.note()
        view.finish()
    return missions, recorder.series(), np.stack(left)


class Recording:
    """Everything in an .rrd: entity → its rows (seconds or None, component → list), in order."""

    def __init__(self, path) -> None:
        chunk = pytest.importorskip("rerun.chunk")
        self.rows: dict[str, list[tuple[float | None, dict]]] = {}
        self.timelines: set[str] = set()
        for each in chunk.RrdReader(str(path)).stream().to_chunks():
            if each.entity_path.startswith("/__"):
                continue
            self.timelines |= set(each.timeline_names)
            batch = each.to_record_batch()
            columns = {name: batch.column(place) for place, name in enumerate(batch.schema.names)}
            for row in range(batch.num_rows):
                nanoseconds = columns["simulated"][row].value if "simulated" in columns else None
                seconds = None if nanoseconds is None else nanoseconds * 1e-9
                parts = {name: column for name, column in columns.items() if ":" in name}
                values = {name: column[row].as_py() for name, column in parts.items()}
                self.rows.setdefault(each.entity_path, []).append((seconds, values))
        for rows in self.rows.values():
            rows.sort(key=lambda row: -1.0 if row[0] is None else row[0])

    def series(self, entity: str, component: str) -> tuple[np.ndarray, np.ndarray]:
        """Times (N,) and values of a component that is one a row."""
        rows = [row for row in self.rows[entity] if row[0] is not None]
        return np.array([row[0] for row in rows]), np.array([row[1][component][0] for row in rows])


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    pytest.importorskip("rerun")
    path = tmp_path_factory.mktemp("rerun") / "box.rrd"
    return *recorded(path), Recording(path)


def test_entities_and_the_one_timeline(box):
    _missions, series, _, recording = box
    assert recording.timelines == {"simulated"}
    wanted = {"/world", "/world/workspace", "/shared_measurements"}
    for robot in ("robot_0", "robot_1"):
        wanted |= {f"/world/{kind}/{robot}" for kind in ("robots", "cones", "shared")}
        wanted |= {f"/world/robots/{robot}/body", f"/world/paths/{robot}/0000", f"/entropy_left/{robot}"}
    wanted |= {f"/world/{kind}/0_{y}_0" for kind in ("entropy", "coverage") for y in (0, 1)}
    assert wanted == set(recording.rows)
    times = [row[0] for rows in recording.rows.values() for row in rows if row[0] is not None]
    assert min(times) == 0.0 and max(times) == pytest.approx(series.time_s[-1], abs=1e-8)


@pytest.mark.parametrize("robot", [0, 1])
def test_poses_are_the_recorder_s(robot, box):
    _, series, left, recording = box
    entity = f"/world/robots/robot_{robot}"
    times, places = recording.series(entity, "Transform3D:translation")
    np.testing.assert_allclose(times, series.time_s, atol=1e-8)
    np.testing.assert_array_equal(places.astype(np.float32), series.poses[:, robot, :3].astype(np.float32))
    _, turned = recording.series(entity, "Transform3D:quaternion")
    yaw, pitch = series.poses[:, robot, 3:].T
    gaze = np.stack([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)], axis=-1)
    x, y, z, w = turned.T  # the first column of the rotation: where the robot's x axis points
    ahead = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=-1)
    np.testing.assert_allclose(ahead, gaze, atol=1e-6)
    times, shares = recording.series(f"/entropy_left/robot_{robot}", "Scalars:scalars")
    np.testing.assert_array_equal(shares, left[:, robot])


def test_paths_lead_through_every_place(box):
    _missions, series, _, recording = box
    (path,) = recording.rows["/world/paths/robot_1/0000"][-1][1]["LineStrips3D:strips"]
    places = series.poses[:, 1, :3]
    moved = np.concatenate([[True], (np.diff(places, axis=0) != 0).any(axis=1)])
    np.testing.assert_array_equal(np.float32(path), places[moved].astype(np.float32))


def test_long_paths_come_in_parts_that_hang_together(tmp_path, monkeypatch):
    pytest.importorskip("rerun")
    monkeypatch.setattr(rerun_view, "_PART", 7)
    _missions, series, _ = recorded(tmp_path / "m.rrd")
    recording = Recording(tmp_path / "m.rrd")
    parts = sorted(entity for entity in recording.rows if entity.startswith("/world/paths/robot_0/"))
    strips = [recording.rows[part][-1][1]["LineStrips3D:strips"][0] for part in parts]
    assert len(parts) > 3 and all(len(strip) == 8 for strip in strips[:-1])
    for before, after in pairwise(strips):
        assert before[-1] == after[0]
    assert strips[-1][-1] == series.poses[-1, 0, :3].astype(np.float32).tolist()


def test_in_the_end_the_voxels_are_those_of_the_belief(box):
    missions, _series, _, recording = box
    grid, share, mean = missions.grid, entropy_share(missions, 0, 0), missions.mean[0, 0]
    for kind, component, wanted in (
        ("entropy", "Points3D:positions", share < 0.9),
        ("coverage", "Boxes3D:centers", (share < 0.9) & (mean > 0.5)),
    ):
        blocks = [rows for entity, rows in recording.rows.items() if entity.startswith(f"/world/{kind}/")]
        shown = [place for rows in blocks for place in rows[-1][1][component] or []]
        voxels = grid.voxel_of(np.reshape(shown, (-1, 3)))
        seen = np.zeros(grid.shape, bool)
        seen[tuple(voxels.T)] = True
        assert len(shown) == seen.sum()
        np.testing.assert_array_equal(seen, wanted)
    assert 0 < wanted.sum() < (share < 0.9).sum()


def test_shared_rays_begin_at_the_scan_and_end_where_something_was_measured(box):
    missions, _series, _, recording = box
    rows = recording.rows["/world/shared/robot_0"]
    batches = [row[1]["LineStrips3D:strips"] for row in rows]
    assert {len(batch) for batch in batches} <= set(range(9)) and any(batches)
    low = np.asarray(missions.grid.origin_m) - 1e-3
    high = low + missions.grid.size_m + 2e-3
    for batch in batches:
        assert len({tuple(ray[0]) for ray in batch}) <= 1
        for ray in batch:
            assert (np.array(ray[1]) >= low).all() and (np.array(ray[1]) <= high).all()
    sent = missions.state.robots[0, 0]["measurements_sent"]
    assert sum(map(len, batches)) == sent > 0


def test_ends_of_shared_rays_by_hand():
    """Level rays to the front, 5° apart; the two most useful of those that are worth it."""
    missions = started(free_box(robots=2, channel={"burst": 2, "i_min_bits": 0.5}), seed=1)
    sensor = missions.scenario.sensor
    rows, columns = sensor.rows, sensor.columns
    own = missions.state.robots[0, 0]
    own["scan_pose"] = (1.0, 2.0, 1.5, math.pi / 2, 0.1)
    utility, ranges = missions.state.scan_utility_bits[0, 0], missions.state.scan_range_m[0, 0]
    returned = missions.state.scan_returned[0, 0]
    for ray, bits, range_m, code in (
        (3, 0.4, 1.0, 2),
        (rows, 0.6, 2.0, 2),
        (0, 0.9, 3.0, 1),
        (5, 2.0, 1.0, 0),
    ):
        utility[ray], ranges[ray], returned[ray] = bits, range_m, code
    step, top = sensor.angular_step_rad, 0.1 - (rows - 1) / 2 * sensor.angular_step_rad
    expected = []
    for column, range_m in ((0, 3.0), (1, 2.0)):
        yaw = math.pi / 2 + (column - (columns - 1) / 2) * step
        level = math.cos(top) * range_m
        expected.append([1 + level * math.cos(yaw), 2 + level * math.sin(yaw), 1.5 - math.sin(top) * range_m])
    np.testing.assert_allclose(shared_ends_m(missions, 0), expected, atol=1e-12)


def test_cones_by_hand():
    flat = cone_edges(RangeSensor((math.pi / 2, 0.0), math.pi / 4), yaw=math.pi / 4, pitch=0.0)
    arc, sides = flat
    assert len(flat) == 2
    np.testing.assert_allclose(arc[[0, -1]], [(1, 0, 0), (0, 1, 0)], atol=1e-12)
    np.testing.assert_allclose(sides, [(1, 0, 0), (0, 0, 0), (0, 1, 0)], atol=1e-12)
    deep = cone_edges(RangeSensor((0.0, math.pi / 2), math.pi / 4), yaw=0.0, pitch=math.pi / 4)
    assert len(deep) == 4
    np.testing.assert_allclose(deep[0][0], (0, 0, -1), atol=1e-12)  # pitch is downwards
    np.testing.assert_allclose(deep[1][0], (1, 0, 0), atol=1e-12)


def test_large_worlds_are_shown_by_larger_cells(tmp_path, monkeypatch):
    pytest.importorskip("rerun")
    monkeypatch.setattr(rerun_view, "MAX_CELLS", 60)
    missions, _series, _ = recorded(tmp_path / "m.rrd")
    recording = Recording(tmp_path / "m.rrd")
    (block,) = (rows for entity, rows in recording.rows.items() if entity.startswith("/world/entropy/"))
    places = {tuple(place) for place in block[-1][1]["Points3D:positions"]}
    share, expected = entropy_share(missions, 0, 0), set()
    for cell in np.ndindex(3, 4, 2):  # of 3 × 3 × 3 voxels; 7 × 11 × 5 is no multiple
        part = share[tuple(slice(3 * first, 3 * first + 3) for first in cell)]
        if part.mean() < 0.9:
            expected.add(tuple(np.float32((np.array(cell) + 0.5) * 1.5).tolist()))
    assert places == expected and len(expected) > 4


def test_what_is_not_finished_is_not_there(tmp_path):
    pytest.importorskip("rerun")
    missions = started(free_box(), seed=1)
    with pytest.raises(KeyboardInterrupt), RerunView(missions, tmp_path / "m.rrd") as view:
        view.note()
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_missing_package_names_the_extra(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(MissingExtraError, match=r"\[viewer\]"):
        RerunView(started(free_box(), seed=1), tmp_path / "m.rrd")
    assert list(tmp_path.iterdir()) == []
