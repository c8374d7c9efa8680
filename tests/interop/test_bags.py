"""Bags of missions, read by rosbags' own reader and by mcap; recorded bags as maps, worlds and decisions."""

from __future__ import annotations

import json

import numpy as np
import octomap
import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from baselines.experiments.mission import run_mission, scripted
from baselines.replay import main as replay
from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import RecordError, SettingError, WorldError
from entropy_explore_env.explorer.explorer import Explorer
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.interop.bag_reader import (
    BagReader,
    Frames,
    MapHeard,
    ScanHeard,
    in_map_frame,
    world_of_bag,
)
from entropy_explore_env.interop.bag_writer import BagWriter, typestore
from entropy_explore_env.interop.map_files import octomap_of
from entropy_explore_env.interop.messages import grid_of_message, pose_of, pose_of_matrix, voxels_of_tree
from entropy_explore_env.robots.rotations import quaternion_of
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import find_scenario
from entropy_explore_env.worlds.files.voxels import FREE, SOLID, UNKNOWN
from tests.explorer.test_node import blank, grid_message

STORE = typestore()
GRID, ODOMETRY, TF = "nav_msgs/msg/OccupancyGrid", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
TYPES = {
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/robot_0/odom": "nav_msgs/msg/Odometry",
    "/robot_0/path": "nav_msgs/msg/Path",
    "/robot_0/scan": "sensor_msgs/msg/PointCloud2",
    "/robot_0/goal": "visualization_msgs/msg/Marker",
}


def written_mission(folder, name, time_limit_s, **more):
    settings = {"robots": 2, "time_limit_s": time_limit_s, "track_truth": True, **more}
    env = EntropyExploreEnv(with_settings(scripted(find_scenario(name)), settings))
    with BagWriter(env.missions, folder) as bag:
        run_mission(env, PlannedRate(), 0, lambda _: bag.note())
        bag.finish()
    return env


