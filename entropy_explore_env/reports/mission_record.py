"""A mission as a file from which it can be run again, bit for bit: settings, seed, every command, a digest.

An `.npz` without pickled objects. Its entries are `format` ("entropy_explore_env mission"), `version` (3),
`library` (its version), `settings` (JSON, `settings_json`), `seed` (decimal digits), `episode`, `strategy`,
`reward_function` (a name, or empty), `commands` ((T, A, N) floating-point or (T, A) whole numbers, exactly as
given), `scan_s` and `scan_robot` (S,), `digest` and `world_digest` (SHA-256), and `checksum` (SHA-256 of all
other entries). Only where they were given: `world`, an object, as the bytes that `save_world` writes;
`world_number`; `starts`, (A, 5). Files of earlier versions are read, too: see reports/record_versions.py.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.errors import CallOrderError, EntropyExploreError, RecordError, WorldError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.record_versions import (
    FORMAT_VERSION,
    LAST_NAMED_DIGEST,
    OPTIONAL,
    REQUIRED,
    digest_of_version,
    named_digest,
)
from entropy_explore_env.reports.state_values import state_digest
from entropy_explore_env.settings.json import scenario_from_json, settings_json
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
MAX_FILE_BYTES = 1 << 30
_LONGEST_TEXT = 1 << 20
_TEXTS = ("format", "library", "settings", "seed", "strategy", "digest", "world_digest", "checksum")
_NUMBERS = ("version", "episode", "commands", "scan_s", "scan_robot")


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
        digest: Of the state at the end: see `digest_of_version`.
        world_digest: Of the true world: see `world_digest`.
        strategy: What chose the commands; for people.
        library: Version of the library that ran the mission.
        world: The true world, where it was given as an object; None = the scenario says where it comes from.
        world_number: Of the recipe's world, where the reset was given one; None = drawn.
        starts: (A, 5) float64 poses that the reset was given; None = drawn.
        reward_function: Qualified name of the function that rewarded the robots; empty = the scenario's
            reward did. It has no part in the state: a replay does not need it.
        version: Of the format, which says how the digest is made.

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
    version: int = FORMAT_VERSION


class CommandRecorder:
    """Follows the first of some missions and makes its record."""

    def __init__(self, missions: Missions) -> None:
        """Follow these missions, which have just been reset."""
        self._missions = missions
        self._commands: list[list[np.ndarray]] = []
        self._scan_s: list[float] = []
        self._scan_robot: list[int] = []
        self._scans = missions.state.robots[0]["scans"].copy()

    def command(self, actions: Mapping[str, Any]) -> None:
        """Note the actions of all robots, by name, that the next step is given."""
        self._commands.append([np.array(actions[agent]) for agent in self._missions.scenario.agents])

    def note(self) -> None:
        """Note which robots have scanned in the step that was just taken."""
        robots, time_s = self._missions.state.robots[0], float(self._missions.state.missions[0]["time_s"])
        numbers = self._missions.rules.params
        for robot in np.flatnonzero(robots["scans"] > self._scans):
            waited_s = numbers[robot]["blocked_wait_s"] if robots[robot]["waiting"] else 0.0
            ended_s = min(float(robots[robot]["ready_s"] - waited_s), time_s)  # later: it has left since
            new = int(robots[robot]["scans"] - self._scans[robot])
            self._scan_s += [ended_s] * new
            self._scan_robot += [int(robot)] * new
        self._scans = robots["scans"].copy()

    def record(self, strategy: str = "") -> MissionRecord:
        """The record of the mission so far.

        Raises:
            CallOrderError: The mission was never reset.
        """
        missions = self._missions
        if missions.episodes[0] < 0:
            raise CallOrderError("record before reset: call reset() first")
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
        )

    def _table(self) -> np.ndarray:
        """The commands as one array, short ones filled up with zeros."""
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
    """What an environment for the record takes beside the scenario: the world, where it was given to it."""
    return {"world": record.world} if record.scenario.world == GIVEN else {}


def reset_options_of(record: MissionRecord) -> dict[str, Any]:
    """The options of `reset` that start the record's mission; empty where all was drawn."""
    world = record.world_number if record.scenario.world == GIVEN or record.world is None else record.world
    options = {"starts": record.starts, "world": world}
    return {name: given for name, given in options.items() if given is not None}


def same_end(record: MissionRecord, missions: Missions) -> bool:
    """Whether the first of some missions is, bit for bit, where the record's mission ended."""
    return digest_of_version(missions, 0, record.version) == record.digest


