"""Missions that are recorded, kept in a file, and run again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.mission_record import (
    CommandRecorder,
    MissionRecord,
    load_record,
    reset_options_of,
    same_end,
    save_record,
)


def check_replay(
    env: EntropyExploreEnv, act: Callable[[], Any], steps: int | None, file: Path
) -> MissionRecord:
    """Check that a mission's record ends as it did, and so does the mission that is run again from it.

    Args:
        env: After its reset.
        act: Draws an action.
        steps: How many to play; None = to the end.
        file: To keep the record in.

    Returns:
        The record, as it was read.
    """
    recorder, played = CommandRecorder(env.missions), 0
    while env.agents and played != steps:
        actions = {agent: act() for agent in env.agents}
        recorder.command(actions)
        env.step(actions)
        recorder.note()
        played += 1
    assert played > 0
    save_record(recorder.record("drawn"), file)
    record = load_record(file)
    assert same_end(record, env.missions)
    again = EntropyExploreEnv(record.scenario)
    again.reset(seed=record.seed, options=reset_options_of(record))
    for command in record.commands:
        again.step(dict(zip(record.scenario.agents, command, strict=True)))
    assert same_end(record, again.missions)
    return record
