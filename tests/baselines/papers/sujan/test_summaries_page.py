"""Summaries beside batches at equal bits: cells, what is recorded, claims, page."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.papers.sujan.summaries import (
    BURSTS,
    EVERY_S,
    TASKS,
    SharedMaps,
    Task,
    all_claims,
    batch_id,
    figure_of,
    map_errors,
    summary_id,
)
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from tests.baselines.papers.pages import run_paper
from tests.reference.scenes import free_box


def record(time_s, bits_per_s, error, joint=0.1):
    maps = {"error": error, "known": 0.5, "wrong": 0.01, "joint_error": joint}
    return {
        "t_mission_s": time_s,
        "bits_per_s": bits_per_s,
        "bits_gained_per_bit_sent": 0.5,
        "finished": True,
        "moment": maps,
        "end": {**maps, "error": 9.0},
    }


def drawn_records():
    """Batches of b measurements cost 100 b bits/s and take 1000 / b s; summaries cost 600 and take 100 s."""
    records = {}
    for task in TASKS:
        for burst in BURSTS:
            one = record(1000.0 / burst, 100.0 * burst, 0.4)
            records[batch_id(task, burst)] = [one, one, one]
        for every_s in EVERY_S:
            records[summary_id(task, every_s)] = [record(100.0, 600.0, 0.1, 0.2)] * 3
    return records


def test_claims_by_hand():
    records = drawn_records()
    claims = {claim.id: claim for claim in all_claims(records)}
    assert len(claims) == 3 * len(TASKS) * len(EVERY_S)
    time = claims["time-office-5"]
    assert time.ours == pytest.approx((250.0 + 125.0) / 2 / 100.0) and time.holds  # between bursts 4 and 8
    assert claims["error-terrain-20"].ours == pytest.approx(4.0)
    assert claims["joint-terrain-20"].ours == pytest.approx(0.5)
    assert not claims["joint-terrain-20"].holds
    over = [{**record(50.0, 1.0, 0.1), "moment": None}]
    assert figure_of(over, "error").tolist() == [9.0]


def test_errors_of_maps_by_hand():
    env = EntropyExploreEnv(free_box(robots=2, track_truth=True, world="furnished"))
    env.reset(seed=3)
    before = map_errors(env)
    assert (before["error"], before["known"], before["wrong"], before["joint_error"]) == (0.5, 0.0, 0.0, 0.5)
    world = env.missions.worlds[0]
    truth = world.occupied.ravel()
    env.missions.state.mean[0, 0] = truth
    env.missions.state.precision[0, 0] = 1.0
    found = map_errors(env)
    assert (found["error"], found["known"], found["wrong"]) == (0.25, 0.5, 0.0)
    env.missions.state.mean[0, 0] = ~truth
    assert map_errors(env)["wrong"] == 1.0 and map_errors(env)["error"] == 0.75


def test_maps_are_looked_at_at_the_moment_and_at_the_end():
    env = EntropyExploreEnv(free_box(robots=2, track_truth=True, time_limit_s=30.0))
    found = SharedMaps(5.0)(env, "random", 1)
    assert (
        found["moment"]["known"] < found["end"]["known"] and found["moment"]["error"] > found["end"]["error"]
    )
    assert found["bits_per_s"] == found["bits_sent"] / found["t_mission_s"]
    assert SharedMaps(1e6)(env, "random", 1)["moment"] is None


def test_the_command_writes_its_page(tmp_path, capsys, monkeypatch):
    tiny = {"ending": {"time_limit_s": 20.0}, "robots": 3}
    hills = {"ending": {"sigma_end": 0.1, "time_limit_s": 9.0}}
    monkeypatch.delitem(TASKS, "occlusions")
    monkeypatch.setitem(TASKS, "office", Task("random", tiny, 8.0))
    monkeypatch.setitem(TASKS, "terrain", Task("random", hills, 4.0))
    ran = run_paper("sujan-summaries", tmp_path, capsys, "--seeds", "2")
    assert len(ran.claims) == 18
    assert ran.page.count("| summaries, ") == 6 and ran.page.count("| batches of ") == 12
    bits = [row.record["bits_sent"] for row in ran.rows if row.cell == "office-summaries-5"]
    assert len(bits) == 2 and np.all(np.array(bits) > 0)
