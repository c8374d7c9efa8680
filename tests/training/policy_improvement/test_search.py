"""The search of weights by pairs of missions: what it estimates, that it repeats, goes on, and refuses."""

from __future__ import annotations

import json
from itertools import count

import numpy as np
import pytest
import torch

from training.candidate_network import CandidatePolicy
from training.errors import LabelsError
from training.policy import make_policy, settings_of_policy
from training.policy_improvement import search as searching
from training.policy_improvement.comparison import compare_with_planner
from training.policy_improvement.search import SEARCHED, Pairs, Run, SearchSettings, search, shrunk_slope
from training.policy_improvement.tasks import task_of
from training.seeds import validation_seeds

SIZE = len(SEARCHED)


def policy(robots: int = 2) -> CandidatePolicy:
    torch.manual_seed(0)
    made = make_policy(settings_of_policy(task_of(f"box-7x11x5:{robots}", 6), "candidates", (8,), 7))
    assert isinstance(made, CandidatePolicy)
    return made


def settings(**changes) -> SearchSettings:
    chosen = {"rounds": 2, "pairs": 3, "sigma": 1.0, "seed": 4} | changes
    return SearchSettings((task_of("box-7x11x5:2", 6), task_of("box-7x11x5:1", 6)), **chosen)


def pairs_of(slope: np.ndarray, number: int, noise: float, seed: int) -> Pairs:
    rng = np.random.default_rng(seed)
    directions = rng.standard_normal((number, SIZE))
    slopes = directions @ slope + noise * rng.standard_normal(number)
    return Pairs(directions, slopes, np.zeros(number))


def test_the_slope_is_found_where_the_noise_is_small():
    true = np.linspace(-0.02, 0.03, SIZE)
    slope, length = shrunk_slope([[pairs_of(true, 4000, 0.01, 0)]])
    assert np.abs(slope - true).max() < 1e-3
    assert length == pytest.approx(np.linalg.norm(true), rel=0.02)


def test_the_slope_of_several_tasks_is_their_mean():
    one, other = np.zeros(SIZE), np.zeros(SIZE)
    one[0], other[1] = 0.04, -0.02
    slope, _ = shrunk_slope([[pairs_of(one, 3000, 0.005, 1), pairs_of(other, 3000, 0.005, 2)]])
    assert slope[:2] == pytest.approx([0.02, -0.01], abs=1e-3) and np.abs(slope[2:]).max() < 1e-3


@pytest.mark.parametrize("number", [3, 10, 20, 48])
def test_chance_alone_moves_the_weights_little(number):
    steps = []
    for seed in range(40):
        slope, length = shrunk_slope([[pairs_of(np.zeros(SIZE), number, 0.05, seed)]])
        steps.append(np.linalg.norm(slope) / length if length > 0.0 else 0.0)
    assert np.mean(steps) < 0.45 and max(steps) <= 1.0


@pytest.mark.parametrize("ages", [[0], [1, 0]])
def test_the_covariance_of_the_slope_is_that_of_repeats(ages):
    true, found, told = np.linspace(-0.02, 0.03, SIZE), [], []
    weights = np.concatenate([np.full(60, 0.5**age) for age in ages])
    directions = np.random.default_rng(9).standard_normal((len(weights), SIZE))
    for seed in range(600):
        noise = np.random.default_rng(seed).standard_normal(len(weights))
        slope, covariance = searching._least_squares(directions, directions @ true + 0.05 * noise, weights)
        found.append(slope)
        told.append(covariance)
    repeated = np.cov(np.array(found).T)
    assert np.trace(np.mean(told, axis=0)) == pytest.approx(np.trace(repeated), rel=0.06)


def test_pairs_of_earlier_rounds_count_half_as_much_with_every_round():
    old, new = np.full(SIZE, 0.03), np.zeros(SIZE)
    history = [[pairs_of(old, 2000, 0.001, 0)], [pairs_of(new, 2000, 0.001, 1)]]
    slope, _ = shrunk_slope(history)
    assert slope.mean() == pytest.approx(0.01, abs=1e-3)  # (½ · 0.03 + 1 · 0) / (½ + 1)


