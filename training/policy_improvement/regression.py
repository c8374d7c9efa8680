"""Stage 2: the residual learns what the branches of roll-outs saved, the critic what the missions still took.

The label of candidate k at a state is the seconds saved against the planner's own branch c, averaged over D
draws of the random numbers that branches share,

    y_k = 1/D Σ_d (t_c,d - t_k,d),    t = seconds to the end or the horizon, and the learned time to go there.

Differences of logits are regressed on them, y_k / s ≈ ρ (l_k - l_c), with the median s of |y_k| in the
state's task and one learned ρ > 0, so that the likeliest candidate is the one that is expected to save most.
Each task has its own s and its own time to go: the same share of what is left takes other seconds in another
scenario. Averages over worlds are learned, not what was best in one: of which world a robot is in it knows no
more than it observes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch.nn import functional

from baselines.experiments.statistics import Interval, ratio_interval
from training.candidate_network import CandidatePolicy
from training.errors import DivergedError, LabelsError
from training.normalisation import Normaliser
from training.policy_improvement.shards import Labels
from training.policy_improvement.time_to_go import TimeToGo, learn_time_to_go

_HELD_OUT = 5
"""Every fifth mission of a task is not learned from."""
_LEAST_STATES = 2
"""Of a task: one to learn from, and one that is held out."""
_DIVERGED = 10.0
_RHO_RATE = 0.01
"""Learning rate of ln ρ at most: at ρ = 0 nothing would be learned, nor would anything diverge."""
_CRITIC = 0.5
"""Weight of the critic's loss."""


class Savings(NamedTuple):
    """Labels of N states."""

    mean_s: np.ndarray
    """(N, B) float32, seconds saved against the first branch, the planner's; NaN where there is no branch."""
    error_s: np.ndarray
    """(N, B) float32, standard error of the mean over draws; NaN likewise, or with one draw."""
    draws_s: np.ndarray
    """(N, B, D) float32, of each draw."""


def savings_of(labels: Labels, to_go: Mapping[int, TimeToGo]) -> Savings:
    """The seconds that branches saved.

    Args:
        labels: Of roll-outs.
        to_go: By task, completes branches that were cut off; empty = none was.
    """
    total = labels.seconds.astype(np.float64)
    for task, own in to_go.items():
        of = labels.task == task
        total[of] += np.where(labels.ended[of], 0.0, own.seconds(labels.at_end[of]))
    saved = total[:, :1] - total
    draws = saved.shape[2]
    spread = saved.std(axis=2, ddof=1) if draws > 1 else np.full(saved.shape[:2], np.nan)
    kinds = (saved.mean(axis=2), spread / np.sqrt(draws), saved)
    return Savings(*(each.astype(np.float32) for each in kinds))


@dataclass(frozen=True)
class RegressionResult:
    """What a regression came to, on missions that it did not learn from, but for the first two.

    The epoch is picked on these same missions: `loss_after` and `saved_s` are better than they would be on
    missions that had no part in that.

    Attributes:
        states, held_out: States with labels: all, and those of missions that were not learned from.
        loss_before, loss_after: Of differences, before learning and of the weights that are kept.
        epoch: After which the kept weights were; 0 = before learning, so that the policy is the planner.
        to_go_error_s: Median absolute error of the time to go.
        saved_s, saved_low_s, saved_high_s: Seconds that the policy's choices among the branches save against
            the planner's, a decision; mean with its 95 % interval, of a bootstrap over missions, since states
            of one mission are alike; without ends (NaN) where only one mission is held out.
        best_s: Seconds that the best branch saves a decision, chosen by half of the draws and measured by
            the others, so that luck does not count.
        noise_s: Root mean square standard error of a label.
    """

    states: int
    held_out: int
    loss_before: float
    loss_after: float
    epoch: int
    to_go_error_s: float
    saved_s: float
    saved_low_s: float
    saved_high_s: float
    best_s: float
    noise_s: float

    def line(self) -> str:
        """The result in one line."""
        return (
            f"{self.states} states, {self.held_out} held out; loss {self.loss_before:.4f} → "
            f"{self.loss_after:.4f} (epoch {self.epoch}); a choice saves {self.saved_s:+.3f} s "
            f"({self.saved_low_s:+.3f} … {self.saved_high_s:+.3f}; the epoch is picked on these missions), "
            f"the best branch {self.best_s:+.3f} s; "
            f"labels ± {self.noise_s:.3f} s, time to go ± {self.to_go_error_s:.1f} s"
        )


