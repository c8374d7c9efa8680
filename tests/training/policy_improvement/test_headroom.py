"""The clairvoyant never loses against the planner; restricted choices are actions of their set."""

from __future__ import annotations

import contextlib
import io
import json

import numpy as np
import pytest
import torch

from baselines.cli.arguments import run_command
from baselines.experiments.mission import run_mission, scripted, scripted_env
from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.errors import SettingError
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.scenario import with_settings
from training.policy_improvement import headroom, headroom_table
from training.policy_improvement.headroom import Args, Clairvoyant, lead_by_planner
from training.policy_improvement.restricted import ACTIONS, RestrictedPlanner
from training.policy_improvement.tasks import task_of
from training.seeds import label_seeds

torch.set_num_threads(1)
SEEDS = label_seeds(3, 2**31, 3)


def test_the_clairvoyant_is_never_slower_than_the_planner_and_sometimes_faster():
    """Its branches are the missions as they will be: the planner's own is one of them."""
    task = task_of("box-7x11x5:2", 6)
    planner = lead_by_planner(task, SEEDS, 1)
    args = Args(tries=4, every=2, threads=1)
    clairvoyant = Clairvoyant(task, SEEDS, args, None)
    times_s = clairvoyant.run()
    clairvoyant.close()
    assert (times_s <= planner.times_s + 1e-9).all() and (times_s < planner.times_s - 1e-3).any()
    assert planner.moments_to_go_s.min() > 0.0 and len(planner.moments) == len(planner.moments_to_go_s)


def test_the_command_compares_all_on_the_same_starts(tmp_path):
    words = "--scenario box-7x11x5 --robots 1 --missions 2 --candidates 5 --tries 3 --every 4".split()
    words += ["--horizon", "3", "--divisor", "2", "--threads", "1", "--json", "--out", str(tmp_path)]
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        code = run_command(headroom.main, words)
    found = json.loads(text.getvalue())
    assert code == 0 and json.loads((tmp_path / "box-7x11x5-1.json").read_text()) == found
    assert [row["name"] for row in found["rows"]] == ["planner", "clairvoyant", "planned-rate", "restricted"]
    kept = tmp_path / "box-7x11x5-1.json"
    headroom._keep(kept, {**found, "rows": found["rows"][:1]})  # a run of the same that was stopped
    assert json.loads(kept.read_text()) == found
    headroom._keep(kept, {**found, "every": 5, "rows": found["rows"][:1]})
    assert len(json.loads(kept.read_text())["rows"]) == 1
    planner, *others = found["rows"]
    assert planner["ratio"] == planner["mean_ratio"] == 1.0
    assert all(row["finished"] == 2 and 0.2 < row["mean_ratio"] < 5.0 for row in others)


def test_what_the_command_wrote_is_shown_as_a_table(tmp_path):
    assert headroom_table.shown(tmp_path) == "" == headroom_table.shown(tmp_path / "none")
    row = {
        "median_s": 52.4,
        "mean_ratio": 0.9,
        "mean_ratio_low": 0.85,
        "mean_ratio_high": 0.951,
        "finished": 8,
    }
    found = {"scenario": "cave", "robots": 3, "missions": 8, "every": 2, "horizon": 0, "divisor": 1}
    found["rows"] = [{"name": "planner", **row}, {"name": "clairvoyant", **row}]
    (tmp_path / "cave-3.json").write_text(json.dumps(found))
    (tmp_path / "office-1.json").write_text(
        json.dumps({**found, "scenario": "office", "robots": 1, "horizon": 9})
    )
    lost = [*found["rows"][:1], {**found["rows"][1], "name": "restricted", "finished": 3}]
    (tmp_path / "room-2.json").write_text(
        json.dumps({**found, "scenario": "room", "robots": 2, "rows": lost, "divisor": 2})
    )
    _, _, cave, office, room = headroom_table.shown(tmp_path).strip().splitlines()
    assert room.endswith(
        "| 2, to the end, drawing 1/2 | 52 s | - | - | 0.90 (0.85 … 0.95), 3 of 8 finished |"
    )
    assert cave == "| cave, 3 robots | 8 | 2 | 52 s | 0.90 (0.85 … 0.95) | - | - |"
    assert office.startswith("| office, 1 robot | 8 | 2, 9 decisions deep, drawing 1/1 | 52 s |")
    (tmp_path / "other.json").write_text("[1]")
    with pytest.raises(SettingError, match=r"other\.json"):
        headroom_table.shown(tmp_path)


def test_restricted_choices_are_actions_of_the_set():
    task = with_settings(scripted(task_of("box-7x11x5:1", 5)), {"action": {"kind": "continuous"}})
    env, seen = scripted_env(task), []

    class Watched(RestrictedPlanner):
        def choose_all(self, views):
            chosen = super().choose_all(views)
            seen.extend((view.pose.copy(), viewpoint) for view, viewpoint in zip(views, chosen, strict=True))
            return chosen

    run_mission(env, Watched(), 5)
    assert mission_figures(env.missions, 0)["finished"]
    yaws = np.array([viewpoint[3] for _, viewpoint in seen])
    steps = (yaws / (2.0 * np.pi / ACTIONS.yaws)) % 1.0
    assert np.allclose(np.minimum(steps, 1.0 - steps), steps.min(), atol=1e-6)
    assert all(np.linalg.norm(at[:3] - pose[:3]) <= 1.0 + 1e-6 for pose, at in seen) and len(seen) > 5


@pytest.mark.parametrize("words", ["--tries 1", "--tries 25", "--every 0", "--scenario nowhere"])
def test_bad_options_are_refused(words, capsys):
    assert run_command(headroom.main, words.split()) == BAD_INPUT
    assert len(capsys.readouterr().err.splitlines()) == 1
