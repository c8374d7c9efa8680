"""A search by whole missions: how much a candidate's features should weigh beside the planner's score.

The weights w of a policy's logits are changed along random directions (Mania, Guy & Recht 2018). A pair is a
mission that is run twice from the same start, with w + δ and with w - δ,

    δ_f = σ e_f / d_f,   e ~ N(0, 1),   d_f = spread of feature f among a robot's candidates,

and half the difference of the logarithms of both mission times is a sample of the slope along e,

    y = ½ (ln t₊ - ln t₋) ≈ g · e.

A round runs pairs in every task. Then g is the mean over the tasks of what least squares find, where pairs of
earlier rounds count half as much with every round; it is shrunk towards zero as far as it is uncertain (James
& Stein 1961), and w goes a step against it, a shorter one where much was shrunk. What a mission takes on the
whole is all that counts: nothing has to be known of single decisions, nor does a critic have to be right.

Results lie in lines of JSON, a pair each, which are written when it is done: a run that was killed goes on
with the first pair that is missing, and comes to the same weights.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from baselines.experiments.provenance import code_digest
from entropy_explore_env.missions.privileged import deciding, finished, mission_times, running
from entropy_explore_env.planner.candidate_features import COLUMNS
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.writing import write_atomically
from training.candidate_network import CandidatePolicy
from training.errors import LabelsError, RollOutError
from training.policy_improvement.labelling import planner_acts
from training.policy_improvement.origin import Origin
from training.policy_improvement.pair_files import read_object, read_pairs
from training.policy_improvement.rollouts import MOST_STEPS, PLANNER, BatchMissions
from training.seeds import pair_seeds

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
_OLDER = 0.5
_LAST_STEP = 0.3
"""Length of the last step, as a share of the first one's."""
_RIDGE = 1.0


@dataclass(frozen=True)
class SearchSettings:
    """How a search is run.

    Attributes:
        scenarios: The tasks.
        rounds: How often the weights are changed.
        pairs: Of missions, in each task and round.
        sigma: σ, how far a feature's weight is changed: logits of candidates that differ by the feature's
            spread change by so much.
        step: Length of the first step, in units of σ; steps grow shorter to the last.
        seed: Of missions and directions.
        begins: Digest of the policy that the search begins with.
    """

    scenarios: tuple[Scenario, ...]
    rounds: int = 8
    pairs: int = 48
    sigma: float = 0.3
    step: float = 1.0
    seed: int = 0
    begins: str = ""

    @property
    def origin(self) -> Origin:
        """What decides the results of pairs."""
        return Origin(code_digest(__name__), hashlib.sha256(repr(self).encode()).hexdigest())

    def step_of(self, number: int) -> float:
        """Length of the step after a round."""
        gone = number / max(self.rounds - 1, 1)
        return self.step * (1.0 - (1.0 - _LAST_STEP) * gone)


class Pairs(NamedTuple):
    """What N pairs of one task and round came to."""

    directions: np.ndarray
    """(N, S) e."""
    slopes: np.ndarray
    """(N,) y."""
    ln_times: np.ndarray
    """(N,) mean of both logarithms of seconds."""
    finished: float = 1.0
    """Share of the missions that came to what they ask for."""


class Found(NamedTuple):
    """What a search came to."""

    weights: np.ndarray
    """(F,) what is to be added to the policy's weights."""
    rounds: list[dict[str, float]]
    """Of each round: `slope`, the length of g, by which share missions become shorter with a step of σ;
    `mean_s`, the geometric mean of mission times; and `finished`, the share of missions that were."""

    def line(self) -> str:
        """The search in one line."""
        slopes = ", ".join(f"{each['slope']:.3f}" for each in self.rounds)
        return f"{len(self.rounds)} rounds; slopes {slopes}"


def search(
    policy: CandidatePolicy,
    settings: SearchSettings,
    folder: Path,
    threads: int,
    missions: int = 16,
    stopped: Callable[[], bool] = lambda: False,
    say: Callable[[str], None] = lambda line: None,
) -> Found | None:
    """Search weights, from where the files in a folder end.

    Args:
        policy: Whose weights are searched; it stays as it is.
        settings: What decides the result, but for the code.
        folder: Of the results of pairs.
        threads: Threads that share the missions.
        missions: Run at once; neither this nor the threads change a mission, as far as PyTorch's sums do not
            depend on how many rows there are.
        stopped: Asked at every step of the pairs whether to stop; the result is None then.
        say: Told of each round.

    Raises:
        LabelsError: Results in the folder are of other settings, or of another version of the code.
        RollOutError: A mission makes no headway.
    """
    origin = settings.origin
    spreads = _spreads(settings, folder / "spreads.json", origin, threads)
    centre, history, rounds = np.zeros(len(SEARCHED)), [], []
    for number in range(settings.rounds):
        parts = []
        for task, scenario in enumerate(settings.scenarios):
            part = _Part(settings, number, task, centre)
            file = folder / f"round-{number:03d}-task-{task}.jsonl"
            runner = _Runner(policy, scenario, spreads, missions, threads)
            done = part.run(file, origin, runner, stopped)
            if done is None:
                return None
            parts.append(done)
        history.append(parts)
        slope, length = shrunk_slope(history)
        if length > 0.0:
            centre = centre - settings.step_of(number) * settings.sigma * slope / length
        mean_s = math.exp(np.mean([part.ln_times.mean() for part in parts]))
        share = float(np.mean([part.finished for part in parts]))
        rounds.append({"slope": length, "mean_s": mean_s, "finished": share})
        shown = f"{mean_s:.1f} s, {share:.0%} finished, slope {length:.4f}"
        say(f"round {number + 1} of {settings.rounds}: {shown}")
    weights = np.zeros(len(COLUMNS))
    weights[_COLUMNS] = in_weights(centre, spreads)
    return Found(weights, rounds)


