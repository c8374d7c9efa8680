"""The policies that come with the project, tested: `python -m training.policy_improvement.results_page`.

Each policy over candidates runs beside the strategy that is recommended, on the same starts, in worlds that
nothing was learned in: in the tasks that it learned, there also beside the planner whose candidates it
chooses among and `information-rate-v0`, and in others, with other teams, channels and sensors. Written is
`policy.md`, and beside it each policy's part of the page and all of its missions as one file, with which
another run begins (`--archive`). Missions are kept, a file each: what was stopped goes on, and a part says
how many starts it holds. Tasks that stand in suites, too, are theirs: archives of the scoreboard serve, too.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.cli.worker_options import WorkerOptions
from baselines.experiments.archive import read_archive, write_archive
from baselines.experiments.cells import Cell, missions_of, run_cells
from baselines.experiments.outcome import Record
from baselines.experiments.runner import NOT_RUN
from baselines.experiments.tables import markdown_table
from baselines.scoreboard.page import ARCHIVE, CONFIRMED, PART
from baselines.scoreboard.results import Measure, limit_of, value
from baselines.scoreboard.suites import Suite, Task, plans, task_in, team_name
from baselines.strategies import resolved
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import SCENARIOS
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training import extra  # noqa: F401 - before what is not there without it
from training.checkpoints import latest_checkpoint, load_checkpoint
from training.policy import POLICIES, policy_folder
from training.policy_improvement import ablations, headroom
from training.policy_improvement.comparison import Paired, paired

_BEST, _DUNGEONS = resolved("best"), "dungeons"
_OTHERS = ("planner-choice", "information-rate-v0")
_LOST: Mapping[str, Any] = {"channel": {"loss_probability": 0.5}}
_NARROW: Mapping[str, Any] = {"channel": {"burst": 16}}
"""A quarter of what the scenarios let pass."""
_STARTS_OF_LONG = 30
"""Where missions are long, no more starts are run."""


@dataclass(frozen=True)
class Test:
    """A task that a policy is tested in.

    Attributes:
        name: Of the scenario.
        robots: Team size.
        changes: Settings that differ, and what they are called.
        learned: Whether the policy learned in this task, in other worlds.
        short: Whether missions are short.
        goal, goal_v0: The ratio to the recommended strategy, and to information-rate-v0, that was asked for.
    """

    __test__ = False

    name: str
    robots: int
    changes: Mapping[str, Any] = field(default_factory=dict)
    words: str = ""
    learned: bool = False
    short: bool = False
    goal: float | None = None
    goal_v0: float | None = None

    @property
    def title(self) -> str:
        """As the table says it."""
        return team_name(self.name, self.robots) + (f", {self.words}" if self.words else "")

    @property
    def measure(self) -> Measure:
        """What is compared: time, or in the dungeons, as their authors do, the path."""
        return Measure("path_m" if self.name == _DUNGEONS else "time_s")

    def measured(self, record: Record) -> float:
        """The measure of a mission; of one that was not finished what it could have come to at most."""
        reached = value(record, self.measure)
        return limit_of(self.task, self.measure) if reached is None else reached

    def cells(self, strategy: str, seeds: int) -> list[Cell]:
        """Missions of a strategy, from so many starts at most."""
        places, starts = self.task.places, seeds if self.short else min(seeds, _STARTS_OF_LONG)
        if self.name == _DUNGEONS:
            some = places[:starts]
        else:
            some = tuple(replace(place, missions=starts) for place in places)
        return Suite("own", (replace(self.task, places=some),), (strategy,)).cells

    @cached_property
    def task(self) -> Task:
        """As the suites have it: the dungeons, or worlds of a scenario's test split."""
        if self.name == _DUNGEONS:
            return plans()[0]
        settings = {"robots": self.robots, **self.changes}
        return task_in(self.title, with_settings(SCENARIOS[self.name], settings), 1)


