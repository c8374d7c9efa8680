"""The memory that missions need, estimated beforehand, against what they really allocate."""

import gc
import os
import time
import tracemalloc
from typing import Any

import numpy as np
import pytest

from entropy_explore_env import (
    EntropyExploreVectorEnv,
    Grid,
    SettingError,
    World,
    find_scenario,
    parallel_env,
)
from entropy_explore_env.missions import memory
from entropy_explore_env.missions.memory import Batch, memory_needs

PYTHON_BYTES = 400_000
"""Of objects that are no arrays: spaces, settings, threads."""


def drawn(rng: np.random.Generator) -> tuple[str, dict[str, Any], int, int]:
    """A scenario, settings, missions and threads."""
    some = ("room", "room-furnished", "office", "office-3d", "terrain", "lab", "office-mixed")
    settings: dict[str, Any] = {"robots": int(rng.integers(1, 12))}
    delay_s = float(rng.uniform(0, 60))
    channel = [{"delay_s": delay_s}, {"phase_s": float(rng.uniform(0.1, 60))}, {}]
    channel.append({"content": "summaries", "delay_s": delay_s * rng.integers(2)})
    settings["channel"] = {**channel[rng.integers(4)], "burst": int(rng.integers(1, 200))}
    patch = tuple(int(n) for n in 2 * rng.integers(0, 16, 3) + 1)
    settings["observation"] = {
        "drive": bool(rng.integers(2)),
        "patch": bool(rng.integers(2)),
        "patch_shape": patch,
        "overview": bool(rng.integers(2)),
        "overview_shape": tuple(int(n) for n in rng.integers(1, 40, 3)),
        "panorama_yaws": int(rng.integers(1, 200)),
        "flat": bool(rng.integers(2)),
    }
    settings["track_truth"] = bool(rng.integers(2))
    if "content" in settings["channel"]:  # as other tests: each further combination would be compiled
        settings["faults"] = {"stop": {"mean_s": 100.0}}
    else:
        settings["channel"]["reach"] = str(rng.choice(["distance", "line_of_sight"]))
    settings["robot"] = {"body_radius_m": float(rng.choice([0.05, 0.2]))}
    settings["sensor"] = {"angular_step_rad": float(rng.choice([0.02, 0.06]))}
    return str(rng.choice(some)), settings, int(rng.integers(1, 9)), int(rng.integers(1, 3))


def stepped(
    scenario: str, settings: dict[str, Any], missions: int, threads: int
) -> tuple[EntropyExploreVectorEnv, object]:
    """An environment after a reset and a step, and what it told."""
    batch = EntropyExploreVectorEnv(scenario, missions, threads=threads, **settings)
    batch.reset(seed=1)
    space = batch.action_space
    return batch, batch.step(np.zeros(space.shape, space.dtype))


def held_bytes(scenario: str, settings: dict[str, Any], missions: int, threads: int) -> tuple[int, int]:
    """What was counted, and what an environment holds after a reset and a step, with nothing to compile."""
    stepped(scenario, settings, 1, threads)
    gc.collect()
    tracemalloc.start()
    try:
        batch, told = stepped(scenario, settings, missions, threads)
        gc.collect()
        held = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    needs = memory_needs(batch.scenario, Batch(missions, batch.missions.threads))
    batch.close()
    del told
    return sum(need.bytes for need in needs), held


CANDIDATES = {"robots": 2, "action": {"kind": "candidates"}, "observation": {"overlaps": True}}


def test_what_is_counted_is_what_missions_hold() -> None:
    for number in (None, *range(4)):
        asked = ("room", CANDIDATES, 3, 1) if number is None else drawn(np.random.default_rng(number))
        counted, held = held_bytes(*asked)
        scenario = find_scenario(asked[0])
        starts = 8 * scenario.grid.voxels * asked[2]  # they are counted as if all voxels were free
        assert 0.97 * held - PYTHON_BYTES < counted < 1.03 * held + starts, (number, counted, held, asked)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"num_envs": 10**9}, "missions"),
        ({"num_envs": 1000, "robots": 1000}, "Observation.team"),
        ({"num_envs": 1000, "robots": 1000, "observation": {"team": False}}, "Scenario.robots"),
        (
            {"robots": 1000, "observation": {"patch": True, "patch_shape": (255,) * 3}},
            "Observation.patch_shape",
        ),
        ({"grid": {"voxel_size_m": 0.5, "shape": (1200, 1100, 1000)}}, "Grid.voxel_size_m"),
        ({"num_envs": 2000, "channel": {"delay_s": 3600.0}}, "Channel.delay_s"),
        ({"num_envs": 20_000, "channel": {"phase_s": 3600.0}}, "Channel.phase_s"),
        ({"num_envs": 10_000, "channel": {"content": "summaries", "delay_s": 3600.0}}, "Channel.delay_s"),
        ({"num_envs": 30_000, "sensor": {"angular_step_rad": 1e-3}}, "RangeSensor.angular_step_rad"),
        ({"num_envs": 400_000, "action": {"kind": "discrete"}, "robot": {"reach_m": 3.5}}, "Robot.reach_m"),
    ],
)
def test_more_than_there_is_is_refused_at_once_and_what_to_lower_is_named(
    settings: dict[str, Any], named: str, monkeypatch
) -> None:
    monkeypatch.setattr(memory, "memory_there_is", lambda: 24 << 30)
    tracemalloc.start()
    began = time.process_time()  # also where other processes keep the machine busy
    with pytest.raises(SettingError, match=r"into 24\.0 GiB of memory: .* GiB, .* of them for") as caught:
        EntropyExploreVectorEnv("box-7x11x5", **settings)
    took_s, peak = time.process_time() - began, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert caught.value.field == named and named in caught.value.allowed
    assert took_s < 2.0 and peak < 60e6


def test_what_was_allowed_before_is_allowed_with_the_memory_that_it_needs(monkeypatch) -> None:
    needed = sum(need.bytes for need in memory_needs(parallel_env("room").scenario, Batch(1)))
    monkeypatch.setattr(memory, "memory_there_is", lambda: needed)
    parallel_env("room")
    monkeypatch.setattr(memory, "memory_there_is", lambda: needed - 1)
    with pytest.raises(SettingError, match=r"enlarge Grid\.voxel_size_m, or have fewer missions"):
        parallel_env("room")
    monkeypatch.setattr(memory, "memory_there_is", lambda: None)
    parallel_env("room")


def test_worlds_that_are_given_are_not_drawn_for_each_mission() -> None:
    grid = Grid((9, 13, 7), 0.5)
    scenario = parallel_env("box-7x11x5", world="furnished").scenario
    plain = World(grid, np.zeros(grid.shape, bool), "hall")
    given, drawn = (
        next(need.bytes for need in memory_needs(scenario, batch) if need.purpose == "maps")
        for batch in (Batch(5, 1, (plain,)), Batch(5))
    )
    assert given < drawn


def test_a_limit_of_the_group_of_processes_counts(monkeypatch, tmp_path) -> None:
    for text, limit in (("max", None), ("123456\n", 123456)):
        (tmp_path / "memory.max").write_text(text)
        monkeypatch.setattr(memory, "_LAST_GROUP", tmp_path / "memory.max")
        there_is = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        assert memory.memory_there_is() == (limit or there_is)
