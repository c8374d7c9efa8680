"""Learning a predictor of maps: what samples hold, that runs repeat and go on, figures by hand, bad input."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from baselines.cli.interruption import Interruption
from entropy_explore_env.command import BAD_INPUT, INTERRUPTED
from entropy_explore_env.prediction.crop import CELL_M, CELLS, FREE, OUTSIDE, PLANS, SOLID
from entropy_explore_env.prediction.predictor import shipped_predictor
from entropy_explore_env.prediction.volumes import VOLUMES, VolumeWindow
from entropy_explore_env.prediction.weights import read_network
from training import map_predictor, map_samples
from training.checkpoints import stored_arrays, stored_bytes
from training.map_predictor import Args, main, masked_loss, rate_at, run_command
from training.map_samples import (
    RECIPES,
    Sampled,
    Samples,
    drawn_batch,
    read_samples,
    sampled_missions,
    scenario_of,
    unmeasured,
)
from training.map_scores import (
    as_plans,
    calibration_error,
    figures_of,
    log_loss_bits,
    nearest_bins,
    nearest_shares,
    predictions,
    reliability,
    scored,
)

RECIPES_HERE = ("cluttered", "corridor")
TINY = (
    f"--recipes {' '.join(RECIPES_HERE)} --missions 1 --validation-missions 1 --snapshots 3 --epochs 2 "
    "--batch 2 --seed 1 --threads 1 --device cpu --jobs 1 --json"
)


def run(folder: Path, more: str = "") -> int:
    return run_command(main, [*TINY.split(), "--out", str(folder), *more.split()])


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("predictor") / "whole"
    assert run(folder) == 0
    return folder


@pytest.fixture
def started(whole, tmp_path, monkeypatch) -> Iterator[Path]:
    """A folder with the samples of a run and no weights; missions are not run again."""
    (tmp_path / "run").mkdir()
    (whole / "samples").rename(tmp_path / "run" / "samples")
    monkeypatch.setattr(map_samples, "sample_mission", lambda sampled: pytest.fail(f"{sampled.name} again"))
    yield tmp_path / "run"
    (tmp_path / "run" / "samples").rename(whole / "samples")


def same_tensors(one: Path, other: Path) -> bool:
    """Whether two files hold the same numbers; the order of their metadata is chance."""
    first, second = load_file(one), load_file(other)
    return set(first) == set(second) and all(torch.equal(first[name], second[name]) for name in first)


def missions(split: str) -> list[Sampled]:
    return sampled_missions(RECIPES_HERE, split, 1, 3, 1)


def test_a_run_leaves_weights_figures_and_a_picture(whole):
    network = read_network(whole / "predictor.safetensors")
    assert np.abs(network.first[0].weights).max() > 0.0
    results = json.loads((whole / "predictor.json").read_text())
    assert results["options"]["recipes"] == list(RECIPES_HERE) and results["options"]["samples"] == 6
    assert set(results["figures"]) == {"all", "near", *RECIPES_HERE}
    for row in results["figures"].values():
        assert 0.0 < row["predicted_bits"] < 3.0 and 0.0 <= row["calibration_error"] < 1.0
        assert sum(cells for *_, cells in row["reliability"]) == row["cells"]
    assert (whole / "predictor.png").stat().st_size > 10_000


def test_samples_are_of_what_was_seen_and_what_is_there(whole):
    samples, recipes = read_samples(whole / "samples", missions("train"))
    assert samples.cells.shape == (6, 3, CELLS, CELLS) and recipes.tolist() == [2, 2, 2, 1, 1, 1]
    measured = samples.cells[:, :OUTSIDE].max(axis=1) > 0
    inside = samples.cells[:, OUTSIDE] == 0
    truth, asked = samples.truth[:, 0], unmeasured(samples.cells)[:, 0]
    assert (truth[samples.cells[:, SOLID] > 0].mean() > 0.99) and truth[~inside].all()
    assert (measured | asked | ~inside).all()
    assert not (measured & asked).any()
    seen_free = (samples.cells[:, FREE] == 252) & inside
    assert seen_free.any() and truth[seen_free].mean() < 0.02


def test_a_predictor_of_volumes_is_learned_alike(tmp_path, capsys):
    words = (
        "--recipes cave --missions 1 --validation-missions 1 --snapshots 2 --epochs 1 --batch 2 --threads 1"
    )
    assert run_command(main, [*words.split(), "--device", "cpu", "--jobs", "1", "--out", str(tmp_path)]) == 0
    assert "cave" in capsys.readouterr().out
    network = read_network(tmp_path / "predictor.safetensors", VOLUMES)
    assert network.head.weights.shape == (4 * VOLUMES.layers, VOLUMES.widths[0], 1)
    samples, recipes = read_samples(tmp_path / "samples", sampled_missions(("cave",), "train", 1, 2, 0))
    assert samples.cells.shape == (2, 65, 64, 64) and {RECIPES[n] for n in recipes} == {"cave"}
    plans = as_plans(samples)
    assert plans.truth.shape == (64, 1, 64, 64) and plans.truth[plans.cells[:, [SOLID]] == 252].mean() > 0.99
    seen_free = (plans.cells[:, [FREE]] == 252) & (plans.cells[:, [OUTSIDE]] == 0)
    assert seen_free.any() and plans.truth[seen_free].mean() < 0.02
    assert np.array_equal(unmeasured(plans.cells).reshape(samples.truth.shape), unmeasured(samples.cells))


@pytest.mark.parametrize("voxel_size_m", [0.25, 0.4, 1.0])
def test_a_cell_of_a_volume_is_solid_if_its_middle_is(voxel_size_m):
    occupied = np.random.default_rng(2).random((9, 7, 5)) < 0.4
    window = VolumeWindow(-3, -16, 1)
    found = map_samples._solid_cells(occupied, voxel_size_m, window)
    assert found.shape == (32, 64, 64)
    for k, i, j in np.random.default_rng(3).integers(0, (8, 30, 34), (300, 3)):
        cell = window.x + i, window.y + j, window.z + k
        at = tuple(math.floor((n + 0.5) * 0.4 / voxel_size_m) for n in cell)
        inside = all(0 <= n < count for n, count in zip(at, occupied.shape, strict=True))
        assert found[k, i, j] == (occupied[at] if inside else True)
    assert not found[:8, :30, :34].all()


def test_samples_of_other_options_are_other_files(tmp_path):
    asked = [sampled_missions(RECIPES_HERE, "train", 2, *more) for more in ((3, 1), (4, 1), (3, 2))]
    files = [map_samples.file_of(tmp_path, each) for some in asked for each in some]
    assert len(set(files)) == 3 * 2 * len(RECIPES_HERE)


def test_missions_are_of_their_split_and_dungeons_of_odd_number():
    named = {"train": set(), "validation": set()}
    for split, names in named.items():
        for sampled in sampled_missions(("dungeon", "office"), split, 40, 3, 0):
            scenario = scenario_of(sampled, np.random.default_rng(sampled.drawn_from))
            assert scenario.split == split
            names.add(scenario.world)
    numbers = {
        split: {int(name.removeprefix("dungeon-")) for name in names - {"office"}}
        for split, names in named.items()
    }
    assert all(number % 2 for each in numbers.values() for number in each)
    assert not numbers["train"] & numbers["validation"] and min(map(len, numbers.values())) > 5


def test_a_finished_run_gives_the_same_weights_without_missions(whole, started):
    for _ in range(2):
        assert run(started) == 0
        assert same_tensors(started / "predictor.safetensors", whole / "predictor.safetensors")


def test_an_interrupted_run_ends_like_an_uninterrupted_one(whole, started, monkeypatch, capsys):
    class Asked(Interruption):
        def __enter__(self) -> Interruption:
            self.asked = self._catches = False
            return self

    def save_and_ask(*given) -> None:
        save(*given)
        interruption.asked = True

    save, interruption = map_predictor._save, Asked("")
    with monkeypatch.context() as patch:
        patch.setattr(map_predictor, "Interruption", lambda promise: interruption)
        patch.setattr(map_predictor, "_save", save_and_ask)
        assert run(started) == INTERRUPTED
    assert "the same command goes on" in capsys.readouterr().err
    assert not (started / "predictor.safetensors").exists()
    assert run(started) == 0
    for name in ("predictor.safetensors", "training.safetensors"):
        assert same_tensors(started / name, whole / name)
    assert (started / "predictor.json").read_bytes() == (whole / "predictor.json").read_bytes()


def test_weights_are_scored_without_learning(whole, started, monkeypatch):
    monkeypatch.setattr(map_predictor, "train", lambda *_: pytest.fail("learned"))
    assert run(started, f"--weights {whole / 'predictor.safetensors'}") == 0
    figures = [json.loads((folder / "predictor.json").read_text())["figures"] for folder in (whole, started)]
    assert figures[0] == figures[1]


def test_the_shipped_weights_tell_rooms_from_rock_in_worlds_that_they_never_saw(whole):
    """Of one mission each in a corridor and among clutter, drawn by another seed than any of training."""
    validation = sampled_missions(RECIPES_HERE, "validation", 1, 3, 1)
    samples, recipes = read_samples(whole / "samples", validation)
    shipped = shipped_predictor().network
    shares = nearest_shares(samples, CELL_M)
    cells = scored(samples, recipes, CELL_M, predictions(shipped, PLANS, samples), shares)
    figures = figures_of(cells)
    for recipe in RECIPES_HERE:
        assert figures[recipe]["predicted_bits"] < 0.8 * figures[recipe]["base_rate_bits"], recipe


def test_a_recipe_that_is_left_out_is_told_of_and_not_learned(started, monkeypatch, capsys):
    seen, read = [], map_predictor.read_samples
    monkeypatch.setattr(map_predictor, "read_samples", lambda *given: seen.append(given[1]) or read(*given))
    assert run(started, "--leave-out corridor") == 0
    assert [each.recipe for each in seen[0]] == ["cluttered"] and len(seen[1]) == 2
    assert "corridor" in json.loads(capsys.readouterr().out)["figures"]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("--recipes room", "recipes = 'room'"),
        ("--recipes cave office", "plans alone, or volumes alone"),
        ("--leave-out office", "leave_out = 'office'"),
        ("--recipes cluttered --leave-out cluttered", "not the only recipe"),
        ("--epochs 0", "epochs = 0"),
        ("--rate 0", "rate = 0.0"),
        ("--rate inf", "rate = inf"),
        ("--device tpu", "device = 'tpu': expected auto, cpu"),
        ("--device cuda:99", "device = 'cuda:99'"),
        ("--device meta", "device = 'meta'"),
        ("--device hpu", "device = 'hpu'"),
        ("--weights missing.safetensors", "No such file"),
    ],
)
def test_options_out_of_range_are_refused_in_a_line(more, said, tmp_path, capsys):
    assert run(tmp_path / "run", more) == BAD_INPUT
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1 and not (tmp_path / "run").exists()


def test_a_folder_of_another_run_and_broken_files_are_refused(started, monkeypatch, capsys):
    assert run(started) == 0
    with monkeypatch.context() as patch:
        patch.setattr(map_predictor, "make_samples", lambda *_: pytest.fail("sampled first"))
        assert run(started, "--rate 1e-3") == BAD_INPUT
        assert "rate = 0.001: expected 0.002 as in the run in" in capsys.readouterr().err
        (started / "training.safetensors").write_bytes(b"no tensors")
        assert run(started) == BAD_INPUT
        assert "remove it to begin anew" in capsys.readouterr().err
    (started / "training.safetensors").unlink()
    file = started / "samples" / f"{missions('train')[0].name}.samples"
    content = file.read_bytes()
    file.write_bytes(content[:-200])
    assert run(started) == BAD_INPUT
    assert "remove that file, and it is made again" in capsys.readouterr().err
    arrays = stored_arrays(zlib.decompress(content))
    arrays["truth"] = arrays["truth"][:, 0]  # as an earlier version wrote it
    file.write_bytes(zlib.compress(stored_bytes(arrays)))
    assert run(started) == BAD_INPUT
    file.write_bytes(content)
    assert "remove that file, and it is made again" in capsys.readouterr().err


def test_missions_are_counted_as_they_are_sampled(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(map_predictor, "make_samples", lambda *_: iter([None]))
    words = [*TINY.replace("--json", "").split(), "--out", str(tmp_path)]
    assert run_command(main, words) == BAD_INPUT  # no file of samples is there
    assert capsys.readouterr().err.startswith("1 mission sampled\n")


def test_turns_and_mirrors_move_cells_and_truth_together():
    rng = np.random.default_rng(0)
    truth = rng.random((2, 1, CELLS, CELLS)) < 0.3
    cells = np.zeros((2, 3, CELLS, CELLS), np.uint8)
    shown = rng.random(truth.shape) < 0.5
    cells[:, SOLID:FREE][shown & truth], cells[:, FREE:OUTSIDE][shown & ~truth] = 252, 252
    given, forms = (torch.from_numpy(cells), torch.from_numpy(truth), torch.tensor([1])), set()
    for _ in range(40):
        told, solid, asked = drawn_batch(*given, rng)
        known = asked == 0.0
        assert torch.equal(told[:, [SOLID]][known], solid[known])
        assert torch.equal(told[:, [FREE]][known], 1.0 - solid[known])
        assert bool(((asked == 1.0) == (told[:, :2].sum(dim=1, keepdim=True) == 0.0)).all())
        forms.add(solid.numpy().tobytes())
    assert len(forms) == 8


def test_the_loss_is_that_of_the_cells_asked_for():
    logits = torch.tensor([[[0.0, 100.0], [math.log(3.0), -100.0]]])
    truth = torch.tensor([[[1.0, 0.0], [0.0, 1.0]]])
    asked = torch.tensor([[[1.0, 0.0], [1.0, 0.0]]])
    assert masked_loss(logits, truth, asked).item() == pytest.approx(0.5 * (math.log(2.0) + math.log(4.0)))
    assert masked_loss(logits, truth, torch.zeros_like(asked)).item() == 0.0


def test_the_rate_rises_and_ends_at_zero():
    args, rates = Args(), []
    for step in range(200):
        rates.append(rate_at(args, step, 200))
    assert np.argmax(rates) == 9 and rates[9] == pytest.approx(args.rate)
    assert rates[0] == pytest.approx(args.rate / 10) and rates[-1] == pytest.approx(0.0, abs=1e-12)


def test_log_loss_and_calibration_by_hand():
    truth, predicted = np.array([True, False, True, True]), np.array([0.5, 0.75, 0.75, 1.0])
    assert log_loss_bits(truth, predicted) == pytest.approx((1.0 + 2.0 + math.log2(4 / 3)) / 4, abs=1e-5)
    table = reliability(truth, predicted)
    assert table == [[0.5, 1.0, 1], [0.75, 0.5, 2], [1.0, 1.0, 1]]
    assert calibration_error(table) == pytest.approx((0.5 + 2 * 0.25) / 4)


def test_the_nearest_measured_cell_by_hand():
    cells = np.zeros((1, 3, CELLS, CELLS), np.uint8)
    cells[0, SOLID, 3, 5], cells[0, FREE, 40, 5] = 252, 126
    bins, near = nearest_bins(cells, CELL_M)
    assert bins[0, 0, 4, 5] == 1 and bins[0, 0, 39, 5] == 0  # 0.2 m from solid, 0.2 m from free
    assert bins[0, 0, 3, 8] == 2 * 2 + 1 and bins[0, 0, 43, 9] == 2 * 3  # 0.6 m, 1.0 m
    assert near[0, 0, 3, 25] and not near[0, 0, 3, 26]  # 4.0 m, 4.2 m
    truth = np.zeros((1, 1, CELLS, CELLS), bool)
    truth[0, 0, 4, 5] = True
    samples = Samples(cells, truth)
    shares = nearest_shares(samples, CELL_M)
    assert shares[1] == pytest.approx((1 + 1) / (8 + 2))  # one of eight neighbours is solid
    assert shares[0] == pytest.approx(1 / 10)
    found = scored(samples, np.array([2]), CELL_M, np.full(truth.shape, 0.25, np.float32), shares)
    assert len(found.truth) == CELLS**2 - 2 and found.truth.sum() == 1
    figures = figures_of(found)
    assert set(figures) == {"all", "near", RECIPES[2]} and figures["near"]["cells"] == found.near.sum()
    rate = 1 / (CELLS**2 - 2)
    base = -(rate * math.log2(rate) + (1 - rate) * math.log2(1 - rate))
    assert figures["all"]["base_rate_bits"] == pytest.approx(base)


def test_nothing_measured_at_all_is_far_from_everything():
    bins, near = nearest_bins(np.zeros((1, 3, CELLS, CELLS), np.uint8), CELL_M)
    assert (bins == 12).all() and not near.any()


def test_the_nearest_measured_cell_may_lie_in_another_layer():
    cells = np.zeros((1, 65, 64, 64), np.uint8)
    cells[0, 3, 10, 20], cells[0, 32 + 28, 50, 20] = 252, 252
    cells[0, 30:32] = 252  # over the workspace
    bins, near = nearest_bins(cells, 0.4)
    assert (
        bins[0, 4, 10, 20] == 2 * 1 + 1 and bins[0, 26, 50, 20] == 2 * 2
    )  # 0.4 m from solid, 0.8 m from free
    assert near[0, 13, 10, 20] and not near[0, 14, 10, 20]  # 4.0 m, 4.4 m