TESTS: dict[str, tuple[Test, ...]] = {
    "plans": (
        Test("office", 1, learned=True, goal=0.92, goal_v0=0.70),
        Test("office", 3, learned=True, goal=0.92, goal_v0=0.70),
        Test("hybrid", 1, learned=True),
        Test(_DUNGEONS, 1, goal=0.95),
        Test("corridor", 1, goal=1.0),
        Test("cluttered", 1, goal=1.0),
        Test("office", 2, goal=1.0),
        Test("office", 4, goal=1.0),
        Test("office", 3, _LOST, "half of the messages lost", goal=1.0),
        Test("office", 3, _NARROW, "burst 16", goal=1.0),
        Test("office", 1, {"sensor": {"max_range_m": 5.0}}, "lidar of 5 m", goal=1.0),
    ),
    "volumes": (
        Test("room-furnished", 3, learned=True, short=True, goal=0.95, goal_v0=0.83),
        Test("cave", 3, learned=True, goal=0.93, goal_v0=0.76),
        Test("office-3d", 3, learned=True, goal=0.95),
        Test("room", 3, short=True, goal=1.01),
        Test("room-furnished", 1, goal=1.0),
        Test("room-furnished", 4, short=True, goal=1.0),
        Test("cave", 1, goal=1.0),
        Test("office-3d", 1, goal=1.0),
        Test("room-furnished", 3, _LOST, "half of the messages lost", short=True, goal=1.0),
        Test("room-furnished", 3, _NARROW, "burst 16", short=True, goal=1.0),
    ),
}


@dataclass
class Args(WorkerOptions):
    """Test the policies over candidates that come with the project."""

    seeds: int = 100
    """Starts of each task in which missions are short; of the others 30 at most."""
    policies: str = ",".join(TESTS)
    """Which, commas between; of others the page keeps the parts that earlier runs wrote."""
    stop_after_s: float = math.inf
    """Time on the clock after which no mission is begun any more; the page then holds what was run."""
    wall_limit_s: float = 3600.0
    """Time on the clock after which a mission is ended, and counts as failed."""
    confirm: bool = False
    """Keep missions that other code ran, of each strategy and task whose first mission comes out the same
    when it is run again; else a change of the code runs all again."""
    archive: tuple[Path, ...] = ()
    """Files missions.jsonl.xz of earlier runs, of this page or of the scoreboard: their missions of the same
    settings are not run again; what other code ran counts with --confirm."""
    out: Path = Path("results/policy")
    """Folder for policy.md and, in policy, a folder of each policy."""
    runs: Path | None = None
    """Folder that keeps the missions; default: runs in --out."""


class Compared(NamedTuple):
    """A policy beside another strategy, on the same starts."""

    starts: int
    finished: tuple[int, int]
    """Missions of the policy, and of the other, that came to their end."""
    measured: Paired
    decision_ms: tuple[float, float]
    """Median time on the clock that a decision of one robot took."""

    def holds(self, goal: float) -> bool:
        """Whether a goal is reached: see the head of the page."""
        ratio = self.measured.ratio
        clear = goal >= 1.0 or ratio.high < 1.0
        return ratio.value <= goal and clear and self.finished[0] >= self.finished[1]


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_whole("seeds", args.seeds, 1)
    for name in ("stop_after_s", "wall_limit_s"):
        if not getattr(args, name) > 0.0:
            raise SettingError(name, getattr(args, name), "a number > 0")
    names = list(dict.fromkeys(args.policies.split(",")))
    workers = args.workers
    for name in names:
        policy_folder(f"pretrained:{name}")  # refuses those that there are not
        if name not in TESTS:
            raise SettingError("policies", name, "some of " + ", ".join(TESTS))
    make_folder("out", args.out)
    beside = args.out / FILES
    experiments = Experiments(headroom.shown(beside / "headroom"), ablations.shown(beside / "ablations"))
    rows = {
        name: [(test, strategy) for test in TESTS[name] for strategy in _strategies(name, test)]
        for name in names
    }
    cells = {
        (name, test.title, strategy): test.cells(strategy, args.seeds)
        for name, pairs in rows.items()
        for test, strategy in pairs
    }
    wanted, runs = [cell for group in cells.values() for cell in group], args.runs or args.out / "runs"
    make_folder("runs", runs)
    missions = missions_of(wanted)
    for file in args.archive:
        print(f"{read_archive(file, runs, missions):,} missions taken from {file}", file=sys.stderr)
    records = run_cells(
        wanted,
        runs,
        workers,
        "policies tested",
        quiet=False,
        limit_s=args.wall_limit_s,
        keep_failures=True,
        stop_after_s=args.stop_after_s,
        confirm=args.confirm,
    )
    found = {key: [each for cell in group for each in records[cell.id]] for key, group in cells.items()}
    for name in names:
        make_folder("out", beside / name)
        own = [cell for key, group in cells.items() if key[0] == name for cell in group]
        write_archive(beside / name / ARCHIVE, runs, missions_of(own))
        write_atomically(beside / name / PART, "\n".join(_policy_parts(name, found, args.confirm)))
    parts = {name: beside / name / PART for name in TESTS}
    written = [file.read_text("utf-8") for file in parts.values() if file.is_file()]
    page = args.out / "policy.md"
    write_atomically(page, "\n".join(_page(written, experiments)))
    print(f"written: {page}")
    return 0