@dataclass(frozen=True)
class RegressionSettings:
    """How a regression learns."""

    epochs: int = 60
    batch: int = 128
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    seed: int = 0


class _Rows(NamedTuple):
    """States as tensors."""

    observations: torch.Tensor
    candidates: torch.Tensor
    saved: torch.Tensor
    """(N, B) in units of the median saving of the state's task."""
    there: torch.Tensor
    """(N, B) bool, branches to learn from: all but the planner's own."""
    value: torch.Tensor
    """(N,) normalised, less the seconds to go."""

    def taken(self, which: torch.Tensor) -> _Rows:
        return _Rows(*(part[which] for part in self))


def regress(
    policy: CandidatePolicy, labels: Labels, settings: RegressionSettings
) -> tuple[RegressionResult, Normaliser]:
    """Learn from labels; the policy gets the weights that did best on missions that were held out.

    Args:
        policy: Begins with the weights that it has.
        labels: Of roll-outs.
        settings: How to learn.

    Returns:
        What it came to, and mean and deviation of the values that the critic learned.

    Raises:
        LabelsError: A task has too few states to learn from some and hold out others.
        DivergedError: The loss grows out of bounds, or is not finite.
    """
    held = held_out_states(labels)
    to_go, error_s = _times_to_go(labels, settings.seed)
    savings = savings_of(labels, {} if labels.ended[labels.candidates >= 0].all() else to_go)
    rows, returns = _rows(labels, savings, ~held)
    torch.manual_seed(settings.seed)
    learner = _Learner(policy, rows, torch.as_tensor(held), settings)
    before, after, epoch = learner.learn()
    choice = _chosen_branches(policy, rows).numpy()
    gained = savings.mean_s[np.arange(len(choice)), choice][held]
    saved = saved_interval(gained, labels.mission[held])
    noise_s = (
        float(np.sqrt(np.nanmean(savings.error_s[held][:, 1:] ** 2))) if savings.draws_s.shape[2] > 1 else 0.0
    )
    result = RegressionResult(
        len(held),
        int(held.sum()),
        before,
        after,
        epoch,
        error_s,
        *saved,
        _best_branch_s(savings, held),
        noise_s,
    )
    return result, returns


def held_out_states(labels: Labels) -> np.ndarray:
    """(N,) bool, the states that are not learned from: at least one of each task, and not all of it.

    They are those of every fifth mission of a task; of its last mission with states where these are none, or
    all; of a single mission the last fifth of its states.

    Raises:
        LabelsError: A task has fewer than two states.
    """
    held = np.isin(labels.mission, _held_out_missions(labels))
    for task in _tasks(labels) or [0]:
        own = np.flatnonzero(labels.task == task)
        if len(own) < _LEAST_STATES:
            allowed = f"at least {_LEAST_STATES}, to learn from some and hold out others: label more missions"
            raise LabelsError(f"states of task {task}", len(own), allowed)
        if held[own].any() and not held[own].all():
            continue
        missions = np.unique(labels.mission[own])
        held[own] = labels.mission[own] == missions[-1]
        if len(missions) == 1:
            held[own] = np.arange(len(own)) >= min(0.8 * len(own), len(own) - 1)
    return held


def _held_out_missions(labels: Labels) -> np.ndarray:
    """Every fifth mission of each task."""
    missions = np.concatenate([labels.mission, labels.moments_mission])
    of_task = np.concatenate([labels.task, labels.moments_task])
    each = [np.unique(missions[of_task == task])[_HELD_OUT - 1 :: _HELD_OUT] for task in _tasks(labels)]
    return np.concatenate([np.zeros(0, np.int64), *each])


