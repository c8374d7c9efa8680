"""Find weights of the planner's features by pairs of whole missions: `pretrained:plans` is such a set.

    python -m training.search --tasks office:1 office:3 hybrid:1 --out runs/weights
    python -m training.evaluate --strategy runs/weights/weights.json

The weights w of `planner.weights` are changed along random directions (Mania, Guy & Recht 2018). A pair is a
mission that is run twice from the same start, with w + δ and with w - δ,

    δ_f = σ e_f / d_f,   e ~ N(0, 1),   d_f = spread of feature f among a robot's candidates,

and half the difference of the logarithms of both mission times is a sample of the slope along e,

    y = ½ (ln t₊ - ln t₋) ≈ g · e.

A round runs pairs in every task. Then g is the mean over the tasks of what least squares find, where pairs of
earlier rounds count half as much with every round; it is shrunk towards zero as far as it is uncertain (James
& Stein 1961), and w goes a step against it, a shorter one where much was shrunk.

The folder gets `pairs.jsonl`, a line for each pair when it is done, and after every round `weights.json`. The
same command goes on with the first pair that is missing, and comes to the same weights.
"""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from baselines.cli.arguments import given_values, make_folder, parse, print_json, run_command
from baselines.cli.interruption import Interruption
from baselines.cli.worker_options import WorkerOptions
from baselines.experiments.mission import counted_time_s, run_mission, scripted_env
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.worker_pool import Failure, run_each
from entropy_explore_env.command import INTERRUPTED
from entropy_explore_env.errors import SettingError
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.planner.candidate_features import COLUMNS
from entropy_explore_env.planner.weights import CANDIDATES, PlannerWeights, read_weights
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import check_whole, is_number
from entropy_explore_env.version import VERSION
from entropy_explore_env.writing import write_atomically
from training.evaluate import task_of  # which says what is missing without the extra
from training.validation import OWN, pair_seeds

SEARCHED = (
    "bits_log", "seconds", "kept", "spot", "far", "soonness", "again", "unique", "common", "slivers",
    "elsewhere", "advantage", "unknown", "depth", "distance", "directness", "announced_most", "contest",
    "turn_cos",
)  # fmt: skip
"""Features whose weights are searched: not those that the logits hold already, nor those that tell left from
right or follow from others."""
_COLUMNS = np.array([COLUMNS[name] for name in SEARCHED])
_LEAST_SPREAD, _NO_SPREAD = 0.03, 1e-6
_SPREAD_MISSIONS = 2
_LAST_STEP = 0.3
"""Length of the last step, as a share of the first one's."""
_SPREADS = "spreads"
_OLDER = 0.5
"""Weight of a round's pairs, relative to those of the round after it."""
_RIDGE = 1.0
_STOPPED = "pairs that are done are kept, those under way are run again"