def in_weights(change: np.ndarray, spreads: np.ndarray) -> np.ndarray:
    """A change (S,) in spreads as one of weights; 0 for features that do not vary."""
    return np.divide(change, spreads, out=np.zeros(len(SEARCHED)), where=spreads > 0.0)


def shrunk_slope(history: Sequence[Sequence[Pairs]]) -> tuple[np.ndarray, float]:
    """The slope g from the pairs of all rounds so far, of which the latest count most.

    Args:
        history: Of each round a Pairs for each task.

    Returns:
        (S,) g, shrunk towards zero as far as it is uncertain; and how long it should be without that, 0 where
        it is no longer than chance makes it on average.
    """
    tasks = len(history[-1])
    slope, covariance = np.zeros(len(SEARCHED)), np.zeros((len(SEARCHED), len(SEARCHED)))
    for task in range(tasks):
        parts = [parts[task] for parts in history]
        directions = np.concatenate([part.directions for part in parts])
        slopes = np.concatenate([part.slopes for part in parts])
        ages = np.repeat(np.arange(len(parts))[::-1], [len(part.slopes) for part in parts])
        own, uncertain = _least_squares(directions, slopes, _OLDER**ages)
        slope, covariance = slope + own / tasks, covariance + uncertain / tasks**2
    size = len(slope)
    variance = max(float(slope @ slope - np.trace(covariance)) / size, 0.0)
    if variance == 0.0:
        return np.zeros(size), 0.0
    shrunk = variance * np.linalg.solve(variance * np.eye(size) + covariance, slope)
    return shrunk, math.sqrt(size * variance)


