"""A mission as a file from which it can be run again, bit for bit: settings, seed, every command, a digest.

An `.npz` without pickled objects. Its entry `head` is JSON in UTF-8, of the form of `Head`; beside it lie
`commands` ((T, A, N) floating-point or (T, A) whole numbers, exactly as given), `scan_s` and `scan_robot`
(S,), `checksum` (SHA-256 of all other entries) and, only where they were given, `starts` (A, 5) and `world`,
the bytes that `save_world` writes. For people there may be results, which no replay needs: `time_s` (T + 1,)
and `poses` (T + 1, A, 5) at the reset and after each step, `joint_mean` and `joint_precision` (X, Y, Z), the
team's map at the end, of worlds of up to MOST_MAP_VOXELS. Files of any other version are refused.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import msgspec
import numpy as np

from entropy_explore_env.errors import CallOrderError, EntropyExploreError, RecordError, WorldError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.snapshot import check_world_stays
from entropy_explore_env.reports.state_digest import named_digest, state_digest
from entropy_explore_env.settings.json import scenario_of, settings_of
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import checked_path
from entropy_explore_env.version import VERSION
from entropy_explore_env.worlds.files.archives import arrays
from entropy_explore_env.worlds.files.voxels import MAX_FILE_VOXELS, RefusedError
from entropy_explore_env.worlds.given import GIVEN
from entropy_explore_env.worlds.load import world_bytes, world_from_bytes
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from entropy_explore_env.worlds.world import World
from entropy_explore_env.writing import write_atomically

FORMAT = "entropy_explore_env mission"
FORMAT_VERSION = 4
MAX_FILE_BYTES = 1 << 30
RESULTS = ("time_s", "poses", "joint_mean", "joint_precision")
"""Entries for people."""
MOST_MAP_VOXELS = 1 << 24
"""Of worlds with more voxels than this a record holds no map."""
_ENTRIES = {"head", "commands", "scan_s", "scan_robot", "starts", "world", "checksum", *RESULTS}
_Text = Annotated[str, msgspec.Meta(max_length=1 << 20)]
_Digest = Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]


class Form(msgspec.Struct, kw_only=True):
    """What a file says of itself, whatever its version."""

    format: str
    version: int


class Head(Form, kw_only=True, forbid_unknown_fields=True):
    """What a record says in words and numbers; see MissionRecord."""

    library: _Text
    settings: dict[str, Any]
    seed: Annotated[str, msgspec.Meta(pattern="^[0-9]{1,4000}$")]
    episode: Annotated[int, msgspec.Meta(ge=0, lt=2**53)]
    strategy: _Text
    reward_function: _Text
    digest: _Digest
    world_digest: _Digest
    world_number: Annotated[int, msgspec.Meta(ge=0)] | None = None


@dataclass(frozen=True, eq=False)
class MissionRecord:
    """What it takes to run a mission again, and to see that it was the same one.

    Attributes:
        scenario: The task.
        seed: Of the mission.
        episode: How many resets without a seed followed.
        commands: (T, A, N) continuous or (T, A) discrete actions of T steps, also those that were ignored;
            where robots' actions differ in length, N is the longest and zeros fill the others up.
        scan_s: (S,) float64, when scans ended, in the order in which they were noted.
        scan_robot: (S,) int64, whose they were.
        digest: Of the state at the end: see `state_digest`.
        world_digest: Of the true world: see `world_digest`.
        strategy: What chose the commands; for people.
        library: Version of the library that ran the mission.
        world: The true world, where it was given as an object; None = the scenario says where it comes from.
        world_number: Of the recipe's world, where the reset was given one; None = drawn.
        starts: (A, 5) float64 poses that the reset was given; None = drawn.
        reward_function: Qualified name of the function that rewarded the robots; empty = the scenario's
            reward did. It has no part in the state: a replay does not need it.
        results: The arrays of RESULTS by name; empty = left out. A replay does not need them.

    Records compare and hash by identity: two of them are equal only if they are the same object.
    """

    scenario: Scenario
    seed: int
    episode: int
    commands: np.ndarray
    scan_s: np.ndarray
    scan_robot: np.ndarray
    digest: str
    world_digest: str
    strategy: str = ""
    library: str = VERSION
    world: World | None = None
    world_number: int | None = None
    starts: np.ndarray | None = None
    reward_function: str = ""
    results: Mapping[str, np.ndarray] = field(default_factory=dict)


class CommandRecorder:
    """Follows the first of some missions and makes its record."""

    def __init__(self, missions: Missions) -> None:
        """Follow these missions, which have just been reset, or are reset next."""
        self._missions = missions
        self._commands: list[list[np.ndarray]] = []
        self._scan_s: list[float] = []
        self._scan_robot: list[int] = []
        self._scans = missions.state.robots[0]["scans"].copy()

    def command(self, actions: Mapping[str, Any]) -> None:
        """Note the actions of all robots, by name, that the next step is given."""
        self._commands.append([np.array(actions[agent]) for agent in self._missions.scenario.agents])

    def note(self) -> None:
        """Note the reset, or which robots have scanned in the step that was just taken."""
        robots, mission = self._missions.state.robots[0], self._missions.state.missions[0]
        before = self._scans if mission["cycles"] else robots["scans"]
        time_s = float(mission["time_s"])
        numbers = self._missions.rules.params
        for robot in np.flatnonzero(robots["scans"] > before):
            waited_s = numbers[robot]["blocked_wait_s"] if robots[robot]["waiting"] else 0.0
            ended_s = min(float(robots[robot]["ready_s"] - waited_s), time_s)  # later: it has left since
            new = int(robots[robot]["scans"] - before[robot])
            self._scan_s += [ended_s] * new
            self._scan_robot += [int(robot)] * new
        self._scans = robots["scans"].copy()

    def record(
        self, strategy: str = "", results: Mapping[str, np.ndarray] = MappingProxyType({})
    ) -> MissionRecord:
        """Return the record of the mission so far.

        Args:
            strategy: What chose the commands.
            results: What is kept for people: see RESULTS.

        Raises:
            CallOrderError: The mission was never reset.
            RecordError: Its world changes under way.
        """
        missions = self._missions
        missions.check_begun("record")
        check_world_stays(missions, 0)
        starts, number, world = missions.options[0]
        return MissionRecord(
            scenario=missions.scenario,
            seed=missions.seeds[0],
            episode=missions.episodes[0],
            commands=self._table(),
            scan_s=np.asarray(self._scan_s, np.float64),
            scan_robot=np.asarray(self._scan_robot, np.int64),
            digest=state_digest(missions, 0),
            world_digest=world_digest(missions, 0),
            strategy=strategy,
            world=missions.worlds[0] if missions.given else world,
            world_number=number,
            starts=None if starts is None else starts.copy(),
            reward_function=missions.reward_function,
            results=dict(results),
        )

    def _table(self) -> np.ndarray:
        """Return the commands as one array, short ones filled up with zeros."""
        robots = self._missions.scenario.robots
        given = [action for actions in self._commands for action in actions]
        longest = max((action.size for action in given), default=1)
        if all(action.ndim == 0 for action in given):
            return np.asarray(given, np.int64).reshape(-1, robots)
        table = np.zeros((len(given), longest), np.result_type(*{action.dtype for action in given}))
        for row, action in zip(table, given, strict=True):
            row[: action.size] = action
        return table.reshape(-1, robots, longest)


def given_worlds_of(record: MissionRecord) -> dict[str, Any]:
    """Return what an environment for the record takes beside the scenario: a world that was given."""
    return {"world": record.world} if record.scenario.world == GIVEN else {}


def reset_options_of(record: MissionRecord) -> dict[str, Any]:
    """Return the options of `reset` that start the record's mission; empty where all was drawn."""
    world = record.world_number if record.scenario.world == GIVEN or record.world is None else record.world
    options = {"starts": record.starts, "world": world}
    return {name: given for name, given in options.items() if given is not None}


