"""Trainers compared by the folders of their runs: at equal steps, by the policies that are kept."""

from __future__ import annotations

import json
from pathlib import Path

from baselines.cli.arguments import run_command
from training.trainer_comparison import main


def write_run(folder: Path, module: str, curve: list[tuple[float, float, float]], **args: object) -> Path:
    """A folder of a run whose validations are (robot-steps, mean, median)."""
    column = "steps" if module == "training.ppo" else "robot_steps"
    rows = "".join(f"{steps},7,{mean},{median}\n" for steps, mean, median in curve)
    folder.mkdir()
    (folder / "curve.csv").write_text(f"{column},seconds,mean_s,median_s\n{rows}", "utf-8")
    settled = {
        "scenario": "room",
        "robots": 3,
        "seed": 0,
        "runners": 2,
        "task": {"robot": {"speed": 1}},
        **args,
    }
    started = {"command": f"python -m {module} --out {folder.name}", "args": settled}
    (folder / "run.json").write_text(json.dumps(started), "utf-8")
    return folder


def test_policies_are_compared_that_were_kept_after_steps_that_all_runs_reached(tmp_path):
    runs = [
        write_run(tmp_path / "a", "training.ppo", [(100, 60, 50), (200, 40, 30), (300, 10, 10)]),
        write_run(
            tmp_path / "b",
            "training.ppo",
            [(150, 50, 40), (210, 55, 20)],
            seed=1,
            task={"robot": {"speed": 1, "new": 3}},
        ),
        write_run(tmp_path / "c", "training.rllib_ppo", [(100, 90, 70), (205, 50, 39), (220, 20, 20)]),
        write_run(tmp_path / "d", "training.rllib_ppo", [(190, 90, 49), (400, 20, 20)], runners=1),
    ]
    assert run_command(main, [*map(str, runs), "--out", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "trainers.md").read_text("utf-8")
    assert "after 210 robot-steps" in page
    assert "| Stable-Baselines3 | 30.0, 40.0 | 35.0 |" in page
    assert "| RLlib, 2 runners | 39.0 | 39.0 | 1.11 | yes |" in page
    assert "| RLlib, 1 runner | 49.0 | 49.0 | 1.40 | no |" in page
    assert all(
        f"    python -m training.{'rllib_' * (name > 'b')}ppo --out {name}\n" in page for name in "abcd"
    )
    assert (tmp_path / "out" / "trainers" / "curves.png").read_bytes()[:4] == b"\x89PNG"
    table = (tmp_path / "out" / "trainers" / "curves.csv").read_text("utf-8").splitlines()
    assert table[0] == "trainer,seed,robot_steps,mean_s,median_s" and len(table) == 11
    assert "Stable-Baselines3,1,210.0,55.0,20.0" in table


def test_other_folders_and_other_scenarios_are_refused(tmp_path, capsys):
    good = write_run(tmp_path / "a", "training.ppo", [(100, 60, 50)])
    other = write_run(tmp_path / "b", "training.ppo", [(100, 60, 50)], scenario="office")
    empty = write_run(tmp_path / "c", "training.ppo", [])
    faster = write_run(tmp_path / "e", "training.ppo", [(100, 60, 50)], task={"robot": {"speed": 2}})
    late = write_run(tmp_path / "d", "training.ppo", [(101, 60, 50)])
    for wrong, said in (
        (other, "allowed is that of the first: room"),
        (faster, "{'robot': {'speed': 2}}: allowed is that of the first: {'robot': {'speed': 1}}"),
        (late, "a validation within 100, the shortest run"),
        (empty, "has been validated"),
        (tmp_path, "has been validated"),
    ):
        assert run_command(main, [str(good), str(wrong), "--out", str(tmp_path / "out")]) != 0
        assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