def _tasks(labels: Labels) -> list[int]:
    return np.unique(np.concatenate([labels.task, labels.moments_task])).tolist()


def saved_interval(saved_s: np.ndarray, mission: np.ndarray) -> Interval:
    """Mean saving of a decision, and its interval, for which missions are resampled with all their states.

    Args:
        saved_s: (N,) of each state.
        mission: (N,) their missions; of a single one the interval has no ends (NaN).
    """
    _, place = np.unique(mission, return_inverse=True)
    sums, counts = np.bincount(place, saved_s.astype(np.float64)), np.bincount(place)
    if len(counts) == 1:
        return Interval(float(sums[0] / counts[0]), float("nan"), float("nan"))
    return ratio_interval(sums, counts)


def _times_to_go(labels: Labels, seed: int) -> tuple[dict[int, TimeToGo], float]:
    """The time to go of each task, learned from its moments, and the error on missions held out for that."""
    held = np.isin(labels.moments_mission, _held_out_missions(labels))
    learned, errors_s = {}, [np.zeros(0)]
    for task in np.unique(labels.moments_task).tolist():
        of = labels.moments_task == task
        learned[task] = learn_time_to_go(labels.moments[of], labels.moments_to_go_s[of], seed)
        rest, tested = of & ~held, of & held
        if rest.any() and tested.any():
            tried = learn_time_to_go(labels.moments[rest], labels.moments_to_go_s[rest], seed)
            errors_s.append(np.abs(tried.seconds(labels.moments[tested]) - labels.moments_to_go_s[tested]))
    errors = np.concatenate(errors_s)
    return learned, float(np.median(errors)) if len(errors) else float("nan")


def _rows(labels: Labels, savings: Savings, learned: np.ndarray) -> tuple[_Rows, Normaliser]:
    """States as tensors, and mean and deviation of values."""
    there = (labels.candidates >= 0) & (np.arange(labels.candidates.shape[1]) > 0)
    scale_s = np.ones((len(learned), 1), np.float32)
    for task in np.unique(labels.task):
        of = labels.task == task
        told = np.abs(savings.mean_s[there & (of & learned)[:, None]])
        scale_s[of] = max(float(np.median(told)), 1e-6) if len(told) else 1.0
    returns = Normaliser()
    returns.update(-labels.to_go_s[learned])
    saved = np.where(there, savings.mean_s, 0.0) / scale_s
    rows = _Rows(
        torch.as_tensor(labels.observations),
        torch.as_tensor(labels.candidates.clip(min=0)),
        torch.as_tensor(saved.astype(np.float32)),
        torch.as_tensor(there),
        torch.as_tensor(returns.normalise(-labels.to_go_s).astype(np.float32)),
    )
    return rows, returns