def _least_squares(
    directions: np.ndarray, slopes: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The slope (S,) that fits best, and its covariance (S, S)."""
    size = directions.shape[1]
    weighted = directions.T * weights
    inverse = np.linalg.inv(weighted @ directions + _RIDGE * np.eye(size))
    leaves = np.eye(len(slopes)) - directions @ inverse @ weighted  # what is left over, from what there was
    left, freedom = leaves @ slopes, float((weights[:, None] * leaves**2).sum())
    noise = float(weights @ left**2) / max(freedom, 1e-9)
    return inverse @ (weighted @ slopes), noise * inverse @ (weighted * weights) @ directions @ inverse


class _Part:
    """The pairs of one task in one round."""

    def __init__(self, settings: SearchSettings, number: int, task: int, centre: np.ndarray) -> None:
        part = number * len(settings.scenarios) + task
        self._seeds = pair_seeds(settings.seed, part, settings.pairs)
        rng = np.random.default_rng([settings.seed, part])
        self._directions = rng.standard_normal((settings.pairs, len(SEARCHED)))
        self._centre, self._sigma = centre, settings.sigma

    def run(self, file: Path, origin: Origin, runner: _Runner, stopped: Callable[[], bool]) -> Pairs | None:
        """Run the pairs that are missing in a file; None if that was stopped."""
        known = read_pairs(file, origin, len(self._seeds))
        wanted = [pair for pair in range(len(self._seeds)) if pair not in known]
        runs = [
            Run(self._seeds[pair], self._centre + sign * self._sigma * self._directions[pair])
            for pair in wanted
            for sign in (1.0, -1.0)
        ]
        ends: dict[int, End] = {}
        if wanted and not known:
            write_atomically(file, json.dumps(origin._asdict()) + "\n")
        for run, end in runner.run(runs, stopped):
            ends[run] = end
            plus, minus = ends.get(run - run % 2), ends.get(run - run % 2 + 1)
            if plus is not None and minus is not None:
                pair = wanted[run // 2]
                known[pair] = (plus.seconds, minus.seconds, plus.finished + minus.finished)
                with file.open("a", encoding="utf-8") as lines:
                    lines.write(json.dumps([pair, *known[pair]]) + "\n")
        if not all(pair in known for pair in range(len(self._seeds))):
            return None
        both = np.array([known[pair] for pair in range(len(self._seeds))])
        logs = np.log(both[:, :2])
        share = float(both[:, 2].mean()) / 2.0
        return Pairs(self._directions, 0.5 * (logs[:, 0] - logs[:, 1]), logs.mean(axis=1), share)


class Run(NamedTuple):
    """A mission to be run."""

    seed: int
    change: np.ndarray
    """(S,) of the weights, in spreads."""


class End(NamedTuple):
    """How a mission ended."""

    seconds: float
    """Its time; the time limit of one that did not come to what it asks for."""
    finished: bool


class _Runner(NamedTuple):
    """Runs missions of one task, as many at once as there is room for."""

    policy: CandidatePolicy
    scenario: Scenario
    spreads: np.ndarray
    missions: int
    threads: int

    def run(self, runs: Sequence[Run], stopped: Callable[[], bool]) -> Iterator[tuple[int, End]]:
        """Run missions to their ends; yields numbers of `runs` as they end."""
        if runs:
            with closing(BatchMissions(self.scenario, min(self.missions, len(runs)), self.threads)) as batch:
                yield from self._run_in(batch, runs, stopped)

    def _run_in(
        self, batch: BatchMissions, runs: Sequence[Run], stopped: Callable[[], bool]
    ) -> Iterator[tuple[int, End]]:
        missions, waiting, rows = batch.missions, iter(range(len(runs))), batch.missions.count
        under_way = np.full(rows, -1)
        changes = np.zeros((rows, len(SEARCHED)))
        steps = np.zeros(rows, np.int64)
        ended = np.arange(rows)
        while not stopped():
            for row in ended.tolist():
                number = next(waiting, None)
                under_way[row], steps[row] = -1 if number is None else number, 0
                if number is not None:
                    missions.reset_some([row], [runs[number].seed])
                    changes[row] = in_weights(runs[number].change, self.spreads)
            if (under_way < 0).all():
                return
            batch.step(self._choices(batch, changes))
            steps += 1
            over = (under_way >= 0) & ~running(missions)
            ended = np.flatnonzero(over)
            clocks_s, reached = mission_times(missions), finished(missions)
            limit_s = self.scenario.ending.time_limit_s
            for row in ended.tolist():
                seconds = clocks_s[row] if reached[row] else limit_s
                yield int(under_way[row]), End(float(seconds), bool(reached[row]))
            if (late := np.flatnonzero((steps > MOST_STEPS) & (under_way >= 0) & ~over)).size:
                row = int(late[0])
                seed, name = runs[under_way[row]].seed, self.scenario.name
                raise RollOutError(name, seed, 0, int(steps[row]), float(clocks_s[row]))

    def _choices(self, batch: BatchMissions, changes: np.ndarray) -> np.ndarray:
        """(E, A) the likeliest candidates, with the weights of each mission changed."""
        choosing = deciding(batch.missions)
        features, seen = batch.features()[choosing], batch.missions.observations[choosing]
        with torch.inference_mode():
            logits = self.policy.actor(torch.as_tensor(seen)).numpy().astype(np.float64)
        logits += np.einsum("nkf,nf->nk", features[..., _COLUMNS], changes[np.nonzero(choosing)[0]])
        actions = np.full(choosing.shape, PLANNER, np.int64)
        actions[choosing] = logits.argmax(axis=1)
        return actions


def _spreads(settings: SearchSettings, file: Path, origin: Origin, threads: int) -> np.ndarray:
    """(S,) standard deviation of each feature among the candidates of a robot, in missions of the planner.

    The mean over those tasks in which it varies; 0 where it varies in none.
    """
    if file.is_file():
        known = read_object(file, origin)
        spreads = [known.get(name) for name in SEARCHED]
        if not all(isinstance(each, float) and 0.0 <= each < math.inf for each in spreads):
            raise LabelsError(str(file), spreads, f"{len(SEARCHED)} numbers ≥ 0: remove the file")
        return np.array(spreads)
    found = np.array([_spreads_in(scenario, settings.seed, threads) for scenario in settings.scenarios])
    varies = found > _NO_SPREAD
    mean = found.sum(axis=0, where=varies) / np.maximum(varies.sum(axis=0), 1)
    spreads = np.where(varies.any(axis=0), np.maximum(mean, _LEAST_SPREAD), 0.0)
    text = json.dumps({**origin._asdict(), **dict(zip(SEARCHED, spreads.tolist(), strict=True))})
    write_atomically(file, text + "\n")
    return spreads


def _spreads_in(scenario: Scenario, seed: int, threads: int) -> np.ndarray:
    """(S,) in one task."""
    count, total, decisions = _SPREAD_MISSIONS, np.zeros(len(SEARCHED)), 0
    with closing(BatchMissions(scenario, count, threads)) as batch:
        batch.missions.reset_some(range(count), pair_seeds(seed, 0, count))  # those of the first pairs
        for _ in batch.led(planner_acts):
            exists, features = batch.exists(), batch.features()[..., _COLUMNS]
            for at in zip(*np.nonzero(exists.sum(axis=2) > 1), strict=True):
                total += features[at][exists[at]].var(axis=0)
                decisions += 1
    return np.sqrt(total / max(decisions, 1))