@pytest.fixture(scope="module")
def office(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags") / "office"
    return folder, written_mission(folder, "office", 30.0)


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags") / "box"
    off_lattice = Grid((7, 11, 5), 0.5, (0.2, -0.1, 0.3))
    return folder, written_mission(folder, "box-7x11x5", 20.0, grid=off_lattice)


def messages(folder, topic):
    store = typestore()
    with Reader(folder) as reader:
        wanted = [each for each in reader.connections if each.topic == topic]
        for connection, stamp, raw in reader.messages(connections=wanted):
            yield stamp * 1e-9, store.deserialize_cdr(raw, connection.msgtype)


def test_figures_of_a_mission_are_those_of_its_bag(office):
    folder, env = office
    robots, time_s = env.missions.state.robots[0], float(env.missions.state.missions[0]["time_s"])
    with Reader(folder) as reader:
        assert TYPES.items() <= {each.topic: each.msgtype for each in reader.connections}.items()
    for number, own in enumerate(robots):
        scans = list(messages(folder, f"/robot_{number}/scan"))
        assert len(scans) == own["scans"]
        driven_m = 0.0
        for _, path in messages(folder, f"/robot_{number}/path"):
            places = np.array([[p.pose.position.x, p.pose.position.y] for p in path.poses])
            driven_m += np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
        assert driven_m == pytest.approx(own["departed_m"] + own["path_m"])  # paths stand there whole
    stamps, odometry = zip(*messages(folder, "/robot_1/odom"), strict=True)
    assert stamps[-1] == pytest.approx(time_s) and list(stamps) == sorted(stamps)
    pose = pose_of(odometry[-1].pose.pose.position, odometry[-1].pose.pose.orientation)
    assert np.allclose(pose, env.view("robot_1").pose)
    *_, (_, last) = messages(folder, "/map")
    labels = env.joint_map().labels()[:, :, 0]
    percent = np.select([labels == FREE, labels == SOLID], [0, 100], -1)
    assert np.array_equal(grid_of_message(last).grid, percent)


def test_every_scan_of_a_step_is_in_the_bag(tmp_path):
    settings = {"sensor": {"scan_every_m": 0.2}, "robots": 2, "ending": {"time_limit_s": 20.0}}
    env = EntropyExploreEnv(with_settings(scripted(find_scenario("office")), settings))
    steps, scans = [], env.missions.state.robots[0]["scans"]
    with BagWriter(env.missions, tmp_path / "bag") as bag:

        def note(_):
            steps.append(scans.sum())
            bag.note()

        run_mission(env, PlannedRate(), 0, note)
        bag.finish()
    assert np.diff(steps).max() > 2
    for number in range(2):
        reader = BagReader(tmp_path / "bag", f"/robot_{number}/scan")
        heard = [each for each in reader if isinstance(each, ScanHeard)]
        assert len(heard) == scans[number]
        apart_m = np.linalg.norm(np.diff([each.pose[:2] for each in heard], axis=0), axis=1)
        assert 0.1 < np.median(apart_m) < 0.21
        assert np.allclose(heard[-1].pose, env.missions.state.robots[0, number]["scan_pose"])


def test_a_map_without_a_place_is_left_out_as_scans_are(office):
    assert any(isinstance(each, MapHeard) for each in BagReader(office[0], "/map"))
    assert not list(BagReader(office[0], "/map", map_frame="world", robots=["robot_0"]))
    with pytest.raises(WorldError, match="whose place in the frame 'world' is known"):
        world_of_bag(office[0], map_frame="world")


def test_mcap_finds_schemas_and_all_messages(office):
    folder, _ = office
    with (folder / "office.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None
        schemas = {schema.name: schema for schema in summary.schemas.values()}
        assert set(TYPES.values()) <= set(schemas)
        assert all(each.encoding == "ros2msg" and each.data for each in schemas.values())
        counted = sum(1 for _ in reader.iter_messages(topics=["/robot_0/scan"]))
        assert counted == len(list(messages(folder, "/robot_0/scan")))


def test_points_of_scans_lie_on_what_is_solid(office):
    folder, env = office
    world, seen = env.missions.worlds[0], 0
    for heard in BagReader(folder, topic="/robot_0/scan"):
        assert isinstance(heard, ScanHeard) and heard.robot == 0
        beyond = heard.points_m + 0.005 * unit(heard.points_m - heard.pose[:3])
        at = np.floor(beyond[:, :2] / 0.1).astype(int)
        inside = ((at >= 0) & (at < [240, 180])).all(axis=1)  # the boundary is a wall
        seen += inside.sum()
        assert world.occupied[at[inside, 0], at[inside, 1], 0].mean() > 0.9  # others graze corners
    assert seen > 100


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_a_bag_is_a_world(office, box):
    for folder, env in (office, box):
        world, labels = world_of_bag(folder), env.joint_map().labels()
        known = np.argwhere(labels != UNKNOWN)
        edges = (np.array(world.grid.origin_m) - env.scenario.grid.origin_m) / world.grid.voxel_size_m
        low = np.rint(edges)
        assert np.allclose(edges, low)
        for at in known[:: max(len(known) // 200, 1)]:
            assert world.occupied[tuple(at - low.astype(int))] == (labels[tuple(at)] == SOLID)
    assert box[1].missions.grid.shape == (7, 11, 5)


def test_goals_of_a_replayed_bag_are_those_of_an_explorer(office, capsys):
    folder, _ = office
    assert replay([str(folder), "--json", "--every-s", "6", "--seed", "4"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["robots"] == ["robot_0", "robot_1"] and told["goals"] == told["decisions"] > 4
    assert 0.0 < told["decision_ms"] <= told["worst_decision_ms"]
    explorer = Explorer(voxel_size_m=0.1, robots=2, seed=4)
    maps = (each for each in BagReader(folder) if isinstance(each, MapHeard))
    seen = next(each for each in maps if (each.percent >= 0).any())
    explorer.set_map(seen.percent, seen.origin)
    goal = explorer.goal(seen.poses, robot=0, time_s=seen.time_s)
    assert np.allclose(goal.viewpoint, told["rows"][0]["goal"])


def test_scans_of_a_bag_make_a_map(office, capsys):
    assert replay([str(office[0]), "--topic", "/robot_1/scan", "--every-s", "8"]) == 0
    assert "ms a decision" in capsys.readouterr().out


def test_trees_are_read_without_octomap():
    """By hand: one solid voxel at (0, 0, 0), then one free at (-1, 0, 0) beside it, both of width 1."""
    down = [0x00, 0xC0] + [0x03, 0x00] * 14
    east = bytes([*down, 0x02, 0x00])  # child 7 of the root, then child 0 fifteen times: x, y, z ≥ 0
    labels, low = voxels_of_tree(east, binary=True)
    assert labels.tolist() == [[[SOLID]]] and low.tolist() == [0, 0, 0]
    rng = np.random.default_rng(3)
    drawn = rng.integers(-1, 2, (6, 9, 4))
    drawn[0, 0, 0] = drawn[-1, -1, -1] = FREE
    drawn[2:4, 2:4, 2:4] = SOLID  # which the tree merges
    precision = np.where(drawn == UNKNOWN, 0.001, 9.0).astype(np.float32)
    mean = np.where(drawn == SOLID, 0.9, 0.2).astype(np.float32)
    belief = Map(Grid(drawn.shape, 0.5, (-2.0, 1.0, 3.0)), mean, precision, 30.0)
    for full in (False, True):
        tree = octomap_of(belief, full)
        labels, low = voxels_of_tree(tree[tree.index(b"\ndata\n") + 6 :], binary=not full)
        assert np.array_equal(labels, drawn) and low.tolist() == [-4, 2, 6]
    nodes = np.frombuffer(tree[tree.index(b"\ndata\n") + 6 :], np.uint8).reshape(-1, 5)
    coloured = np.insert(nodes, [4, 4, 4], 200, axis=1).tobytes()
    assert np.array_equal(voxels_of_tree(coloured, binary=False, kind="ColorOcTree")[0], drawn)
    with pytest.raises(SettingError, match=r"octomap.data = .*ColorOcTree"):
        voxels_of_tree(coloured, binary=False, kind="MyTree")
    assert octomap.OcTree(0.5).size() == 0
    for broken in (b"", east[:-2], b"\x00\x00", b"\xff" * 4000):
        with pytest.raises(SettingError, match=r"octomap.data = "):
            voxels_of_tree(broken, binary=True)


def bag_of(path, heard):
    """A bag of messages (topic, seconds, type, message)."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {
            topic: writer.add_connection(topic, kind, typestore=STORE)
            for topic, kind in dict.fromkeys((topic, kind) for topic, _, kind, _ in heard)
        }
        for topic, time_s, kind, message in heard:
            writer.write(topics[topic], int(time_s * 1e9), STORE.serialize_cdr(message, kind))
    return path


def grid_heard(topic, time_s, side, frame="map"):
    message = grid_message(np.zeros((side, side), np.int8))
    message.header.frame_id = frame
    return topic, time_s, GRID, message


def placed(kind, topic, time_s, links):
    """Odometry of one frame in another, or tf."""
    parts = []
    for parent, child in links:
        each = blank("nav_msgs/msg/Odometry" if kind == ODOMETRY else "geometry_msgs/msg/TransformStamped")
        each.header.frame_id, each.child_frame_id = parent, child
        turn = each.pose.pose.orientation if kind == ODOMETRY else each.transform.rotation
        turn.w = 1.0
        parts.append(each)
    if kind == ODOMETRY:
        return [(f"{topic}{number}", time_s, kind, each) for number, each in enumerate(parts)]
    message = blank(kind)
    message.transforms = parts
    return [(topic, time_s, kind, message)]


def cloud_heard(topic, time_s, frame):
    """Two rows of one point, each followed by four bytes of padding."""
    message = blank("sensor_msgs/msg/PointCloud2")
    message.header.frame_id, message.width, message.height = frame, 1, 2
    message.point_step, message.row_step, message.is_bigendian = 12, 16, False
    for number, axis in enumerate("xyz"):
        about = blank("sensor_msgs/msg/PointField")
        about.name, about.offset, about.datatype, about.count = axis, 4 * number, 7, 1
        message.fields.append(about)
    rows = np.zeros((2, 4), "<f4")
    rows[:, :3] = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    message.data = np.frombuffer(rows.tobytes(), np.uint8)
    return topic, time_s, "sensor_msgs/msg/PointCloud2", message


def test_a_map_is_a_world_whatever_else_the_bag_has(tmp_path):
    """Recorded before any pose, and without one; a costmap beside it is not taken for it."""
    alone = bag_of(tmp_path / "alone", [grid_heard("/map", 1.0, 30)])
    assert world_of_bag(alone).grid.shape == (30, 30, 1)
    with pytest.raises(RecordError, match="poses"):
        BagReader(alone)
    tf = placed(TF, "/tf", 2.0, [("map", "base_link")])
    several = [grid_heard("/map", 1.0, 30), *tf, grid_heard("/local_costmap/costmap", 3.0, 6)]
    assert world_of_bag(bag_of(tmp_path / "several", several)).grid.shape == (30, 30, 1)
    assert world_of_bag(tmp_path / "several", "/local_costmap/costmap").grid.shape == (6, 6, 1)
    team = [grid_heard(f"/robot_{number}/map", 1.0, 9) for number in range(2)]
    with pytest.raises(SettingError, match=r"topic = None: expected one of /robot_0/map, /robot_1/map"):
        world_of_bag(bag_of(tmp_path / "team", team))


@pytest.mark.parametrize(
    ("kind", "links", "robots"),
    [
        ("odometry", [("map", "r1/base_link"), ("map", "r2/base_link")], ["r1/base_link", "r2/base_link"]),
        ("odometry", [("map", "robot_1"), ("map", "robot_10")], ["robot_1", "robot_10"]),
        (
            "tf",
            [("map", "r1/base_link"), ("map", "r2/base_footprint")],
            ["r1/base_link", "r2/base_footprint"],
        ),
        ("tf", [("map", "base_footprint"), ("base_footprint", "base_link")], ["base_footprint"]),
    ],
)
def test_every_robot_of_a_team_is_found_and_has_its_own_scans(tmp_path, kind, links, robots):
    heard = placed({"odometry": ODOMETRY, "tf": TF}[kind], "/placed", 1.0, links)
    sensors = [f"{robots[-1]}/lidar", "left"]
    heard += placed(TF, "/tf", 1.0, [(robots[-1], frame) for frame in sensors])
    heard += [cloud_heard(f"/scan{number}", 2.0, frame) for number, frame in enumerate(sensors)]
    reader = BagReader(bag_of(tmp_path / "team", heard))
    assert reader.robots == robots
    scans = [each for each in reader if isinstance(each, ScanHeard)]
    assert [scan.robot for scan in scans] == [len(robots) - 1] * 2
    assert scans[0].points_m.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


def test_frames_are_chained():
    frames, at = Frames(), np.array([1.0, 2.0, 0.5, 0.7, -0.2])
    store = typestore()
    place = store.types["geometry_msgs/msg/Vector3"](x=1.0, y=2.0, z=0.5)
    turn = dict(zip("xyzw", quaternion_of(0.7, -0.2), strict=True))
    frames.hear("/map", "odom", place, store.types["geometry_msgs/msg/Quaternion"](**turn))
    still = store.types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    frames.hear("odom", "/base_link", still, store.types["geometry_msgs/msg/Quaternion"](x=0, y=0, z=0, w=1))
    assert np.allclose(pose_of_matrix(frames.to("map", "base_link")), at)
    assert frames.to("map", "laser") is None
    with pytest.raises(SettingError, match=r"frame of the map = .*level"):
        in_map_frame(np.zeros(5), frames.to("map", "odom"))
    turned = np.array(
        [[0.0, -1.0, 0.0, 3.0], [1.0, 0.0, 0.0, 4.0], [0.0, 0.0, 1.0, 5.0], [0.0, 0.0, 0.0, 1.0]]
    )
    origin, bottom_m = in_map_frame(np.array([1.0, 2.0, 0.5, 0.1, 0.0]), turned)
    assert np.allclose(origin, (1.0, 5.0, np.pi / 2 + 0.1)) and bottom_m == 5.5


def test_what_is_no_bag_with_maps_is_refused_by_name(office, tmp_path):
    store = typestore()
    text = store.types["std_msgs/msg/String"](data="hello")
    with Writer(tmp_path / "words", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/map", "std_msgs/msg/String", typestore=store)
        writer.write(connection, 1, store.serialize_cdr(text, "std_msgs/msg/String"))
    (tmp_path / "empty").mkdir()
    for call, kind, message in [
        (lambda: BagReader(tmp_path / "none"), RecordError, "bag = .*none.*the folder of a bag"),
        (lambda: BagReader(tmp_path / "empty"), RecordError, "bag = .*that can be read"),
        (lambda: BagReader(tmp_path / "words"), RecordError, r"bag = .*it has \['/map'\]"),
        (lambda: BagReader(tmp_path / "words", topic="/map"), SettingError, "topic = '/map': .*std_msgs"),
        (lambda: BagReader(office[0], topic="/mapp"), SettingError, "topic = '/mapp': .*/map"),
        (lambda: world_of_bag(office[0], "/robot_0/scan"), WorldError, "an OccupancyGrid or an Octomap"),
        (lambda: BagWriter(office[1].missions, office[0]), SettingError, "does not exist yet"),
        (lambda: replay([str(office[0]), "--every-s", "-1"]), SettingError, "every_s = -1"),
    ]:
        with pytest.raises(kind, match=message):
            call()


def test_a_bag_that_is_not_finished_is_not_left_behind(tmp_path):
    env = EntropyExploreEnv("box-7x11x5")
    env.reset(seed=0)
    with pytest.raises(KeyboardInterrupt), BagWriter(env.missions, tmp_path / "bag") as bag:
        bag.note()
        raise KeyboardInterrupt
    assert not (tmp_path / "bag").exists()
