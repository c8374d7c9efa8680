"""Mission records: what is in them, that they come back exactly, and that bad ones are refused."""

import dataclasses
import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given as drawing
from hypothesis import strategies as st

from entropy_explore_env.errors import CallOrderError, RecordError, WorldError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.mission_record import (
    CommandRecorder,
    MissionRecord,
    check_world,
    load_record,
    same_end,
    save_record,
    world_digest,
)
from entropy_explore_env.reports.state_digest import named_digest, state_digest
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.version import VERSION
from entropy_explore_env.worlds.load import save_world, world_bytes
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import drawn, free_box, random_actions, started, wander


def recorded(steps: int = 12, seed: int = 5, **changes) -> tuple[MissionRecord, Missions]:
    """A mission of random actions, and its record."""
    missions = started(free_box(**changes), seed=seed)
    recorder, rng = CommandRecorder(missions), np.random.default_rng(1)
    recorder.note()
    for _ in range(steps):
        boxes, numbers = random_actions(missions, rng)
        given = numbers[0] if missions.rules.params[0]["discrete"] else boxes[0].astype(np.float32)
        recorder.command(dict(zip(missions.scenario.agents, given, strict=True)))
        missions.step(boxes, numbers)
        recorder.note()
    return recorder.record("chance"), missions


def saved(record: MissionRecord, folder: Path) -> Path:
    save_record(record, folder / "mission.npz")
    return folder / "mission.npz"


@pytest.mark.parametrize(
    "changes",
    [
        {"robots": 1, "action": {"kind": "discrete"}},
        {"track_truth": True, "channel": {"delay_s": 2.0}},
        {"channel": {"content": "summaries", "summary_every_s": 1.0, "delay_s": 2.0}},
    ],
)
def test_a_record_comes_back_exactly(changes, tmp_path):
    record, missions = recorded(**changes)
    back = load_record(saved(record, tmp_path))
    for field in dataclasses.fields(MissionRecord):
        written, read = getattr(record, field.name), getattr(back, field.name)
        if isinstance(written, np.ndarray):
            assert written.dtype == read.dtype
            np.testing.assert_array_equal(written, read)
        else:
            assert written == read and type(written) is type(read)
    assert back.digest == state_digest(missions, 0)
    assert (back.strategy, back.library, back.seed) == ("chance", VERSION, 5)
    assert back.commands.dtype == (np.float32 if back.commands.ndim == 3 else np.int64)


def test_the_same_mission_gives_the_same_file(tmp_path):
    (tmp_path / "again").mkdir()
    first, again = (saved(recorded()[0], folder).read_bytes() for folder in (tmp_path, tmp_path / "again"))
    assert first == again


def test_seeds_of_any_length_and_later_episodes(tmp_path):
    missions = started(free_box(), seed=2**130 + 7)
    missions.reset(0)
    record = load_record(saved(CommandRecorder(missions).record(), tmp_path))
    assert (record.seed, record.episode, record.commands.shape) == (2**130 + 7, 1, (0, 2))


def test_scan_times_are_those_of_the_state():
    """Robots rest until they decide: in steps of a second each scan ends when its robot was ready."""
    missions = started(free_box(robots=2, decision_period_s=1.0), seed=3)
    recorder, rng, expected = CommandRecorder(missions), np.random.default_rng(1), []
    for _ in range(20):
        boxes, numbers = random_actions(missions, rng)
        recorder.command(dict(zip(missions.scenario.agents, boxes[0], strict=True)))
        before = missions.state.robots[0]["scans"].copy()
        missions.step(boxes, numbers)
        recorder.note()
        robots = missions.state.robots[0]
        expected += [(robots[a]["ready_s"], a) for a in range(2) if robots[a]["scans"] > before[a]]
    record = recorder.record()
    assert list(zip(record.scan_s, record.scan_robot, strict=True)) == expected
    assert len(expected) == missions.state.robots[0]["scans"].sum() > 5
    whole = np.mod(record.scan_s, 1.0)
    assert (whole != 0.0).any() and (record.scan_s <= 20.0).all()


def test_actions_are_copied_filled_up_to_one_length_and_keep_float64():
    missions, action = started(free_box(robots=2), seed=3), np.ones(5, np.float32)
    recorder = CommandRecorder(missions)
    recorder.command({"robot_1": np.array([1 / 3, 0.5, 0.25]), "robot_0": action})
    action[:] = 0.0
    commands = recorder.record().commands
    assert commands.dtype == np.float64
    assert commands.tolist() == [[[1.0] * 5, [1 / 3, 0.5, 0.25, 0.0, 0.0]]]


def test_before_a_reset_there_is_nothing_to_record():
    missions = Missions(free_box())
    with pytest.raises(CallOrderError):
        CommandRecorder(missions).record()
    with pytest.raises(CallOrderError):
        world_digest(missions, 0)


def test_a_record_knows_the_state_at_its_end():
    record, missions = recorded()
    assert same_end(record, missions)
    missions.state.robots["distance_m"][0, 0] += 1e-9
    assert not same_end(record, missions)


