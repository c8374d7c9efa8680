"""The search of weights by pairs of missions: what it estimates, that it repeats, goes on, and refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

from entropy_explore_env.command import BAD_INPUT, INTERRUPTED
from entropy_explore_env.planner.weights import read_weights
from training import search as searching
from training.search import SEARCHED, Pairs, _least_squares, main, run_command, shrunk_slope

SIZE = len(SEARCHED)
TINY = "--tasks box-7x11x5:2 box-7x11x5:1 --candidates 6 --rounds 2 --pairs 3 --sigma 1.0 --seed 4 --jobs 1"


def run(folder: Path, more: str = "") -> int:
    return run_command(main, [*TINY.split(), "--json", "--out", str(folder), *more.split()])


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("search") / "whole"
    assert run(folder) == 0
    return folder


def pairs_of(slope: np.ndarray, number: int, noise: float, seed: int) -> Pairs:
    rng = np.random.default_rng(seed)
    directions = rng.standard_normal((number, SIZE))
    slopes = directions @ slope + noise * rng.standard_normal(number)
    return Pairs(directions, slopes, np.zeros(number))


def test_the_slope_of_several_tasks_is_their_mean():
    one, other = np.zeros(SIZE), np.zeros(SIZE)
    one[0], other[1] = 0.04, -0.02
    slope, length = shrunk_slope([[pairs_of(one, 3000, 0.005, 1), pairs_of(other, 3000, 0.005, 2)]])
    assert length == pytest.approx(np.linalg.norm([0.02, -0.01]), rel=0.05)
    assert slope[:2] == pytest.approx([0.02, -0.01], abs=1e-3) and np.abs(slope[2:]).max() < 1e-3


@pytest.mark.parametrize("number", [3, 20, 48])
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
        slope, covariance = _least_squares(directions, directions @ true + 0.05 * noise, weights)
        found.append(slope)
        told.append(covariance)
    repeated = np.cov(np.array(found).T)
    assert np.trace(np.mean(told, axis=0)) == pytest.approx(np.trace(repeated), rel=0.06)


def test_pairs_of_earlier_rounds_count_half_as_much_with_every_round():
    old, new = np.full(SIZE, 0.03), np.zeros(SIZE)
    history = [[pairs_of(old, 2000, 0.001, 0)], [pairs_of(new, 2000, 0.001, 1)]]
    slope, _ = shrunk_slope(history)
    assert slope.mean() == pytest.approx(0.01, abs=1e-3)  # (½ · 0.03 + 1 · 0) / (½ + 1)


def test_a_search_leaves_weights_that_are_a_strategy(whole):
    weights = read_weights(whole / "weights.json")
    assert weights.candidates == 6 and weights.tasks == ("box-7x11x5:2", "box-7x11x5:1")
    assert set(weights.weights) <= set(SEARCHED)
    lines = (whole / "pairs.jsonl").read_text().splitlines()
    assert len(lines) == 2 + 2 * 2 * 3  # what they come from, spreads, and rounds × tasks × pairs


def test_a_search_that_was_stopped_or_killed_goes_on_with_the_pair_that_is_missing(
    whole, tmp_path, monkeypatch
):
    lines, folder = (whole / "pairs.jsonl").read_text().splitlines(), tmp_path / "killed"
    folder.mkdir()
    known = "\n".join(lines[:6]) + "\n"
    (folder / "pairs.jsonl").write_text(known + lines[6][:-9])  # killed while it wrote
    assert run(folder) == 0
    assert (folder / "pairs.jsonl").read_text().startswith(known)
    assert (folder / "weights.json").read_bytes() == (whole / "weights.json").read_bytes()
    monkeypatch.setattr(searching, "play", None)  # no mission is run any more
    assert run(folder) == 0
    assert (folder / "weights.json").read_bytes() == (whole / "weights.json").read_bytes()


def test_ctrl_c_keeps_the_pairs_that_are_done(whole, tmp_path, monkeypatch, capsys):
    played: list[searching.Lead] = []
    lead_mission = searching.play

    class Asked(searching.Interruption):
        @property
        def asked(self) -> bool:
            return bool(played)

        @asked.setter
        def asked(self, value: bool) -> None:
            """The base class begins with False."""

    def play(lead: searching.Lead) -> tuple[float, bool]:
        played.append(lead)
        return lead_mission(lead)

    monkeypatch.setattr(searching, "play", play)
    monkeypatch.setattr(searching, "Interruption", Asked)
    assert run(tmp_path / "run") == INTERRUPTED
    assert "the same command goes on" in capsys.readouterr().err
    assert not (tmp_path / "run" / "weights.json").exists()
    monkeypatch.undo()
    assert run(tmp_path / "run") == 0
    assert (tmp_path / "run" / "weights.json").read_bytes() == (whole / "weights.json").read_bytes()


@pytest.mark.parametrize(
    "line",
    [
        '["spreads", [1.0]]',
        '["pair", [1.0, 2.0]]',
        '["pair", [1.0, NaN, 2]]',
        "[1, 2, 3]",
        "{",
        "[" * 100_000,
    ],
)
def test_broken_results_are_refused(line, whole, tmp_path, capsys):
    (tmp_path / "pairs.jsonl").write_text((whole / "pairs.jsonl").read_text() + line + "\n")
    assert run(tmp_path) == BAD_INPUT
    assert "pairs.jsonl" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "named"),
    [
        ("--sigma 2.0", "sigma = 2.0: expected the value of the search"),
        ("--pairs 4", "pairs = 4"),
        ("--tasks box-7x11x5:3", "tasks = "),
        ("--tasks box-7x11x5", "NAME:ROBOTS"),
        ("--rounds 0", "rounds = 0"),
        ("--step 0", "step = 0"),
        ("--begin nowhere.json", "a file that can be read"),
    ],
)
def test_a_search_with_other_options_is_refused_by_name(more, named, whole, capsys):
    before = (whole / "pairs.jsonl").read_bytes()
    assert run(whole, more) == BAD_INPUT
    assert named in capsys.readouterr().err and (whole / "pairs.jsonl").read_bytes() == before


def test_a_search_begins_with_other_weights(whole, tmp_path, capsys):
    assert run(tmp_path, f"--begin {whole / 'weights.json'} --rounds 1") == 0
    assert run(tmp_path, f"--begin {whole / 'weights.json'} --rounds 1 --candidates 9") == BAD_INPUT
    assert "candidates = 9: expected 6, as the weights" in capsys.readouterr().err
    begun = json.loads((tmp_path / "pairs.jsonl").read_text().splitlines()[0])["begin"]
    assert begun["weights"] == dict(read_weights(whole / "weights.json").weights)