def _strategies(name: str, test: Test) -> tuple[str, ...]:
    """Who runs in a task."""
    others = _OTHERS if test.learned else ()
    return (f"pretrained:{name}", _BEST, *others)


def compared(test: Test, ours: Sequence[Record], theirs: Sequence[Record]) -> Compared | None:
    """Both on the starts that both ran; None = on none."""
    pairs = [pair for pair in zip(ours, theirs, strict=True) if NOT_RUN not in pair]
    if not pairs:
        return None
    own, other = (np.array([test.measured(pair[side]) for pair in pairs]) for side in (0, 1))
    own_finished, other_finished = (sum(_finished(pair[side]) for pair in pairs) for side in (0, 1))
    return Compared(
        len(pairs),
        (own_finished, other_finished),
        paired(own, other),
        (_decision_ms([pair[0] for pair in pairs]), _decision_ms([pair[1] for pair in pairs])),
    )


def _decision_ms(records: Sequence[Record]) -> float:
    """The median over missions of their median decision; 0 where all failed."""
    clocks = [record["clock"]["decision_ms"] for record in records if "failed" not in record]
    return float(np.median(clocks)) if clocks else 0.0


def _finished(record: Record) -> bool:
    return "failed" not in record and bool(record["finished"])


FILES = "policy"
"""Folder beside the page, with one of each policy: its part of the page, and its missions."""


class Experiments(NamedTuple):
    """Tables of other commands, in Markdown; empty where they were not run."""

    headroom: str
    ablations: str


Found = Mapping[tuple[str, str, str], Sequence[Record]]


def _page(policies: Sequence[str], experiments: Experiments) -> list[str]:
    """The page, part by part."""
    parts = [
        "# Policies that choose among a planner's candidates\n",
        "The policies "
        f"come from `make policy`. Each runs beside the recommended strategy, `{_BEST}`, on the same starts, "
        "in worlds of the test split; the dungeons have no splits, and none was learned in. A ratio is the "
        "policy's over that of the other: below 1 the policy is faster. Intervals are 95 %, of a bootstrap "
        "paired by start; worst tenth is the ratio of the 90th percentiles; ms a decision are on the clock. "
        "In the dungeons the path counts, as with their authors, elsewhere the mission's time; a mission "
        "that was not finished counts with its time limit, and with the path that could be driven in it. A "
        "goal holds if the ratio of medians is at most the goal, for goals below 1 also its interval ends "
        "below 1, and the policy finished no fewer missions than the other.\n",
    ]
    if experiments.headroom:
        parts += [_TO_WIN, experiments.headroom]
    parts += policies
    if experiments.ablations:
        parts += [_ABLATIONS, experiments.ablations]
    return parts


_TO_WIN = """## What there is to win

Written by `python -m training.policy_improvement.headroom --out docs/results/policy/headroom` with
`--scenario` and `--robots`, in worlds of training: geometric means of mission times over those of the
planner, on the same starts. The planner takes its own choice among the candidates that policies choose
among. The clairvoyant tries the eight best of them in branches of the mission as it will happen, each led to
its end by the planner, and keeps the best: no policy can know what it knows. Where it gains less than a
tenth, little is to be won by choosing better among these candidates, and to match the planner is what can be
asked of a policy. Discrete actions are those of `training.ppo`.
"""