def test_another_world_in_the_file_is_refused(tmp_path):
    missions = started(free_box(world="furnished"), seed=1)
    path = tmp_path / "room.npz"
    save_world(missions.worlds[0], path)
    there = started(free_box(world=str(path)), seed=1)
    record = CommandRecorder(there).record()
    assert record.world_digest == world_digest(missions, 0)
    check_world(record, there)
    other = started(free_box(world="furnished"), seed=2)
    with pytest.raises(WorldError, match=r"room\.npz"):
        check_world(record, other)
    check_world(CommandRecorder(missions).record(), other)  # a recipe: the version may make others


# --- worlds given as objects


def in_hut(**changes) -> tuple[MissionRecord, World]:
    """The record of the second episode in one of two given worlds, and that world."""
    solid = np.zeros((9, 12, 7), bool)
    solid[4, 2:-2] = True
    ceiling = np.full((9, 12), 6, np.int32)
    hut = World(Grid(solid.shape, 0.5), solid, "hut", ceiling, 0.25)
    missions = Missions(free_box(robots=2, **changes), given=(World(hut.grid, ~solid, "block"), hut))
    missions.reset(0, 4)
    missions.reset(0)
    recorder = CommandRecorder(missions)
    wander(missions, 12, 0)
    return recorder.record("chance"), hut


def test_a_record_holds_the_world_that_was_given(tmp_path):
    record, hut = in_hut()
    assert record.world is hut and record.episode == 1
    back = load_record(saved(record, tmp_path))
    assert (back.world.grid, back.world.name, back.world.yaw_rad) == (hut.grid, "hut", 0.25)
    np.testing.assert_array_equal(back.world.occupied, hut.occupied)
    np.testing.assert_array_equal(back.world.ceiling, hut.ceiling)
    again = Missions(back.scenario, given=(back.world,))
    again.reset(0, back.seed)
    again.reset(0)
    assert world_digest(again, 0) == back.world_digest
    check_world(back, again)
    wander(again, 12, 0)
    assert state_digest(again, 0) == back.digest


def test_a_world_too_large_for_a_record_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("entropy_explore_env.reports.mission_record.MAX_FILE_VOXELS", 700)
    with pytest.raises(RecordError, match=r"'hut'.*at most 700 voxels"):
        save_record(in_hut()[0], tmp_path / "r.npz")
    assert not list(tmp_path.iterdir())


def other_world() -> np.ndarray:
    """A saved world of another grid."""
    world = World(Grid((9, 12, 7), 0.25), np.zeros((9, 12, 7), bool), "other")
    return np.frombuffer(world_bytes(world), np.uint8)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("world", np.zeros(9, np.uint8), "a whole .npz"),
        ("world", np.zeros(0, np.uint8), "a whole .npz"),
        ("world", other_world(), "fit each other"),
        ("world_number", 3, "fit each other: world does not"),
    ],
)
def test_forged_worlds_are_refused(name, value, said, tmp_path):
    data = saved(in_hut()[0], tmp_path).read_bytes()
    assert load_record_bytes(forged(data), tmp_path).world.name == "hut"
    refused(forged(data, **{name: value}), tmp_path, said)


# --- bad files


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> bytes:
    return saved(recorded()[0], tmp_path_factory.mktemp("record")).read_bytes()


def refused(data: bytes, folder: Path, said: str = "mission record") -> None:
    path = folder / "bad.npz"
    path.write_bytes(data)
    with pytest.raises(RecordError, match=said) as caught:
        load_record(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def entries_of(data: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(data)) as archive:
        return dict(archive)


def packed(entries: dict) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **entries)
    return buffer.getvalue()


@drawn(80)
@drawing(share=st.floats(0.0, 1.0))
def test_truncated_files_are_refused(share, file, tmp_path_factory):
    refused(file[: int(share * (len(file) - 1))], tmp_path_factory.getbasetemp())


@drawn(150)
@drawing(place=st.integers(0, 10**9), bit=st.integers(0, 7))
def test_a_flipped_bit_is_refused_or_changes_nothing(place, bit, file, tmp_path_factory):
    """Zip archives hold dates and attributes that nobody reads."""
    data = bytearray(file)
    data[place % len(data)] ^= 1 << bit
    path = tmp_path_factory.getbasetemp() / "flipped.npz"
    path.write_bytes(bytes(data))
    try:
        record = load_record(path)
    except RecordError:
        return
    original = entries_of(file)
    assert record.digest == head_of(file)["digest"]
    np.testing.assert_array_equal(record.commands, original["commands"])


@pytest.mark.parametrize("name", ["head", "commands", "scan_s"])
def test_what_was_changed_by_hand_is_refused(name, file, tmp_path):
    entries = entries_of(file)
    changed = file_head(file, strategy="other") if name == "head" else entries[name] + 1
    refused(packed({**entries, name: changed}), tmp_path, "changed or damaged")


def head_of(file: bytes) -> dict:
    return json.loads(entries_of(file)["head"].tobytes())