@dataclass
class Args(WorkerOptions):
    """Find weights of the planner's features by pairs of whole missions."""

    usual: ClassVar = (
        *("tasks", "out", "begin", "candidates", "rounds", "pairs", "sigma", "step", "seed"),
        *("jobs", "cluster", "json"),
    )

    tasks: tuple[str, ...] = ("office:1", "office:3", "hybrid:1")
    """Named scenarios with their robots, NAME:ROBOTS; worlds of the split train."""
    out: Path = Path("runs/weights")
    """Folder of the search; the same command goes on with what is there."""
    begin: Path | None = None
    """A file of weights to begin with; default: those of the planner, which are 0."""
    candidates: int = CANDIDATES
    """Viewpoints that the planner proposes at most."""
    rounds: int = 8
    """How often the weights are changed."""
    pairs: int = 30
    """Pairs of missions, in each task and round."""
    sigma: float = 0.3
    """By how much logits of candidates change that differ by a feature's spread."""
    step: float = 1.0
    """Length of the first step, in units of sigma; steps grow shorter to the last."""
    seed: int = 0
    """Seed of missions and directions."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check(args)
    scenarios = tuple(learned_scenario(task) for task in args.tasks)
    begun = PlannerWeights(candidates=args.candidates) if args.begin is None else read_weights(args.begin)
    if "candidates" in given_values(Args, words) and args.candidates != begun.candidates:
        allowed = f"{begun.candidates}, as the weights in --begin have"
        raise SettingError("candidates", args.candidates, allowed)
    workers = args.workers
    make_folder("out", args.out)
    origin = {name: getattr(args, name) for name in ("rounds", "pairs", "sigma", "step", "seed")}
    tasks = [settings_of(scenario) for scenario in scenarios]
    origin |= {"version": VERSION, "tasks": tasks, "begin": json.loads(begun.text())}
    results = Results(args.out / "pairs.jsonl", origin)
    with Interruption(_STOPPED) as interruption:
        found = Search(args, scenarios, begun, results, workers, interruption).run()
    if found is None:
        print(f"stopped; the same command goes on with what is in {args.out}", file=sys.stderr)
        return INTERRUPTED
    if args.json:
        print_json({"weights": dict(found.weights), "files": [str(args.out / "weights.json")]})
    else:
        print(f"written: {args.out / 'weights.json'}")
    return 0


def check(args: Args) -> None:
    """Raise a SettingError where an option is out of its range."""
    if not args.tasks:
        raise SettingError("tasks", args.tasks, "one or more, NAME:ROBOTS")
    for name in ("rounds", "pairs", "candidates"):
        check_whole(name, getattr(args, name), 1)
    check_whole("seed", args.seed, 0)
    for name in ("sigma", "step"):
        if not 0.0 < getattr(args, name) < math.inf:
            raise SettingError(name, getattr(args, name), "a number above 0")


def learned_scenario(task: str) -> Scenario:
    """Return the scenario of a task, in worlds of training and with a time limit that a search can bear."""
    scenario = task_of(task)
    limit_s = min(scenario.ending.time_limit_s, OWN["ending"]["time_limit_s"])
    return with_settings(scenario, {"split": "train", "ending": {"time_limit_s": limit_s}})


class Results:
    """A file of results in lines of JSON, the first of which says what they come from.

    A last line that is not whole, of a run that was killed, counts as missing.

    Attributes:
        known: Name of a result → its numbers, all finite and ≥ 0.
    """

    def __init__(self, file: Path, origin: Mapping[str, Any]) -> None:
        """Read the file; one that is not there begins with the origin.

        Raises:
            SettingError: It is broken, or of a search with other options.
        """
        self._file = file
        if not file.is_file():
            write_atomically(file, json.dumps(origin) + "\n")
        try:
            *lines, torn = file.read_text("utf-8").split("\n")
            head, *rows = [json.loads(line) for line in lines]
        except (OSError, ValueError, RecursionError):
            raise SettingError("out", str(file), "lines of JSON that training.search wrote") from None
        for name, value in json.loads(json.dumps(origin)).items():
            if not isinstance(head, dict) or head.get(name) != value:
                allowed = f"the value of the search whose results {file} holds, or another folder --out"
                raise SettingError(name, value, allowed)
        self.known: dict[str, list[float]] = dict(self._checked(row) for row in rows)
        if torn:
            write_atomically(file, "\n".join(lines) + "\n")

    def _checked(self, row: object) -> tuple[str, list[float]]:
        match row:
            case [str(name), list(numbers)] if all(
                is_number(each) and 0 <= each < math.inf for each in numbers
            ):
                if len(numbers) == (len(SEARCHED) if name == _SPREADS else 3):
                    return name, numbers
        allowed = f"a name and its numbers in {self._file}: remove that line"
        raise SettingError("result", str(row)[:60], allowed)

    def add(self, name: str, numbers: list[float]) -> None:
        """Write a result down."""
        self.known[name] = numbers
        with self._file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps([name, numbers]) + "\n")


class Lead(NamedTuple):
    """A mission that is led by weights."""

    name: str  # of the result that it belongs to
    part: int  # 1 for w + δ, 0 for w - δ; where spreads are measured, the number of the task
    scenario: Scenario
    weights: PlannerWeights
    seed: int


def play(lead: Lead) -> tuple[float, bool]:
    """Run a mission; return its time, the time limit where it was not finished, and whether it was."""
    env = scripted_env(lead.scenario)
    run_mission(env, PlannedRate(lead.weights), lead.seed)
    figures = mission_figures(env.missions, 0)
    return counted_time_s(figures, lead.scenario), bool(figures["finished"])


class Spreads:
    """Leads missions as the planner does, and sums up how much features vary among a robot's candidates."""

    def __init__(self, candidates: int) -> None:
        """Take the number of candidates."""
        self._form = {"action": {"kind": "candidates", "candidates": candidates}}
        self.variances, self.decisions = np.zeros(len(SEARCHED)), 0

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        self._proposer = ViewProposer(with_settings(scenario, self._form), rng)

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the planner's own choice (5,)."""
        proposed = self._proposer.propose(view)
        if len(proposed) > 1:
            features = self._proposer.features(view.robot)[: len(proposed), _COLUMNS]
            self.variances += features.astype(np.float64).var(axis=0)
            self.decisions += 1
        return proposed[0].copy()