def same_end(record: MissionRecord, missions: Missions) -> bool:
    """Return whether the first of some missions is, bit for bit, where the record's mission ended."""
    return state_digest(missions, 0) == record.digest


def world_digest(missions: Missions, mission: int) -> str:
    """Return the SHA-256 of a mission's true world as its file or recipe gave it: its voxels and ceiling."""
    world = missions.worlds[mission]
    if world is None:
        raise CallOrderError("world_digest before reset: call reset() first")
    grid = world.grid
    parts = {
        "place": np.array([grid.voxel_size_m, *grid.origin_m]),
        "occupied": np.packbits(world.occupied),
        "shape": np.asarray(grid.shape, np.int64),
    }
    if world.ceiling is not None:
        parts["ceiling"] = world.ceiling
    if world.unreadable is not None:
        parts["unreadable"] = np.packbits(world.unreadable)
    return named_digest(parts)


def check_world(record: MissionRecord, missions: Missions) -> None:
    """Raise a WorldError where a record's world comes from a file that now holds another world."""
    world = record.scenario.world
    if world not in (*RECIPES, GIVEN) and world_digest(missions, 0) != record.world_digest:
        raise WorldError("Scenario.world", world, "the file of the recorded mission, unchanged")


def save_record(record: MissionRecord, path: Path | str) -> None:
    """Write a record to an `.npz`; the file appears only when complete.

    Raises:
        SettingError: It is no path.
        RecordError: The world is too large for a file.
        OSError: The file cannot be written.
    """
    path = checked_path("record", path)
    if record.world is not None and record.world.grid.voxels > MAX_FILE_VOXELS:
        raise RecordError("world", record.world, f"one of at most {MAX_FILE_VOXELS} voxels in a record")
    head = Head(
        format=FORMAT,
        version=FORMAT_VERSION,
        library=record.library,
        settings=settings_of(record.scenario),
        seed=str(record.seed),
        episode=record.episode,
        strategy=record.strategy,
        reward_function=record.reward_function,
        digest=record.digest,
        world_digest=record.world_digest,
        world_number=record.world_number,
    )
    entries = {
        "head": np.frombuffer(msgspec.json.encode(head), np.uint8),
        "commands": record.commands,
        "scan_s": record.scan_s,
        "scan_robot": record.scan_robot,
        **record.results,
    }
    if record.world is not None:
        entries["world"] = np.frombuffer(world_bytes(record.world), np.uint8)
    if record.starts is not None:
        entries["starts"] = record.starts
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **entries, checksum=np.asarray(_checksum(entries)))
    write_atomically(path, buffer.getvalue())