def world_digest(missions: Missions, mission: int) -> str:
    """SHA-256 of a mission's true world as its file or recipe gave it: its voxels and ceiling."""
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
    entries = {
        "format": np.asarray(FORMAT),
        "version": np.int64(record.version),
        "library": np.asarray(record.library),
        "settings": np.asarray(settings_json(record.scenario)),
        "seed": np.asarray(str(record.seed)),
        "episode": np.int64(record.episode),
        "strategy": np.asarray(record.strategy),
        "commands": record.commands,
        "scan_s": record.scan_s,
        "scan_robot": record.scan_robot,
        "digest": np.asarray(record.digest),
        "world_digest": np.asarray(record.world_digest),
    }
    if record.version > LAST_NAMED_DIGEST:
        entries["reward_function"] = np.asarray(record.reward_function)
    if record.world is not None:
        if record.world.grid.voxels > MAX_FILE_VOXELS:
            raise RecordError("world", record.world, f"one of at most {MAX_FILE_VOXELS} voxels in a record")
        entries["world"] = np.frombuffer(world_bytes(record.world), np.uint8)
    if record.world_number is not None:
        entries["world_number"] = np.int64(record.world_number)
    if record.starts is not None:
        entries["starts"] = record.starts
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **entries, checksum=np.asarray(_checksum(entries)))
    write_atomically(path, buffer.getvalue())


def _checksum(entries: Mapping[str, Any]) -> str:
    """SHA-256 of all entries but the checksum itself."""
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
        return _record(_checked(arrays(path.read_bytes())))
    except RefusedError as error:
        raise RecordError("mission record", str(path), str(error)) from None
    except OSError as error:
        raise RecordError(
            "mission record", str(path), f"a file that can be read ({error.strerror})"
        ) from None
    except EntropyExploreError as error:
        raise RecordError("mission record", str(path), f"one whose settings are allowed ({error})") from None
    except Exception:  # of a broken archive: zipfile and NumPy raise a dozen kinds
        raise RecordError("mission record", str(path), "a whole .npz that --record wrote") from None


def _checked(entries: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The entries, all there, of this format, as they were written."""
    if str(entries.get("format")) != FORMAT:
        raise RefusedError("a mission record, as --record writes it")
    version = int(entries["version"])
    if version not in REQUIRED:
        raise RefusedError(f"a mission record of format version {', '.join(map(str, REQUIRED))}")
    needed = {*_TEXTS, *_NUMBERS, *REQUIRED[version]}
    there = set(entries)
    if not needed <= there <= needed.union(OPTIONAL[version]) or _checksum(entries) != str(
        entries["checksum"]
    ):
        raise RefusedError("a mission record as it was written: this one was changed or damaged")
    return entries


def _record(entries: dict[str, np.ndarray]) -> MissionRecord:
    """The record, if its entries fit each other."""
    texts = {name: str(entries[name]) for name in _TEXTS}
    scenario = scenario_from_json(texts["settings"])
    commands, scan_s, scan_robot = (entries[name] for name in ("commands", "scan_s", "scan_robot"))
    scans, team, version = len(scan_s), scenario.robots, int(entries["version"])
    kinds = {2: "i", 3: "f"}
    digests = (texts["digest"], texts["world_digest"])
    world = world_from_bytes(entries["world"].tobytes()) if "world" in entries else None
    reward_function = str(entries.get("reward_function", ""))
    number, starts = entries.get("world_number"), entries.get("starts")
    if (
        commands.dtype.kind != kinds.get(commands.ndim)
        or commands.shape[1] != team
        or (scan_s.dtype, scan_s.shape) != (np.float64, (scans,))
        or (scan_robot.dtype, scan_robot.shape) != (np.int64, (scans,))
        or not all(re.fullmatch("[0-9a-f]{64}", digest) for digest in digests)
        or not re.fullmatch("[0-9]{1,4000}", texts["seed"])
        or max(len(texts["strategy"]), len(reward_function)) > _LONGEST_TEXT
        or not 0 <= int(entries["episode"]) < 1_000_000
        or (scenario.world == GIVEN and world is None)
        or (scenario.world != GIVEN and world is not None and version <= LAST_NAMED_DIGEST)
        or (world is not None and world.grid != scenario.grid)
        or (number is not None and (number.shape != () or number.dtype != np.int64 or number < 0))
        or (number is not None and world is not None)
        or (starts is not None and (starts.shape != (team, 5) or starts.dtype != np.float64))
    ):
        raise RefusedError("a mission record whose entries fit each other")
    return MissionRecord(
        scenario,
        int(texts["seed"]),
        int(entries["episode"]),
        commands,
        scan_s,
        scan_robot,
        *digests,
        strategy=texts["strategy"],
        library=texts["library"],
        world=world,
        world_number=None if number is None else int(number),
        starts=starts,
        reward_function=reward_function,
        version=version,
    )
