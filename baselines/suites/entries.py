"""Entries: what a strategy came to in a suite, in a folder that can be checked without the strategy's code.

The folder holds `entry.json` (see `About`), `rows.jsonl.xz` (a row a mission) and, in `missions`, the record
of every mission. A check gives each mission of the suite the record's commands, compares the state at the end
bit for bit, computes all figures of the row again, and writes `check.json`.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from baselines.experiments.mission import SuiteMission, replay_commands, suite_figures
from baselines.experiments.origin import this_origin
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.rows import Record, Row, read_table, write_table
from baselines.experiments.trials import FAILED, Cell, CellTrial, How, described_scenario, environment
from baselines.experiments.worker_pool import Failure, run_each
from baselines.suites import find_suite
from baselines.suites.public_worlds import fetch_worlds
from baselines.suites.results import by_seed, run_suite
from baselines.suites.suite import Suite
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import EntropyExploreError, SettingError
from entropy_explore_env.reports.mission_record import load_record, same_end
from entropy_explore_env.version import VERSION
from entropy_explore_env.writing import write_atomically

ABOUT, ROWS, CHECK = "entry.json", "rows.jsonl.xz", "check.json"
_MISSIONS, _GROWING = "missions", "rows.jsonl"
Form = TypeVar("Form")
_FORM = 1
"""Version of the form of an entry: others are refused."""


class About(msgspec.Struct, forbid_unknown_fields=True):
    """What an entry says of itself."""

    form: int
    author: str
    suite: str
    quick: bool
    strategies: tuple[str, ...]
    library: str
    commit: str | None
    clean: bool


class Check(msgspec.Struct, forbid_unknown_fields=True):
    """What a check found: how many rows of how many hold, and which code found that."""

    held: int
    rows: int
    library: str
    commit: str | None
    clean: bool


@dataclass(frozen=True)
class RecordedTrial(CellTrial):
    """A mission of a suite, whose record is kept."""

    folder: Path

    def play(self, env: EntropyExploreEnv) -> Record:
        """Run the mission, and write its record."""
        assert isinstance(self.point.record, SuiteMission)
        file = record_file(self.folder, self.cell, self.seed)
        return self.point.record(env, self.point.strategy, self.seed, file)


def record_file(folder: Path, cell: str, seed: int) -> Path:
    """Return where an entry has the record of a mission."""
    return folder / _MISSIONS / f"{re.sub(r'[^A-Za-z0-9-]+', '_', cell)}-{seed:03}.npz"


def write_entry(folder: Path, suite: Suite, quick: bool, author: str, how: How) -> bool:
    """Run the missions that are missing in the folder of an entry, and write it.

    The suite, whole or its quick form, has the strategies that are entered.

    Returns:
        Whether all missions were run; if not, the same call goes on.

    Raises:
        SettingError: The folder is the entry of something else.
    """
    origin = this_origin()
    about = About(_FORM, author, suite.name, quick, suite.strategies, VERSION, origin.commit, origin.clean)
    if (folder / ABOUT).is_file():
        former = read_about(folder)
        for name in ("suite", "quick", "strategies"):
            if getattr(former, name) != getattr(about, name):
                allowed = f"{getattr(former, name)!r}, as {folder / ABOUT} says, or another folder"
                raise SettingError(name, getattr(about, name), allowed)
    (folder / _MISSIONS).mkdir(parents=True, exist_ok=True)
    write_atomically(folder / ABOUT, msgspec.json.format(msgspec.json.encode(about)).decode() + "\n")
    table, recorded = folder / _GROWING, partial(RecordedTrial, folder=folder)
    found = run_suite(suite, table, how, read_table(folder / ROWS), recorded)
    rows = [row for row in found if row is not None]
    if len(rows) < len(found):
        return False
    write_table(folder / ROWS, rows)
    for left in (table, table.with_name(f".{_GROWING}.lock"), folder / CHECK):
        left.unlink(missing_ok=True)
    return True


def read_about(folder: Path) -> About:
    """Return what an entry says of itself.

    Raises:
        SettingError: The folder is no entry, or one of another form.
    """
    about = _read(folder / ABOUT, About)
    if about.form != _FORM:
        raise SettingError("entry", about.form, f"an entry of form {_FORM}: {folder / ABOUT} has another one")
    return about


def read_check(folder: Path) -> Check | None:
    """Return what the latest check of an entry found; None = it was never checked.

    Raises:
        SettingError: The file of the check is broken.
    """
    return _read(folder / CHECK, Check) if (folder / CHECK).is_file() else None


def _read(file: Path, form: type[Form]) -> Form:
    """Return the content of a file of JSON."""
    try:
        return msgspec.json.decode(file.read_bytes(), type=form)
    except OSError as error:
        allowed = f"the folder of an entry, which --entry writes ({error.strerror})"
        raise SettingError("entry", str(file), allowed) from None
    except msgspec.DecodeError as error:
        raise SettingError("entry", str(file), f"a file that --entry writes ({error})") from None


class Claimed(NamedTuple):
    """A mission of an entry: where the suite runs it, and what the entry says."""

    cell: Cell
    seed: int
    row: Row | None
    file: Path


class Verdict(NamedTuple):
    """What a check says of a mission."""

    cell: str
    seed: int
    fault: str
    """Why its row does not hold; empty = it does."""


def check_entry(folder: Path, workers: int | RayCluster) -> tuple[About, list[Verdict]]:
    """Check every mission of the entry in a folder, and write down how many rows hold.

    Raises:
        SettingError: The folder is no entry that can be read.
        WorldError: A public world of its suite cannot be fetched.
    """
    about, rows = read_about(folder), read_table(folder / ROWS)
    suite = find_suite(about.suite, about.quick, about.strategies).completed(by_seed(rows))
    named, verdicts = {}, []
    for row in rows:
        if (row.cell, row.seed) in named:
            verdicts.append(Verdict(row.cell, row.seed, "the mission has another row, too"))
        named[row.cell, row.seed] = row
    fetch_worlds(cell.scenario for cell in suite.cells)
    claimed = [
        Claimed(trial.point, trial.seed, named.pop((trial.cell, trial.seed), None), file)
        for trial in sorted(suite.trials, key=lambda trial: (trial.cell, trial.seed))
        for file in [record_file(folder, trial.cell, trial.seed)]
    ]
    verdicts += [Verdict(cell, seed, "no mission of the suite has this row") for cell, seed in named]
    for each, fault in run_each(_fault_of, claimed, workers):
        said = fault.reason if isinstance(fault, Failure) else fault
        verdicts.append(Verdict(each.cell.id, each.seed, said))
    origin, held = this_origin(), sum(not verdict.fault for verdict in verdicts)
    check = Check(held, len(verdicts), VERSION, origin.commit, origin.clean)
    write_atomically(folder / CHECK, msgspec.json.encode(check).decode() + "\n")
    return about, sorted(verdicts)


def _fault_of(claimed: Claimed) -> str:
    """Return why a row does not hold; empty if it does."""
    row = claimed.row
    if row is None:
        return "the row is missing"
    if row.settings.get("scenario") != json.loads(json.dumps(described_scenario(claimed.cell))):
        return "the row has other settings than the suite"
    if "failed" in row.record:  # counts as the worst that a mission can come to
        figures = sorted(row.record.keys() - FAILED)
        return f"a failed mission has no {figures[0]}" if figures else ""
    try:
        return _difference(claimed, row.record)
    except EntropyExploreError as error:
        return str(error)


def _difference(claimed: Claimed, said: Record) -> str:
    """Return how the mission that a record's commands come to differs from what a row says."""
    record, mission = load_record(claimed.file), claimed.cell.record
    assert isinstance(mission, SuiteMission)
    env = environment(claimed.cell.scenario, claimed.cell.surroundings)
    env.reset(seed=claimed.seed, options=mission.options)
    given = replay_commands(env, record)
    if env.agents or given < len(record.commands):
        return "the record's commands do not end with the mission"
    if not same_end(record, env.missions):
        return "the record's commands lead to another end than the record says"
    found = json.loads(json.dumps(suite_figures(env)))
    for name in dict.fromkeys([*found, *said]):
        if name != "clock" and found.get(name) != said.get(name):
            return f"{name} is {said.get(name)} in the row, and {found.get(name)} in its mission"
    return ""