def spreads_in(lead: Lead) -> tuple[np.ndarray, int]:
    """Return variances (S,) of features, summed over the decisions of a mission, and how many these are."""
    strategy = Spreads(lead.weights.candidates)
    run_mission(scripted_env(lead.scenario), strategy, lead.seed)
    return strategy.variances, strategy.decisions


class Pairs(NamedTuple):
    """Results of N pairs of missions in one task and round."""

    directions: np.ndarray  # (N, S) e
    slopes: np.ndarray  # (N,) y
    ln_times: np.ndarray  # (N,) mean of both logarithms of seconds
    finished: float = 1.0  # share of the missions that were finished


def shrunk_slope(history: Sequence[Sequence[Pairs]]) -> tuple[np.ndarray, float]:
    """Return the slope g from the pairs of all rounds so far, of which the latest count most.

    Args:
        history: Of each round a Pairs for each task.

    Returns:
        (S,) g, shrunk towards zero as far as it is uncertain; and how long it should be without that, 0 where
        it is no longer than chance makes it on average.
    """
    tasks, size = len(history[-1]), history[-1][0].directions.shape[1]
    slope, covariance = np.zeros(size), np.zeros((size, size))
    for task in range(tasks):
        parts = [parts[task] for parts in history]
        directions = np.concatenate([part.directions for part in parts])
        slopes = np.concatenate([part.slopes for part in parts])
        ages = np.repeat(np.arange(len(parts))[::-1], [len(part.slopes) for part in parts])
        own, uncertain = _least_squares(directions, slopes, _OLDER**ages)
        slope, covariance = slope + own / tasks, covariance + uncertain / tasks**2
    variance = max(float(slope @ slope - np.trace(covariance)) / size, 0.0)
    if variance == 0.0:
        return np.zeros(size), 0.0
    shrunk = variance * np.linalg.solve(variance * np.eye(size) + covariance, slope)
    return shrunk, math.sqrt(size * variance)