def test_a_search_repeats_bit_for_bit_with_other_threads_and_numbers_of_missions(tmp_path):
    learned = policy()
    torch.nn.init.normal_(learned.actor.residual.weight, std=2.0)
    first = search(learned, settings(), tmp_path / "one", threads=1, missions=2)
    second = search(learned, settings(), tmp_path / "two", threads=2, missions=5)
    assert first is not None and second is not None
    assert np.array_equal(first.weights, second.weights) and first.rounds == second.rounds
    other = search(learned, settings(seed=5), tmp_path / "three", threads=1)
    assert other is not None and other.rounds != first.rounds


def test_a_search_that_was_stopped_or_killed_goes_on_with_the_pair_that_is_missing(tmp_path, monkeypatch):
    whole = search(policy(), settings(), tmp_path / "whole", threads=1)
    assert whole is not None
    folder, asked = tmp_path / "stopped", count()
    assert search(policy(), settings(), folder, 1, stopped=lambda: next(asked) > 30) is None
    file = folder / "round-000-task-0.jsonl"
    known = file.read_text()
    assert 1 <= known.count("\n") < 1 + 3 and not (folder / "round-000-task-1.jsonl").exists()
    file.write_text(known + "[2, 31.5, 3")  # killed while it wrote
    again = search(policy(), settings(), folder, 1)
    assert again is not None and np.array_equal(again.weights, whole.weights)
    monkeypatch.setattr(searching._Runner, "_choices", None)  # nothing is run any more
    assert file.read_text().startswith(known)
    read = search(policy(), settings(), folder, 1)
    assert read is not None and np.array_equal(read.weights, whole.weights)


def test_a_changed_mission_is_that_of_a_policy_with_the_changed_weights():
    scenario, spreads = task_of("box-7x11x5:2", 6), np.linspace(0.1, 0.4, SIZE)
    change = np.zeros(SIZE)
    change[SEARCHED.index("unknown")], change[SEARCHED.index("seconds")] = 3.0, -2.0
    validated = validation_seeds(3, 1_000)
    runs = [Run(seed, change) for seed in validated]
    ends = dict(searching._Runner(policy(), scenario, spreads, 2, 1).run(runs, lambda: False))
    changed = policy()
    with torch.no_grad():
        for name, by in zip(SEARCHED, change / spreads, strict=True):
            changed.actor.weights[searching.COLUMNS[name]] += by
    compared = compare_with_planner(changed, scenario, 3, 1)
    assert compared.policy_s == pytest.approx(np.median([end.seconds for end in ends.values()]))
    assert compared.finished == sum(end.finished for end in ends.values()) == 3
    assert compared.policy_s != compared.planner_s


def test_results_of_other_settings_or_broken_ones_are_refused(tmp_path):
    assert search(policy(), settings(rounds=1), tmp_path, 1) is not None
    with pytest.raises(LabelsError, match=r"settings = .*made with these options"):
        search(policy(), settings(rounds=1, sigma=2.0), tmp_path, 1)
    file, spreads = tmp_path / "round-000-task-0.jsonl", tmp_path / "spreads.json"
    for broken, content in [
        (file, file.read_text().replace("[", "{").encode()),
        (file, file.read_bytes() + b"[1, 2.5]\n"),
        (file, file.read_bytes() + b"[3, 1.0, 2.0, 2]\n"),
        (file, file.read_bytes() + b"[0, 1.0, Infinity, 2]\n"),
        (file, file.read_bytes() + b"[" * 100_000 + b"\n"),
        (file, b"\xff\xfe"),
        (file, b'["no head"]\n'),
        (spreads, spreads.read_text().split(",")[0].encode() + b"}"),
        (spreads, spreads.read_text().replace("0.", "-0.").encode()),
    ]:
        whole = broken.read_bytes()
        broken.write_bytes(content)
        with pytest.raises(LabelsError, match=broken.name):
            search(policy(), settings(rounds=1), tmp_path, 1)
        broken.write_bytes(whole)
    assert search(policy(), settings(rounds=1), tmp_path, 1) is not None


def test_features_that_do_not_vary_keep_their_weights(tmp_path):
    alone = SearchSettings((task_of("box-7x11x5:1", 6),), rounds=1, pairs=4)
    found = search(policy(1), alone, tmp_path, 1)
    assert found is not None
    spreads = json.loads((tmp_path / "spreads.json").read_text())
    assert spreads["announced_most"] == spreads["contest"] == 0.0 < spreads["unknown"]
    weights = dict(zip(searching.COLUMNS, found.weights, strict=True))
    assert weights["announced_most"] == weights["contest"] == 0.0
