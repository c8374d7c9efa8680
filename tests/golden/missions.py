"""Golden missions, run again as their records say and summed up; this module's command renews them.

`records/NAME.npz` is a mission record, from which scenario, strategy and seed are taken, with its commands
and scan times; `records/NAME.summary.npz` holds counts and floats of its end. Any record that
`baselines.run --record` wrote becomes a golden mission by being put there before a renewal.
"""

from __future__ import annotations

import platform
from pathlib import Path

import llvmlite.binding
import numba
import numpy as np

from baselines.experiments.mission import run_mission
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.mission_record import (
    CommandRecorder,
    MissionRecord,
    load_record,
    save_record,
)
from entropy_explore_env.reports.state_digest import named_digest, state_values

RECORDS = Path(__file__).parent / "records"
NAMES = sorted(path.stem for path in RECORDS.glob("*.npz") if not path.stem.endswith(".summary"))
_SAMPLED_VOXELS = 300
_OF_MISSION = ("time_s", "cycles", "end", "entropy_start_bits", "entropy_end_bits", "reached_s")
_OF_TRUTH = ("joint_bits", "explored", "explored_visible", "error", "wrong")
_OF_ROBOTS = tuple(
    "entropy_bits origin goal distance_m scans measurements redundant gained_bits heard_bits blocked_moves "
    "messages_sent measurements_sent bits_sent messages_received measurements_received bits_received "
    "messages_lost messages_out_of_range".split()
)


def run_again(record: MissionRecord) -> tuple[MissionRecord, Missions]:
    """The same strategy in the same scenario with the same seed: its record, and the missions at its end."""
    env = EntropyExploreEnv(record.scenario)
    recorder = CommandRecorder(env.missions)
    strategy = make_strategy(record.strategy)
    run_mission(env, strategy, record.seed, lambda _: recorder.note(), recorder.command)
    return recorder.record(record.strategy), env.missions


def summary_of(missions: Missions) -> dict[str, np.ndarray]:
    """Counts and floats of a mission's end: of itself, of its robots, and of some voxels of their beliefs."""
    values = state_values(missions, 0)
    names = [f"missions.{name}" for name in _OF_MISSION] + [f"robots.{name}" for name in _OF_ROBOTS]
    if missions.scenario.track_truth:
        names += [f"missions.{name}" for name in _OF_TRUTH]
    summary = {name: np.array(values[name]) for name in names}
    sampled = np.linspace(0, missions.grid.voxels - 1, _SAMPLED_VOXELS).astype(np.int64)
    for name in ("mean", "precision"):
        summary[f"{name}.sum"] = values[name].sum(axis=1, dtype=np.float64)
        summary[f"{name}.sampled"] = values[name][:, sampled].copy()
    return summary


def load_summary(name: str) -> tuple[dict[str, np.ndarray], str]:
    """The summary of a golden mission, and the machine that made it."""
    with np.load(RECORDS / f"{name}.summary.npz") as archive:
        entries = dict(archive)
    return entries, str(entries.pop("machine"))


def this_machine() -> str:
    """What must be the same for equal bits: the processor, and what compiles for it."""
    cpu = llvmlite.binding.get_host_cpu_name()
    return f"{platform.machine()} {cpu}, numba {numba.__version__}, numpy {np.__version__}"


def content_hash() -> str:
    """SHA-256 of what all golden files say of results; formats, machines and digests do not count."""
    parts: dict[str, np.ndarray] = {}
    for name in NAMES:
        record = load_record(RECORDS / f"{name}.npz")
        parts |= {f"{name}.{field}": getattr(record, field) for field in ("commands", "scan_s", "scan_robot")}
        parts |= {f"{name}.{field}": value for field, value in sorted(load_summary(name)[0].items())}
    return named_digest(parts)


def renew() -> None:
    """Run all golden missions again, replace their files and print the hash for RENEWALS.txt."""
    for name in NAMES:
        record, missions = run_again(load_record(RECORDS / f"{name}.npz"))
        save_record(record, RECORDS / f"{name}.npz")
        summary = {**summary_of(missions), "machine": np.asarray(this_machine())}
        np.savez_compressed(RECORDS / f"{name}.summary.npz", **summary)  # type: ignore[arg-type]
    print(content_hash())


if __name__ == "__main__":
    renew()