def _checksum(entries: Mapping[str, Any]) -> str:
    """Return the SHA-256 of all entries but the checksum itself."""
    return named_digest({name: np.asarray(entries[name]) for name in sorted(entries) if name != "checksum"})


def load_record(path: Path | str) -> MissionRecord:
    """Read a record.

    Raises:
        SettingError: It is no path.
        RecordError: The file is missing, broken, changed, of another format, or no record at all.
    """
    path = checked_path("record", path)
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise RefusedError(f"a file of at most {MAX_FILE_BYTES >> 30} GiB")
        entries = arrays(path.read_bytes())
        return _record(_head(entries), entries)
    except RefusedError as error:
        raise RecordError("mission record", str(path), str(error)) from None
    except OSError as error:
        raise RecordError(
            "mission record", str(path), f"a file that can be read ({error.strerror})"
        ) from None
    except EntropyExploreError as error:
        raise RecordError("mission record", str(path), f"one whose settings are allowed ({error})") from None
    except msgspec.ValidationError as error:
        allowed = f"one whose head has the right form ({error})"
        raise RecordError("mission record", str(path), allowed) from None
    except Exception:  # of a broken archive: zipfile and NumPy raise a dozen kinds
        raise RecordError("mission record", str(path), "a whole .npz that --record wrote") from None


def _head(entries: Mapping[str, np.ndarray]) -> Head:
    """Return the head of a record of this format, as it was written."""
    other = f"a mission record of format version {FORMAT_VERSION}: this one has another form"
    if "head" not in entries:  # versions before 4 had entries in its place
        older = str(entries.get("format")) == FORMAT
        raise RefusedError(other if older else "a mission record, as --record writes it")
    text = entries["head"].tobytes()
    form = msgspec.json.decode(text, type=Form)
    if (form.format, form.version) != (FORMAT, FORMAT_VERSION):
        raise RefusedError(other)
    if not entries.keys() <= _ENTRIES or _checksum(entries) != str(entries["checksum"]):
        raise RefusedError("a mission record as it was written: this one was changed or damaged")
    return msgspec.json.decode(text, type=Head)


def _record(head: Head, entries: Mapping[str, np.ndarray]) -> MissionRecord:
    """Return the record, if its entries fit each other."""
    scenario = scenario_of(head.settings)
    commands, scans = entries["commands"], len(entries["scan_s"])
    steps, longest = len(commands), commands.shape[-1]
    shapes = {"i": (steps, scenario.robots), "f": (steps, scenario.robots, longest)}
    _require(commands.shape == shapes.get(commands.dtype.kind), "commands")
    for name, kind, shape in (
        ("scan_s", np.float64, (scans,)),
        ("scan_robot", np.int64, (scans,)),
        ("starts", np.float64, (scenario.robots, 5)),
        ("time_s", np.float64, (steps + 1,)),
        ("poses", np.float64, (steps + 1, scenario.robots, 5)),
        ("joint_mean", np.float32, scenario.grid.shape),
        ("joint_precision", np.float32, scenario.grid.shape),
    ):
        array = entries.get(name)
        there = array is not None or name in ("starts", *RESULTS)
        _require(there and (array is None or (array.dtype == kind and array.shape == shape)), name)
    world = world_from_bytes(entries["world"].tobytes()) if "world" in entries else None
    _require(world is not None or scenario.world != GIVEN, "world")
    _require(world is None or (world.grid == scenario.grid and head.world_number is None), "world")
    return MissionRecord(
        scenario,
        int(head.seed),
        head.episode,
        commands,
        entries["scan_s"],
        entries["scan_robot"],
        head.digest,
        head.world_digest,
        strategy=head.strategy,
        library=head.library,
        world=world,
        world_number=head.world_number,
        starts=entries.get("starts"),
        reward_function=head.reward_function,
        results={name: entries[name] for name in RESULTS if name in entries},
    )


def _require(fits: bool, name: str) -> None:
    """Refuse a record one entry of which does not fit the others."""
    if not fits:
        raise RefusedError(f"a mission record whose entries fit each other: {name} does not")