_ABLATIONS = """## What the stages are worth

Written by `python -m training.policy_improvement.ablations --out docs/results/policy/ablations`: the stages
without one of them, at small cost, on several seeds of labels, weights and missions. Ratios are of mission
times to those of the planner whose candidates are chosen among, in worlds of validation, paired by start,
geometric means.
"""


def _policy_parts(name: str, found: Found, confirmed: bool) -> list[str]:
    """The part of a policy."""
    policy, flags, said = f"pretrained:{name}", "", ""
    if confirmed:
        flags, said = " --confirm", CONFIRMED
    learned = [test for test in TESTS[name] if test.learned]
    others = [test for test in TESTS[name] if not test.learned]
    return [
        f"## `{policy}`\n",
        f"Written by `python -m training.policy_improvement.results_page --policies {name}{flags} "
        f"--out docs/results`.{said} All missions lie in [`{ARCHIVE}`]({FILES}/{name}/{ARCHIVE}).\n",
        _how_learned(policy),
        f"In tasks that it learned, in other worlds, against `{_BEST}`:\n",
        _table(name, learned, _BEST, found),
        "Against the planner whose candidates it chooses among, `planner-choice`:\n",
        _table(name, learned, "planner-choice", found),
        "Against `information-rate-v0`:\n",
        _table(name, learned, "information-rate-v0", found),
        f"In tasks, teams, channels and sensors that it did not learn, against `{_BEST}`:\n",
        _table(name, others, _BEST, found),
    ]


def _table(name: str, tests: Sequence[Test], against: str, found: Found) -> str:
    """The policy against another strategy, a row a task."""
    head = ["task", "starts", "finished", "policy", "other"]
    head += ["ratio of medians", "mean of ratios", "worst tenth", "ms a decision", "goal", "holds"]
    rows = []
    for test in tests:
        ours, theirs = (found[name, test.title, each] for each in (f"pretrained:{name}", against))
        result = compared(test, ours, theirs)
        goal = {_BEST: test.goal, _OTHERS[1]: test.goal_v0}.get(against)
        if result is not None:
            rows.append(_row(test, result, goal))
    return markdown_table(head, rows)


def _row(test: Test, result: Compared, goal: float | None) -> list[str]:
    unit = "m" if test.measure.figure == "path_m" else "s"
    own, other = (f"{median:,.0f} {unit}" for median in result.measured.medians)
    return [
        test.title,
        str(result.starts),
        "{} and {}".format(*result.finished),
        own,
        other,
        result.measured.ratio.text(),
        result.measured.mean_ratio.text(),
        f"{result.measured.worst_tenth:.2f}",
        "{:.1f} and {:.1f}".format(*result.decision_ms),
        "" if goal is None else f"≤ {goal:.2f}",
        "" if goal is None else "yes" if result.holds(goal) else "no",
    ]


def _how_learned(policy: str) -> str:
    """What the search came to, as the checkpoint says it."""
    progress = load_checkpoint(latest_checkpoint(policy_folder(policy), *POLICIES)).progress
    learned = progress.get("search")
    if not learned:
        return ""
    searches = [learned]
    while "before" in searches[0]:
        searches.insert(0, searches[0]["before"])
    rows = [
        [str(number), ", ".join(one.get("tasks", ())), f"{each['mean_s']:.1f} s", f"{each['slope']:.3f}"]
        for one in searches
        for number, each in enumerate(one["rounds"], start=1)
    ]
    head = ["round", "tasks", "missions take", "slope"]
    if not any(one.get("tasks") for one in searches):  # checkpoints did not always hold them
        head.remove("tasks")
        rows = [[number, *figures] for number, _, *figures in rows]
    heaviest = sorted(learned["weights"].items(), key=lambda item: -abs(item[1]))
    words = ", ".join(f"{name} {weight:+.2f}" for name, weight in heaviest)
    return (
        "How the search went: mission times (geometric mean over its tasks, around the weights of the "
        "round), and by which share they fall with a step of σ against the slope.\n\n"
        + markdown_table(head, rows)
        + f"\nWeights of features, in the logits: {words}.\n"
    )


if __name__ == "__main__":
    raise SystemExit(run_command(main))
