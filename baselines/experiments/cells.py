"""Experiments as cells of missions: a cell is a scenario with a strategy, its missions differ by seed."""

from __future__ import annotations

import dataclasses
import hashlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, is_dataclass
from functools import cached_property, lru_cache
from pathlib import Path

from baselines.experiments import mission
from baselines.experiments.confirmation import keep_confirmed
from baselines.experiments.mission import Surroundings, mission_record, scripted, scripted_env
from baselines.experiments.outcome import Outcome, Record
from baselines.experiments.provenance import code_digest, modules_of
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.runner import NOT_RUN, Conditions, run_all
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import Reward

_READERS = "entropy_explore_env.worlds.files"
"""Reads world files; its modules are imported by name in a process of their own."""


@dataclass(frozen=True)
class Cell:
    """One point of an experiment.

    Attributes:
        id: Its name, also that of its folder; slashes make folders in folders.
        scenario: The task.
        strategy: Name of the strategy.
        seeds: Number of missions; their seeds are 0, 1, …, the same in every cell (paired).
        record: Runs a mission with a strategy and a seed, and says what is kept of it: a function at the top
            of a module, or a frozen dataclass that can be called. Its module, and those of its fields that
            are dataclasses, are part of the code that makes the results.
        surroundings: World files, starts and length of a step; None = those that the scenario says.
        round: When its first mission is run: all cells grow together, round by round.
        group: Name of the cells beside which a sample of one stands for all; see `confirmation`.
    """

    id: str
    scenario: Scenario
    strategy: str
    seeds: int
    record: Callable[[EntropyExploreEnv, str, int], Record] = mission_record
    surroundings: Surroundings | None = None
    round: int = 0
    group: str = ""

    @cached_property
    def settings_digest(self) -> str:
        """Of the scenario, the strategy's name, what is recorded, and the files that these name.

        Of files the content counts, and not where a world's file lies. Rewards change no scripted mission.
        """
        scenario = dataclasses.replace(scripted(self.scenario), reward=Reward())
        if Path(scenario.world).is_file():
            scenario = dataclasses.replace(scenario, world=Path(scenario.world).name)
        described = repr(
            (
                scenario,
                self.strategy,
                self.record if is_dataclass(self.record) else self.record.__qualname__,
                *(() if self.surroundings is None else (self.surroundings.without_folders(),)),
            )
        )
        for file in self._files():
            described += hashlib.sha256(file.read_bytes()).hexdigest()
        return hashlib.sha256(described.encode()).hexdigest()

    def code_digest(self) -> str:
        """Of the code that this process would run its missions with."""
        made_by = {type(part).__module__ for part in _parts(self.record) if is_dataclass(part)}
        readers = modules_of(_READERS) if self._files() else ()
        modules = sorted({mission.__name__, self.record.__module__, *made_by, *readers})
        return code_digest(*modules, strategy=self.strategy)

    def _files(self) -> list[Path]:
        """Files that the scenario and the record name."""
        named = (self.scenario.world, *(part for part in _parts(self.record) if isinstance(part, str)))
        files = [*map(Path, named), *(self.surroundings.files() if self.surroundings else ())]
        return [file for file in files if file.is_file()]


def _parts(value: object) -> list[object]:
    """A value, and where it is a dataclass the values of its fields, and of theirs."""
    fields = vars(value).values() if is_dataclass(value) else ()
    return [value, *(part for each in fields for part in _parts(each))]


@dataclass(frozen=True)
class CellMission:
    """One mission of a cell, as the runner takes it."""

    cell: Cell
    seed: int

    @property
    def round(self) -> int:
        """When its turn is; see `Cell.round`."""
        return self.cell.round + self.seed

    @property
    def group(self) -> str:
        """The name of its group of cells; that of its cell, if this is in none."""
        return self.cell.group or self.cell.id

    @property
    def file(self) -> str:
        """Its file in the folder of results, without suffix."""
        return f"{self.cell.id.replace('..', '__')}/seed-{self.seed}"  # a strategy may be named by a path

    @property
    def settings_digest(self) -> str:
        """Of all that decides the result but the code; the file's name says the seed."""
        return self.cell.settings_digest

    def code_digest(self) -> str:
        """Of the code that this process would run it with."""
        return self.cell.code_digest()

    def run(self) -> Outcome:
        """Run the mission in this process."""
        try:
            env = _environment(self.cell.scenario, self.cell.surroundings)
            return Outcome(self.cell.record(env, self.cell.strategy, self.seed))
        except BaseException:
            _environment.cache_clear()  # it stopped in the middle of something
            raise


@lru_cache(maxsize=1)
def _environment(scenario: Scenario, surroundings: Surroundings | None) -> EntropyExploreEnv:
    """Kept for the next mission."""
    return scripted_env(scenario, surroundings)


def missions_of(cells: Sequence[Cell]) -> list[CellMission]:
    """All missions of some cells, in the order in which they are run."""
    missions = [CellMission(cell, seed) for cell in cells for seed in range(cell.seeds)]
    return sorted(missions, key=lambda one: one.round)


def run_cells(
    cells: Sequence[Cell],
    folder: Path,
    workers: int | RayCluster,
    title: str,
    quiet: bool,
    limit_s: float = math.inf,
    keep_failures: bool = False,
    stop_after_s: float = math.inf,
    confirm: bool = False,
    tries: int | None = None,
) -> dict[str, list[Record]]:
    """Run what is missing of an experiment, under a progress bar.

    All cells grow together, round by round: so the bar's time left means something from the first round on,
    and what was stopped has as many missions of each.

    Args:
        cells: The points.
        folder: For one file a mission.
        workers: Processes of this machine, or a Ray cluster.
        title: Of the progress bar.
        quiet: Show no bar.
        limit_s: Of every mission, on the clock.
        keep_failures: See `runner.Conditions`.
        stop_after_s: Likewise.
        confirm: Keep what other code ran where samples come out the same; see `confirmation`.
        tries: A group of cells of whose first so many missions none was finished is not run any further; None
            = all are run.

    Returns:
        Cell id → records by seed; see `mission.record_mission` for what one holds. Where the time was up, or
        a group is not run further, `runner.NOT_RUN`.
    """
    missions = missions_of(cells)
    conditions = Conditions(folder, workers, title, quiet, limit_s, keep_failures)
    ends_s = time.monotonic() + stop_after_s
    if confirm:
        left = dataclasses.replace(conditions, stop_after_s=stop_after_s)
        keep_confirmed(missions, [one.group for one in missions], left)
    parts = {title: missions}
    if tries is not None:
        parts = {
            f"{title}, first {tries} missions": [one for one in missions if one.round < tries],
            title: [one for one in missions if one.round >= tries],
        }
    found: dict[str, Record] = {}
    going_on = {one.group for one in missions}
    for shown, part in parts.items():
        chosen = [one for one in part if one.group in going_on]
        left = dataclasses.replace(conditions, title=shown, stop_after_s=ends_s - time.monotonic())
        ran = list(zip(chosen, run_all(chosen, left), strict=True))
        found |= {one.file: record for one, record in ran}
        going_on = {one.group for one, record in ran if _came_to_end(record)}
    records: dict[str, list[Record]] = {cell.id: [] for cell in cells}
    for one in missions:
        records[one.cell.id].append(found.get(one.file, NOT_RUN))
    return records


def _came_to_end(record: Record) -> bool:
    """Whether a mission was finished, or was not run yet."""
    return "failed" not in record and record.get("finished", True)
