"""Starts and worlds given to a reset: what they lead to, in every adapter, and what is refused."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from entropy_explore_env import SettingError, SingleRobotEnv, World, WorldError, parallel_env
from entropy_explore_env import env as turn_taking_env
from entropy_explore_env.envs.episodes import leaves, require_same, snapshot
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.missions import snapshot as arrays
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.mission_record import (
    CommandRecorder,
    given_worlds_of,
    load_record,
    reset_options_of,
    same_end,
    save_record,
)
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.worlds.splits import WORLD_NUMBERS

ROOM: dict[str, Any] = {"scenario": "room-furnished", "robots": 3}
STARTS = np.array([[0.75, 0.75, 0.75, 0.5, 0.1], [0.75, 3.75, 0.75, -2.0, -0.1]])
BOX: dict[str, Any] = {"scenario": "box-7x11x5", "robots": 2}


def poses(missions: Missions, mission: int = 0) -> np.ndarray:
    return missions.state.robots[mission]["origin"]


def hut() -> World:
    """A world of the tiny box with a wall."""
    grid = parallel_env(**BOX).scenario.grid
    solid = np.zeros(grid.shape, bool)
    solid[5, 2:-2] = True
    return World(grid, solid, "hut")


@pytest.mark.parametrize("given", ["starts", "world", "both"])
def test_what_would_have_been_drawn_gives_the_same_mission_bitwise(given: str) -> None:
    """The random streams do not notice that something was not drawn."""
    drawn, other = parallel_env(**ROOM), parallel_env(**ROOM)
    first = drawn.reset(seed=5)
    starts, world = poses(drawn.missions).copy(), drawn.missions.world_numbers[0]
    options = {"starts": starts.copy(), "world": world}
    chosen = options if given == "both" else {given: options[given]}
    require_same("reset", leaves(first), leaves(other.reset(seed=5, options=chosen)))
    rng = np.random.default_rng(0)
    for _ in range(15):
        actions = {a: rng.uniform(-1, 1, (5,)).astype(np.float32) for a in drawn.agents}
        require_same("step", leaves(drawn.step(actions)), leaves(other.step(actions)))
    require_same("the next mission", leaves(drawn.reset()), leaves(other.reset()))
    state = [each.missions.state._asdict() for each in (drawn, other)]
    require_same("state", leaves(state[0]), leaves(state[1]))


def test_a_world_that_would_have_been_drawn_gives_the_same_state_as_an_object() -> None:
    drawn, other = parallel_env(**ROOM), parallel_env(**ROOM)
    drawn.reset(seed=5)
    infos = other.reset(seed=5, options={"world": drawn.missions.worlds[0]})[1]
    assert {info["world_number"] for info in infos.values()} == {-1}  # a World has no number
    state = [each.missions.state._asdict() for each in (drawn, other)]
    require_same("state", leaves(state[0]), leaves(state[1]))


def test_robots_stand_where_they_were_put_and_the_next_reset_draws_again() -> None:
    team = parallel_env(**BOX)
    team.reset(seed=1)
    drawn = poses(team.missions).copy()
    team.reset(seed=1, options={"starts": STARTS.tolist()})
    np.testing.assert_array_equal(poses(team.missions), STARTS)
    np.testing.assert_array_equal([team.view(agent).pose for agent in team.agents], STARTS)
    team.reset(seed=1)
    np.testing.assert_array_equal(poses(team.missions), drawn)


def test_a_world_number_is_the_world_that_the_recipe_makes_of_it() -> None:
    for split, number in (("train", 0), ("train", 7), ("test", WORLD_NUMBERS["test"].start)):
        team = parallel_env(**ROOM, split=split)
        team.reset(seed=1, options={"world": number})
        expected = make_world(team.scenario, number)
        np.testing.assert_array_equal(team.missions.state.truth[0], expected.occupied.ravel())
    worlds = [parallel_env(**ROOM) for _ in range(2)]
    for seed, team in enumerate(worlds):
        team.reset(seed=seed, options={"world": np.int64(3)})
    np.testing.assert_array_equal(*(team.missions.state.truth for team in worlds))
    assert (poses(worlds[0].missions) != poses(worlds[1].missions)).any()


def test_the_other_adapters_take_them_too() -> None:
    turns = turn_taking_env(**BOX)
    turns.reset(seed=0, options={"starts": STARTS, "world": hut()})
    np.testing.assert_array_equal([turns.view(a).pose for a in turns.possible_agents], STARTS)
    alone = SingleRobotEnv("box-7x11x5")
    alone.reset(seed=0, options={"starts": STARTS[:1], "world": hut()})
    np.testing.assert_array_equal(poses(alone.missions), STARTS[:1])
    assert alone.missions.worlds[0].name == "hut"  # type: ignore[union-attr]


def test_vector_environments_take_one_for_all_or_one_for_each_and_autoreset_draws_again() -> None:
    batch = EntropyExploreVectorEnv(**BOX, num_envs=3, max_cycles=2)
    batch.reset(seed=4)
    drawn = [poses(batch.missions, e).copy() for e in range(3)]
    batch.reset(seed=4, options={"starts": STARTS, "world": hut()})
    for e in range(3):
        np.testing.assert_array_equal(poses(batch.missions, e), STARTS)
        assert batch.missions.worlds[e].name == "hut"  # type: ignore[union-attr]
    each = np.stack([STARTS, STARTS[::-1], STARTS + np.array([0.5, 0, 0.25, 0, 0])])
    mask = np.array([True, False, True])
    options = {"starts": each, "world": [None, hut(), hut()], "reset_mask": mask}
    batch.reset(seed=4, options=options)
    for e, (expected, name) in enumerate([(each[0], "empty"), (STARTS, "hut"), (each[2], "hut")]):
        np.testing.assert_array_equal(poses(batch.missions, e), expected)
        assert batch.missions.worlds[e].name == name  # type: ignore[union-attr]
    batch.reset(seed=4, options={"starts": each})
    fresh = EntropyExploreVectorEnv(**BOX, num_envs=3, max_cycles=2)
    fresh.reset(seed=4)
    for _ in range(3):
        for one in (batch, fresh):
            one.step(np.zeros((3, 2, 5), np.float32))
    np.testing.assert_array_equal(
        batch.missions.state.robots["origin"], fresh.missions.state.robots["origin"]
    )
    assert batch.missions.episodes == [1, 1, 1] and (poses(batch.missions) != drawn[0]).any()


def test_rows_of_stable_baselines3_take_them_from_set_options() -> None:
    rows = RobotVecEnv(BOX["scenario"], 2, robots=2)
    each = np.stack([STARTS, STARTS[::-1]])
    rows.set_options({"starts": each})
    rows.reset()
    np.testing.assert_array_equal(rows.vector_env.missions.state.robots["origin"], each)
    rows.set_options([{"starts": STARTS[::-1]}] * 2 + [{"world": hut()}] * 2)  # type: ignore[arg-type]
    rows.reset()
    np.testing.assert_array_equal(poses(rows.vector_env.missions), STARTS[::-1])
    assert [world.name for world in rows.vector_env.missions.worlds] == ["empty", "hut"]  # type: ignore[union-attr]
    rows.reset()
    assert rows.vector_env.missions.worlds[1].name == "empty"  # type: ignore[union-attr]
    for wrong in ({"stars": STARTS}, [{"starts": STARTS}], [{}] * 3 + [{"stars": STARTS}], "starts"):
        with pytest.raises(SettingError):
            rows.set_options(wrong)
    rows.reset()
    with pytest.raises(SettingError, match="stars"):
        rows.set_options({"stars": STARTS})


def changed(row: int, column: int, value: float) -> np.ndarray:
    starts = STARTS.copy()
    starts[row, column] = value
    return starts


def with_size(shape: tuple[int, int, int]) -> World:
    return World(Grid(shape, 0.5), np.zeros(shape, bool), "other")


REFUSED: list[tuple[Any, str]] = [
    ({"start": STARTS}, "start.*did you mean starts"),
    ({"wings": 2}, "wings.*only starts, world"),
    ([], "a dict, or None"),
    ({"starts": STARTS[:1]}, r"starts.*shape \(2, 5\)"),
    ({"starts": STARTS[:, :3]}, r"shape \(2, 5\)"),
    ({"starts": [[1.0], [2.0, 3.0]]}, r"shape \(2, 5\)"),
    ({"starts": STARTS > 0}, "finite numbers"),
    ({"starts": "here"}, "finite numbers"),
    ({"starts": changed(1, 3, np.nan)}, "finite numbers"),
    ({"starts": changed(1, 0, np.inf)}, "finite numbers"),
    ({"starts": changed(1, 0, -0.01)}, r"starts\[1\].*the workspace"),
    ({"starts": changed(0, 1, 5.5)}, r"starts\[0\].*the workspace"),
    ({"starts": changed(1, 4, 1.6)}, r"starts\[1\].*pitch"),
    ({"starts": changed(1, 1, 0.9)}, r"starts\[1\].*0.2005 m from that of robot_0"),
    ({"starts": changed(1, 0, 2.75), "world": hut()}, r"starts\[1\].*\(5, 7, 1\) it hits something solid"),
    ({"world": -1}, "a whole number from 0 to 2147483647"),
    ({"world": 1.0}, "a whole number"),
    ({"world": True}, "a whole number"),
    ({"world": "empty"}, "a whole number"),
    ({"world": WORLD_NUMBERS["validation"].start}, "of the split 'validation'"),
    ({"world": with_size((7, 11, 6))}, r"world\.grid"),
    ({"world": [hut()]}, "a whole number"),
]


REFUSED_FOR_MANY: list[tuple[Any, str]] = [
    ({"reset_masks": None}, "did you mean reset_mask"),
    ({"starts": np.stack([STARTS] * 3)}, r"\(2, 5\) or \(2, 2, 5\)"),
    ({"starts": np.stack([STARTS, changed(1, 1, 0.9)])}, "robot_0"),
    ({"world": [3]}, "one world, or 2 of them"),
    ({"world": [3, -3]}, "world = -3"),
    ({"options": 1}, "only reset_mask, starts, world"),
]


@pytest.mark.parametrize(
    ("many", "options", "said"),
    [*((False, *case) for case in REFUSED), *((True, *case) for case in REFUSED_FOR_MANY)],
)
def test_what_cannot_be_is_refused_by_name_and_changes_nothing(many: bool, options: Any, said: str) -> None:
    env = EntropyExploreVectorEnv(**BOX, num_envs=2) if many else parallel_env(**BOX)
    env.reset(seed=0)
    before = snapshot(env)
    with pytest.raises((SettingError, WorldError), match=said):
        env.reset(seed=1, options=options)
    require_same("refused", before, snapshot(env))


def test_a_single_robot_s_random_numbers_are_left_alone_by_a_refusal() -> None:
    alone = SingleRobotEnv("box-7x11x5")
    alone.reset(seed=0)
    expected = copy.deepcopy(alone.np_random).random()
    with pytest.raises(SettingError, match="workspace"):
        alone.reset(seed=1, options={"starts": changed(0, 0, -3.0)[:1]})
    assert alone.np_random.random() == expected


def test_world_numbers_are_those_of_recipes_only() -> None:
    for given in ({"world": hut()}, {"world": [hut(), hut()]}):
        team = parallel_env(**BOX, **given)
        with pytest.raises(SettingError, match="only the worlds of recipes have numbers"):
            team.reset(seed=0, options={"world": 3})
        team.reset(seed=0, options={"world": hut()})


def test_planar_robots_stay_in_their_plane_and_level_and_yaws_may_be_any() -> None:
    planar = {"motion": "planar", "sensor_height_m": 0.7}
    team = parallel_env(**BOX, robot=planar)
    assert team.scenario.plane_m(1) == 0.75  # the middle of the second layer
    near = STARTS * [1, 1, 1, 1, 0] + np.array([0, 0, 1e-9, 4 * np.pi, -1e-9])
    team.reset(seed=0, options={"starts": near})
    placed = poses(team.missions)
    assert placed[:, 2].tolist() == [0.75, 0.75] and placed[:, 4].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(placed[:, 3], STARTS[:, 3], atol=1e-9)
    for wrong in (near + np.array([0, 0, 0.01, 0, 0]), near + np.array([0, 0, 0, 0, 0.01])):
        with pytest.raises(SettingError, match=r"z = 0\.75 and pitch = 0"):
            team.reset(seed=0, options={"starts": wrong})


def test_a_body_fits_or_not_by_its_own_radius() -> None:
    """Body of 0.6 m in voxels of 0.5 m: it must be a voxel away from the boundary."""
    robot = {"body_radius_m": 0.6}
    team, tight = parallel_env(**BOX, robot=robot), changed(0, 0, 0.25)
    parallel_env(**BOX).reset(seed=0, options={"starts": tight})
    with pytest.raises(SettingError, match=r"starts\[0\].*hits something solid or the boundary"):
        team.reset(seed=0, options={"starts": tight})


@pytest.mark.parametrize("options", [{"starts": STARTS}, {"world": 11}, {"world": hut()}, {}])
def test_records_hold_what_was_given_and_lead_to_the_same_end(options: dict[str, Any], tmp_path) -> None:
    scenario = {**BOX, "world": "furnished"}
    team = parallel_env(**scenario)
    team.reset(seed=3)
    team.reset()
    team.reset(options=options)
    recorder, rng = CommandRecorder(team.missions), np.random.default_rng(1)
    for _ in range(8):
        actions = {a: rng.uniform(-1, 1, (5,)).astype(np.float32) for a in team.agents}
        recorder.command(actions)
        team.step(actions)
    save_record(recorder.record(), tmp_path / "r.npz")
    record = load_record(tmp_path / "r.npz")
    assert (record.seed, record.episode) == (3, 2)
    assert record.world_number == (11 if options.get("world") == 11 else None)
    assert (record.world is None) == (not isinstance(options.get("world"), World))
    assert (record.starts is None) == ("starts" not in options)
    again = parallel_env(record.scenario, **given_worlds_of(record))
    again.missions.seeds[0], again.missions.episodes[0] = record.seed, record.episode - 1
    again.reset(options=reset_options_of(record))
    for commands in record.commands:
        again.step(dict(zip(again.agents, commands, strict=True)))
    assert same_end(record, again.missions)


def test_snapshots_and_pickles_go_on_where_robots_were_put() -> None:
    batch = EntropyExploreVectorEnv(**{**BOX, "world": "furnished"}, num_envs=4)
    batch.reset(seed=4, options={"world": [hut(), 5, None, None]})
    only = np.array([False, False, False, True])
    batch.reset(options={"starts": STARTS, "reset_mask": only, "world": hut()})
    batch.step(np.ones((4, 2, 5), np.float32))
    there = EntropyExploreVectorEnv(**{**BOX, "world": "furnished"}, num_envs=4)
    there.reset(seed=9)
    arrays.restore(there.missions, arrays.snapshot(batch.missions))
    for other in (there, pickle.loads(pickle.dumps(batch))):
        assert [options.world_number for options in other.missions.options] == [None, 5, None, None]
        np.testing.assert_array_equal(other.missions.options[3].starts, STARTS)
        assert other.missions.options[0].world.name == "hut"
        np.testing.assert_array_equal(*(each.missions.state.truth for each in (batch, other)))
        actions = np.full((4, 2, 5), 0.1, np.float32)
        require_same("step", leaves(other.step(actions)), leaves(copy.deepcopy(batch).step(actions)))