def file_head(file: bytes, **changes: object) -> np.ndarray:
    """The head with other values."""
    return np.frombuffer(json.dumps({**head_of(file), **changes}).encode(), np.uint8)


def forged(file: bytes, **changes: object) -> bytes:
    """The record with other entries, or values of its head, its checksum made to fit."""
    arrays = {name: value for name, value in changes.items() if isinstance(value, np.ndarray)}
    head = {name: value for name, value in changes.items() if name not in arrays}
    entries = {**entries_of(file), **({"head": file_head(file, **head)} if head else {}), **arrays}
    del entries["checksum"]
    return packed({**entries, "checksum": np.asarray(named_digest(dict(sorted(entries.items()))))})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"version": 3}, "of format version 4"),
        ({"version": 5}, "of format version 4"),
        ({"format": "another"}, "of format version 4"),
        ({"commands": np.zeros((3, 7, 5), np.float32)}, "fit each other: commands"),
        ({"commands": np.zeros((3, 2), np.float32)}, "fit each other: commands"),
        ({"commands": np.zeros(3)}, "fit each other: commands"),
        ({"scan_robot": np.zeros(2, np.int64)}, "fit each other: scan_robot"),
        ({"scan_s": np.zeros((2, 2))}, "fit each other: scan_s"),
        ({"digest": "z" * 64}, r"matching regex.*digest"),
        ({"seed": "-1"}, r"matching regex.*seed"),
        ({"episode": -1}, r"`int` >= 0.*episode"),
        ({"episode": "1"}, r"`int`.*episode"),
        ({"settings": {}}, "settings are allowed"),
        ({"settings": "["}, r"`object`.*settings"),
        ({"more": 1}, "unknown field `more`"),
        ({"more": np.zeros(3)}, "changed or damaged"),
        ({"head": np.zeros(3)}, "a whole .npz"),
        ({"world_number": -1}, r"`int` >= 0.*world_number"),
        ({"world_number": 1.5}, r"`int \| null`.*world_number"),
        ({"starts": np.zeros((2, 3))}, "fit each other: starts"),
        ({"starts": np.zeros((2, 5), np.float32)}, "fit each other: starts"),
        ({"reward_function": "x" * 2_000_000}, r"length.*reward_function"),
    ],
)
def test_forged_records_are_refused(changes, said, file, tmp_path):
    assert load_record_bytes(forged(file), tmp_path).strategy == "chance"
    refused(forged(file, **changes), tmp_path, said)


def test_records_of_earlier_versions_are_refused_by_name(tmp_path):
    earlier = {"format": np.asarray("entropy_explore_env mission"), "version": np.int64(3)}
    refused(packed(earlier), tmp_path, "format version 4: this one has another form")


def load_record_bytes(data: bytes, folder: Path) -> MissionRecord:
    (folder / "good.npz").write_bytes(data)
    return load_record(folder / "good.npz")


def test_pickled_objects_are_never_loaded(file, tmp_path):
    class Bomb:
        def __reduce__(self):
            return (pytest.fail, ("code was executed",))

    entries = entries_of(file)
    refused(packed({**entries, "commands": np.array([Bomb()], dtype=object)}), tmp_path)


def test_other_files_are_refused(tmp_path):
    refused(b"", tmp_path)
    refused(b"a text", tmp_path)
    refused(packed({"elevation": np.zeros((3, 4))}), tmp_path, "as --record writes it")
    for path in (tmp_path, tmp_path / "missing.npz"):
        with pytest.raises(RecordError, match="mission record"):
            load_record(path)
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("commands.npy", bytes(300 << 20))
    refused(bomb.getvalue(), tmp_path, "at most")


def test_missions_after_their_end_are_recorded_as_they_ended():
    missions = started(free_box(ending={"time_limit_s": 5.0}), seed=3)
    recorder = CommandRecorder(missions)
    wander(missions, 30, 0, lambda _: recorder.note())
    assert (recorder.record().scan_s <= 5.0).all() and len(recorder.record().scan_s) > 2


@pytest.mark.parametrize("wrong", [None, "poses", "joint_mean"])
def test_results_for_people_come_back_or_are_refused(wrong, tmp_path):
    missions = started(free_box(), seed=3)
    recorder, poses = CommandRecorder(missions), np.zeros((1, missions.scenario.robots, 5))
    maps = np.full((2, *missions.grid.shape), 0.25, np.float32)
    results = {"time_s": np.zeros(1), "poses": poses, "joint_mean": maps[0], "joint_precision": maps[1]}
    if wrong is not None:
        results[wrong] = results[wrong][:, :1]
    save_record(recorder.record(results=results), tmp_path / "kept.npz")
    if wrong is not None:
        with pytest.raises(RecordError, match=wrong):
            load_record(tmp_path / "kept.npz")
        return
    kept = load_record(tmp_path / "kept.npz")
    assert kept.results.keys() == set(results)
    assert all((kept.results[name] == results[name]).all() for name in results)
    save_record(recorder.record(), tmp_path / "bare.npz")
    assert load_record(tmp_path / "bare.npz").results == {}
