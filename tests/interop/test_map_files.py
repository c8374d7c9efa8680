"""Maps as files: what is written is read back by the readers of other programs."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import octomap
import pytest
import trimesh

from baselines.cli.mission_outputs import MissionLog, Outputs
from entropy_explore_env.belief.belief_map import Map
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import CallOrderError, SettingError, WorldError
from entropy_explore_env.interop.map_files import load_map, save_map
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.files.voxels import FREE, SOLID, UNKNOWN
from entropy_explore_env.worlds.load import load_world


def drawn_map(shape=(7, 11, 5), origin=(-1.5, 2.0, 0.5), yaw=0.0, seed=0):
    rng = np.random.default_rng(seed)
    labels = rng.integers(-1, 2, shape)
    mean = np.where(labels == SOLID, 0.9, np.where(labels == FREE, 0.1, 0.5)).astype(np.float32)
    precision = np.where(labels == UNKNOWN, np.float32(30.0**-2), np.float32(50.0))
    return Map(Grid(shape, 0.25, origin), mean, precision, 30.0, yaw), labels


@pytest.mark.parametrize("name", ["plan.yaml", "a: run #2.pgm"])
@pytest.mark.parametrize("rule", ["nav2", "map_server"])
def test_a_plan_is_read_back_by_the_rules_of_map_server(tmp_path, name, rule):
    belief, labels = drawn_map((7, 11, 1), tuple(np.array([-1.5, 2.0, 0.0])), yaw=0.3)
    text, image = save_map(belief, tmp_path / name)
    assert {text.name, image.name} == {f"{Path(name).stem}{suffix}" for suffix in (".yaml", ".pgm")}
    world = load_world(text, map_rule=rule)
    assert np.array_equal(world.occupied, labels != FREE)
    assert world.unknown is not None and np.array_equal(world.unknown, labels == UNKNOWN)
    assert world.yaw_rad == belief.yaw_rad and world.grid == belief.grid


def test_columns_between_two_heights_are_a_plan(tmp_path):
    belief, labels = drawn_map()
    world = load_world(save_map(belief, tmp_path / "a.yaml", heights_m=(0.8, 1.2))[0])
    assert world.unknown is not None
    layers = labels[:, :, 1:3]  # centres at 0.625, 0.875, 1.125 …
    assert np.array_equal(world.occupied[:, :, 0] & ~world.unknown[:, :, 0], (layers == SOLID).any(axis=2))
    assert np.array_equal(world.unknown[:, :, 0], (layers == UNKNOWN).all(axis=2))


@pytest.mark.parametrize("suffix", [".bt", ".ot"])
def test_octomap_finds_the_same_cells(tmp_path, suffix):
    belief, labels = drawn_map()
    (file,) = save_map(belief, tmp_path / f"map{suffix}")
    name = file.as_posix().encode()
    tree = octomap.OcTree(name) if suffix == ".bt" else octomap.OcTree.read(name)
    assert tree is not None
    assert tree.getResolution() == 0.25
    for at in np.ndindex(*labels.shape):
        node = tree.search(np.array(belief.grid.centre_of(np.array(at))))
        try:
            found = SOLID if tree.isNodeOccupied(node) else FREE
        except octomap.NullPointerException:
            found = UNKNOWN
        assert found == labels[at]
    world = load_world(file)  # its box is that of what is known
    assert world.unknown is not None
    assert (world.occupied & ~world.unknown).sum() == (labels == SOLID).sum()


@pytest.mark.parametrize(("axis", "corner_m"), [(0, -8192.0), (1, 8192.0 - 11 * 0.25)])
def test_octomap_holds_maps_up_to_the_ends_of_its_lattice(tmp_path, axis, corner_m):
    origin = tuple(corner_m if each == axis else 0.0 for each in range(3))
    belief, labels = drawn_map(origin=origin)
    world = load_world(save_map(belief, tmp_path / "map.bt")[0])
    assert world.unknown is not None
    assert (world.occupied & ~world.unknown).sum() == (labels == SOLID).sum()
    beyond = np.array(origin) + np.sign(corner_m) * 0.25 * (np.arange(3) == axis)
    with pytest.raises(SettingError, match=r"belief = .*within 8192 m of the origin"):
        save_map(drawn_map(origin=tuple(beyond.tolist()))[0], tmp_path / "beyond.bt")


def test_points_lie_in_the_map_frame(tmp_path):
    belief, labels = drawn_map(origin=(500_000.0 - 1.5, 5_400_002.0, 0.5), yaw=np.pi / 2)
    cloud = trimesh.load(save_map(belief, tmp_path / "map.ply")[0])
    assert isinstance(cloud, trimesh.PointCloud)
    first = np.argwhere(labels == SOLID)[0]
    x, y, z = (first + 0.5) * 0.25
    assert len(cloud.vertices) == (labels == SOLID).sum()
    assert np.allclose(cloud.vertices[0] - [500_000.0, 5_400_000.0, 0.0], [-1.5 - y, 2.0 + x, 0.5 + z])


def test_an_archive_is_a_map_and_a_world(tmp_path):
    belief, labels = drawn_map(yaw=0.5)
    (file,) = save_map(belief, tmp_path / "map.npz")
    again = load_map(file)
    assert np.array_equal(again.mean, belief.mean) and np.array_equal(again.precision, belief.precision)
    assert (again.grid, again.yaw_rad, again.sigma_prior) == (belief.grid, 0.5, 30.0)
    world = load_world(file)
    assert np.array_equal(world.occupied, labels != FREE) and np.array_equal(world.unknown, labels == UNKNOWN)


def test_what_a_form_cannot_hold_is_refused_by_name(tmp_path):
    belief, _ = drawn_map()
    flat, _ = drawn_map((7, 11, 1), (0.0, 0.0, 0.0))
    turned, _ = drawn_map(yaw=0.1)
    between, _ = drawn_map(origin=(0.1, 0.0, 0.0))
    for call, message in [
        (lambda: save_map(belief, tmp_path / "a.txt"), r"path = .*\.yaml.*\.npz"),
        (lambda: save_map(belief, tmp_path / "a.yaml"), "heights_m = None: .*from 0.625 to 1.625 m"),
        (lambda: save_map(flat, tmp_path / "a.yaml", heights_m=(0.0, 1.0)), "heights_m = .*3-D"),
        (lambda: save_map(turned, tmp_path / "a.bt"), "belief = .*yaw 0.1.*not turned"),
        (lambda: save_map(between, tmp_path / "a.bt"), "belief = .*multiples of 0.25 m"),
        (lambda: save_map("map", tmp_path / "a.bt"), "belief = 'map'.*a Map"),
        (lambda: Map(flat.grid, flat.mean + 2.0, flat.precision, 30.0), "Map.mean = "),
        (lambda: Map(flat.grid, flat.mean, -flat.precision, 30.0), "Map.precision = "),
    ]:
        with pytest.raises(SettingError, match=message):
            call()
    (tmp_path / "b.npz").write_bytes(b"no archive")
    for name in ("b.npz", "missing.npz"):
        with pytest.raises(WorldError, match="path = "):
            load_map(tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["b.npz"]
    whole = save_map(belief, tmp_path / "whole.npz")[0].read_bytes()
    for place in range(0, len(whole), 7):
        (tmp_path / "b.npz").write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        with contextlib.suppress(WorldError):
            load_map(tmp_path / "b.npz")


def test_the_map_of_a_team_is_there_with_and_without_the_truth():
    maps = {}
    for tracked in (False, True):
        env = EntropyExploreEnv("box-7x11x5", track_truth=tracked)
        with pytest.raises(CallOrderError, match="joint_map before reset"):
            env.joint_map()
        env.reset(seed=1)
        for _ in range(6):
            env.step({agent: np.full(5, 0.3, np.float32) for agent in env.agents})
        maps[tracked] = env.joint_map()
        robots = [env.view(agent).map for agent in env.agents]
        assert np.array_equal(maps[tracked].known, np.logical_or(*(each.known for each in robots)))
        surest = np.maximum(*(each.precision for each in robots))
        assert (maps[tracked].precision >= surest * (1 - 1e-5)).all()
    assert np.array_equal(maps[False].known, maps[True].known)


def test_infos_say_the_share_seen_where_the_mission_ends_by_it():
    env = EntropyExploreEnv("box-7x11x5", ending={"seen_share": 0.9})
    _, infos = env.reset(seed=1)
    shares = [infos["robot_0"]["seen_share"]]
    for _ in range(4):
        *_, infos = env.step({agent: np.full(5, 0.3, np.float32) for agent in env.agents})
        shares.append(infos["robot_1"]["seen_share"])
    assert shares[0] == 0.0 and shares == sorted(shares) and 0.0 < shares[-1] <= 1.0
    _, infos = EntropyExploreEnv("box-7x11x5").reset(seed=1)
    assert "seen_share" not in infos["robot_0"]


@pytest.mark.parametrize(("scenario", "name"), [("box-7x11x5", "map.npz"), ("corridor", "map.yaml")])
def test_the_folder_of_a_mission_holds_the_map_of_its_team(tmp_path, scenario, name):
    env = EntropyExploreEnv(scenario, robots=1)
    env.reset(seed=0)
    with MissionLog(Outputs(), tmp_path) as log:
        log.note(env)
        for _ in range(20):
            env.step({agent: env.action_space(agent).sample() for agent in env.agents})
        log.note(env)
        _, written = log.finish("random")
    assert tmp_path / name in written
    assert np.array_equal(load_world(tmp_path / name).occupied, env.joint_map().labels() != FREE)