class _Learner:
    """Epochs over the states, and the best weights so far."""

    def __init__(
        self, policy: CandidatePolicy, rows: _Rows, held: torch.Tensor, settings: RegressionSettings
    ) -> None:
        self._policy, self._settings = policy, settings
        self._learned, self._held = rows.taken(~held), rows.taken(held)
        self._log_rho = torch.nn.Parameter(torch.tensor(self._first_log_rho()))

    def _first_log_rho(self) -> float:
        """The ln ρ with which the planner's own logits fit best."""
        with torch.no_grad():
            rows = self._learned
            behind = _differences(self._policy, rows)[rows.there]
            saved = rows.saved[rows.there]
            fitted = float((behind * saved).sum() / (behind * behind).sum().clamp(min=1e-9))
        return float(np.log(max(fitted, 1e-3)))

    def learn(self) -> tuple[float, float, int]:
        """Losses on what is held out before and after, and the epoch of the weights that are kept."""
        settings, policy = self._settings, self._policy
        rho = {"params": [self._log_rho], "weight_decay": 0.0, "lr": min(settings.learning_rate, _RHO_RATE)}
        parameters = [{"params": policy.parameters()}, rho]
        optimiser = torch.optim.AdamW(parameters, settings.learning_rate, weight_decay=settings.weight_decay)
        first_learned = self._measured(self._learned)
        before = best = self._measured(self._held)
        kept, epoch_kept = _copied(policy), 0
        policy.set_training_mode(True)
        for epoch in range(1, settings.epochs + 1):
            total, count = 0.0, 0
            for batch in self._batches(epoch):
                differences, values = self._loss(batch)
                optimiser.zero_grad()
                (differences + _CRITIC * values).backward()
                torch.nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
                optimiser.step()
                total, count = total + differences.item() * len(batch.saved), count + len(batch.saved)
            loss = total / count
            if not np.isfinite(loss) or loss > _DIVERGED * max(first_learned, 1e-3):
                raise DivergedError(loss, first_learned, epoch)
            found = self._measured(self._held)
            if found < best:
                best, kept, epoch_kept = found, _copied(policy), epoch
        values = _critic_weights(policy)
        policy.load_state_dict(kept | values)
        policy.set_training_mode(False)
        return before, best, epoch_kept

    def _measured(self, rows: _Rows) -> float:
        """The loss of differences, without learning from it."""
        with torch.no_grad():
            return self._loss(rows)[0].item()

    def _batches(self, epoch: int) -> Iterator[_Rows]:
        count = len(self._learned.saved)
        generator = torch.Generator().manual_seed(self._settings.seed * 1_000_003 + epoch)
        batches = max(1, round(count / self._settings.batch))
        for which in torch.randperm(count, generator=generator).chunk(batches):
            yield self._learned.taken(which)

    def _loss(self, rows: _Rows) -> tuple[torch.Tensor, torch.Tensor]:
        """Of differences between branches, and of values."""
        predicted = self._log_rho.exp() * _differences(self._policy, rows)
        each = functional.smooth_l1_loss(predicted, rows.saved, reduction="none")
        there = rows.there.float()
        values = self._policy.predict_values(rows.observations)[:, 0]
        differences = (each * there).sum() / there.sum().clamp(min=1.0)
        return differences, functional.smooth_l1_loss(values, rows.value)


def _differences(policy: CandidatePolicy, rows: _Rows) -> torch.Tensor:
    """(N, B) logits of the branches' candidates less that of the planner's choice."""
    logits = policy.actor(rows.observations).gather(1, rows.candidates)
    return logits - logits[:, :1]


def _chosen_branches(policy: CandidatePolicy, rows: _Rows) -> torch.Tensor:
    """(N,) the branch that the policy likes best, of those that were tried."""
    with torch.no_grad():
        differences = _differences(policy, rows)
        differences[:, 1:] = torch.where(rows.there[:, 1:], differences[:, 1:], -torch.inf)
        return differences.argmax(dim=1)


def _best_branch_s(savings: Savings, held: np.ndarray) -> float:
    """What the best branch saves, chosen by half of the draws and measured by the others; both ways round."""
    draws = savings.draws_s[held]
    if draws.shape[2] < 2:
        return float("nan")
    halves = (draws[:, :, ::2].mean(axis=2), draws[:, :, 1::2].mean(axis=2))
    found = []
    for chosen_by, measured_by in (halves, halves[::-1]):
        best = np.nanargmax(chosen_by, axis=1)
        found.append(measured_by[np.arange(len(best)), best])
    return float(np.mean(found))


def _copied(policy: CandidatePolicy) -> dict[str, torch.Tensor]:
    return {name: each.detach().clone() for name, each in policy.state_dict().items()}


def _critic_weights(policy: CandidatePolicy) -> dict[str, torch.Tensor]:
    """Those of the critic, which learns on while the actor's best weights are kept."""
    return {name: each for name, each in _copied(policy).items() if ".critic." in name or "value_net" in name}


def as_json(result: RegressionResult) -> dict[str, float | int | None]:
    """The result as JSON holds it; what could not be measured is None."""
    fields = dataclasses.asdict(result)
    return {name: value if np.isfinite(value) else None for name, value in fields.items()}
