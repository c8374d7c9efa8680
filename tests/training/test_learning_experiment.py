"""The experiment's plan, and a page that says what was found and nothing else."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.errors import SettingError
from training import experiment, ppo
from training.experiment import (
    ABLATIONS,
    SEEDS,
    TASKS,
    ExperimentResults,
    Task,
    planned_runs,
    read_curve,
    train,
)
from training.experiment_page import write_page

CURVE = [
    {"steps": 100.0, "mean_s": 90.0, "median_s": 80.0, "finished": 1.0},
    {"steps": 200.0, "mean_s": 60.0, "median_s": 50.0, "finished": 1.0},
]
SPENT = {"steps": 200, "collecting_s": 60.0, "learning_s": 30.0, "validating_s": 30.0, "processor_s": 90.0}


def row(strategy: str, median_s: float, **more: Any) -> dict[str, Any]:
    mean = {"median_s": median_s, "low_s": median_s - 1, "high_s": median_s + 1, "mean_s": median_s}
    return {"strategy": strategy, **mean, "finished": 20, "scans": 100.0, **more}


def rival(strategy: str, median_s: float, ratio: float, faster: int) -> dict[str, Any]:
    return row(strategy, median_s, ratio=ratio, ratio_low=ratio - 0.1, ratio_high=ratio + 0.1, faster=faster)


def results(ratio: float, faster: int) -> ExperimentResults:
    task = Task("room", 200, 1, 0.45)
    rows = [
        row("runs/room-3-seed-0", 50.0),
        rival("gradient", 50.0 / ratio, ratio, faster),
        rival("random", 400.0, 0.125, 20),
        rival("planned-rate", 40.0, 1.25, 3),
    ]
    compared = {
        "scenario": "room",
        "robots": 3,
        "seeds": 20,
        "policy": "runs/room-3-seed-0",
        "rows": rows,
        "better_rival": "gradient",
        "faster_than_simple": faster,
    }
    changed = {name: [[{**CURVE[1], "mean_s": 60.0 + seed}] for seed in range(SEEDS)] for name in ABLATIONS}
    changed["burst-32"] = [[{**CURVE[1], "mean_s": 70.0 - seed}] for seed in range(SEEDS)]
    run = "room-3-seed-0"
    return ExperimentResults([task], {"room": compared}, {run: CURVE}, {run: SPENT}, changed, 100)


@pytest.mark.parametrize(("ratio", "faster", "said"), [(0.4, 19, "yes"), (0.5, 18, "no")])
def test_goals_are_judged_by_what_was_found(tmp_path: Path, ratio: float, faster: int, said: str) -> None:
    page = write_page(tmp_path, results(ratio, faster), "the command").read_text()
    assert f"| {ratio:.2f} ({ratio - 0.1:.2f} … {ratio + 0.1:.2f}) | {said} |" in page
    assert f"| faster than both on at least 19 of 20 starts | {faster} | {said} |" in page
    assert "| stretch: median at most 0.9 × that of planned-rate | 1.25 (1.15 … 1.35) | no |" in page
    assert "| room-3-seed-0 | 200 | 2.0 | 1.5 | 67% | 50.0 s at 200 |" in page
    assert {path.name for path in (tmp_path / "ppo").iterdir()} == {
        "curve-room.png",
        "curve-room.csv",
        "ablations.png",
    }


def test_changes_are_told_seed_by_seed(tmp_path: Path) -> None:
    """60, 61, 62 s by default and 70, 69, 68 s with short batches: 8 s apart on average, from 6 to 10."""
    page = write_page(tmp_path, results(0.4, 20), "the command").read_text()
    line = next(line for line in page.splitlines() if line.startswith("| burst-32 "))
    assert line.endswith("| 70.0, 69.0, 68.0 | default | +8.0 | +6.0 … +10.0 |")


def test_every_run_is_its_own_and_its_options_are_ppo_s() -> None:
    runs = planned_runs(TASKS, 1000, quick=False)
    assert len(runs) == sum(task.seeds for task in TASKS) + SEEDS * len(ABLATIONS)
    assert len({tuple(options) for options in runs.values()}) == len(runs)
    default = vars(ppo.parsed(runs["ablations/default-1"]))
    for name, ablation in ABLATIONS.items():
        changed = vars(ppo.parsed(runs[f"ablations/{name}-1"]))
        different = [field for field, value in changed.items() if value != default[field]]
        assert (len(different) >= 1) is bool(ablation.options)
        assert ablation.reference in ABLATIONS
        ppo.training_task(ppo.Args(**changed))


def test_a_run_that_fails_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"one: .*cellar"):
        train({"one": ["--scenario", "cellar", "--total-steps", "5"]}, tmp_path, 1, quiet=True)


def test_curves_are_read_with_what_is_missing(tmp_path: Path) -> None:
    (tmp_path / "curve.csv").write_text("steps,mean_s,bits_per_bit\n10,2.5,\n20,1.5,0.5\n")
    rows = read_curve(tmp_path)
    assert rows[1] == {"steps": 20.0, "mean_s": 1.5, "bits_per_bit": 0.5}
    assert np.isnan(rows[0]["bits_per_bit"])


def test_bad_numbers_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--seeds", "0", "--runs", str(tmp_path / "runs")]
    assert experiment.run_command(experiment.main, words) == BAD_INPUT
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert dataclasses.is_dataclass(experiment.Args)
