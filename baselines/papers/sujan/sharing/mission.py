"""A mission, and what the map that its robot has at the end comes to as a summary."""

from __future__ import annotations

import zlib

import numpy as np

from baselines.experiments.mission import run_mission
from baselines.experiments.outcome import Record
from baselines.strategies import make_strategy
from entropy_explore_env.belief.map_update import PRIOR_MEAN
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.robots.map_summary import decode_map, encode_map, tree_bits

THRESHOLDS_BITS = (0.0, 0.25, 0.5, 1.0, 2.0, 5.0)
"""Most information content of a region that becomes one leaf."""
_BITS_PER_VOXEL = 64
"""Of a full map: mean and precision, float32 each."""


def record_summaries(env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
    """Run the mission, and summarise the map of its first robot.

    Returns:
        `full_bits`; `full_packed_bits`, of the same by zlib; `measured`, how many voxels are; and of each
        threshold `tree_bits`, `packed_bits`, `rms_error` of the mean coverage of measured voxels, and
        `wrong`, the share of them that the summary says free and the map covered, or the other way round.
    """
    run_mission(env, make_strategy(strategy), seed)
    view = view_of(env.missions, 0, 0)
    prior = np.float32(view.scenario.sigma_prior**-2)
    measured = view.precision > prior
    mean = np.where(measured, view.mean, np.float32(PRIOR_MEAN))
    precision = np.where(measured, view.precision - prior, np.float32(0.0))
    record: Record = {
        "full_bits": _BITS_PER_VOXEL * mean.size,
        "full_packed_bits": 8 * len(zlib.compress(mean.tobytes() + precision.tobytes())),
        "measured": int(measured.sum()),
        "tree_bits": [],
        "packed_bits": [],
        "rms_error": [],
        "wrong": [],
    }
    for threshold in THRESHOLDS_BITS:
        data = encode_map(mean, precision, threshold)
        said = decode_map(data, mean.shape).mean[measured]
        held = mean[measured]
        record["tree_bits"].append(tree_bits(data, mean.shape))
        record["packed_bits"].append(8 * len(data))
        record["rms_error"].append(round(float(np.sqrt(((said - held) ** 2).mean())), 6))
        flipped = (said > STOP_AT_COVERED) != (held > STOP_AT_COVERED)
        record["wrong"].append(round(float(flipped.mean()), 6))
    return record