def _least_squares(
    directions: np.ndarray, slopes: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the slope (S,) that fits best, and its covariance (S, S)."""
    size = directions.shape[1]
    weighted = directions.T * weights
    inverse = np.linalg.inv(weighted @ directions + _RIDGE * np.eye(size))
    leaves = np.eye(len(slopes)) - directions @ inverse @ weighted  # what is left over, from what there was
    left, freedom = leaves @ slopes, float((weights[:, None] * leaves**2).sum())
    noise = float(weights @ left**2) / max(freedom, 1e-9)
    return inverse @ (weighted @ slopes), noise * inverse @ (weighted * weights) @ directions @ inverse


@dataclass
class Search:
    """A search: options, tasks, the weights that it begins with, what is known, and where missions run."""

    args: Args
    scenarios: tuple[Scenario, ...]
    begun: PlannerWeights
    results: Results
    workers: int | RayCluster
    interruption: Interruption

    def run(self) -> PlannerWeights | None:
        """Search from where the results end; return the weights, or None if Ctrl-C stopped that."""
        if _SPREADS not in self.results.known:
            self.results.add(_SPREADS, self._measured_spreads())
        args, spreads = self.args, np.array(self.results.known[_SPREADS])
        centre, history, weights = np.zeros(len(SEARCHED)), [], self.begun
        steps = args.step * args.sigma * np.linspace(1.0, _LAST_STEP, args.rounds)
        for number in range(args.rounds):
            parts = []
            for task in range(len(self.scenarios)):
                part = self._pairs(number, task, centre, spreads)
                if part is None:
                    return None
                parts.append(part)
            history.append(parts)
            slope, length = shrunk_slope(history)
            if length > 0.0:
                centre = centre - steps[number] * slope / length
            weights = dataclasses.replace(self._changed(centre, spreads), tasks=args.tasks)
            write_atomically(args.out / "weights.json", weights.text())
            if not args.json:
                mean_s = math.exp(np.mean([part.ln_times.mean() for part in parts]))
                share = float(np.mean([part.finished for part in parts]))
                shown = f"{mean_s:.1f} s, {share:.0%} finished, slope {length:.4f}"
                print(f"round {number + 1} of {args.rounds}: {shown}", flush=True)
        return weights

    def _measured_spreads(self) -> list[float]:
        """Return (S,) the standard deviation of each feature among the candidates of a robot.

        It is the mean over those tasks in which the feature varies; 0 where it varies in none.
        """
        seeds = pair_seeds(self.args.seed, 0, _SPREAD_MISSIONS)  # those of the first pairs
        leads = [
            Lead(_SPREADS, task, scenario, self.begun, seed)
            for task, scenario in enumerate(self.scenarios)
            for seed in seeds
        ]
        sums, counts = np.zeros((len(self.scenarios), len(SEARCHED))), np.zeros(len(self.scenarios))
        for lead, result in run_each(spreads_in, leads, self.workers):
            if isinstance(result, Failure):
                result.throw()
            else:
                sums[lead.part] += result[0]
                counts[lead.part] += result[1]
        found = np.sqrt(sums / np.maximum(counts, 1)[:, None])
        varies = found > _NO_SPREAD
        mean = found.sum(axis=0, where=varies) / np.maximum(varies.sum(axis=0), 1)
        return np.where(varies.any(axis=0), np.maximum(mean, _LEAST_SPREAD), 0.0).tolist()

    def _changed(self, change: np.ndarray, spreads: np.ndarray) -> PlannerWeights:
        """Return the weights changed by (S,) in spreads; those of features that do not vary stay."""
        moved = dict(self.begun.weights)
        for name, by, spread in zip(SEARCHED, change.tolist(), spreads.tolist(), strict=True):
            if spread > 0.0:
                moved[name] = moved.get(name, 0.0) + by / spread
        return dataclasses.replace(self.begun, weights=moved)

    def _pairs(self, number: int, task: int, centre: np.ndarray, spreads: np.ndarray) -> Pairs | None:
        """Run the pairs of a round and task that are missing; None if Ctrl-C stopped that."""
        args, known = self.args, self.results.known
        part, size = number * len(self.scenarios) + task, (args.pairs, len(SEARCHED))
        directions = np.random.default_rng([args.seed, part]).standard_normal(size)
        names = [f"round {number + 1}, {args.tasks[task]}, pair {part}.{pair}" for pair in range(args.pairs)]
        leads = [
            Lead(name, plus, self.scenarios[task], self._changed(centre + sign * e, spreads), seed)
            for name, e, seed in zip(
                names, args.sigma * directions, pair_seeds(args.seed, part, args.pairs), strict=True
            )
            for plus, sign in ((1, 1.0), (0, -1.0))
            if name not in known
        ]
        ends: dict[tuple[str, int], tuple[float, bool]] = {}
        with closing(run_each(play, leads, self.workers)) as results:
            for lead, result in results:
                if isinstance(result, Failure):
                    result.throw()
                    continue
                ends[lead.name, lead.part] = result
                if (lead.name, 1 - lead.part) in ends:
                    plus, minus = ends[lead.name, 1], ends[lead.name, 0]
                    self.results.add(lead.name, [plus[0], minus[0], plus[1] + minus[1]])
                if self.interruption.asked:
                    return None
        found = np.array([known[name] for name in names])
        logs, finished = np.log(found[:, :2]), float(found[:, 2].mean()) / 2.0
        return Pairs(directions, 0.5 * (logs[:, 0] - logs[:, 1]), logs.mean(axis=1), finished)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
