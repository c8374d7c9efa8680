"""The figures of one mission that tables, records and JSON objects show."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from entropy_explore_env.missions.faults import fault_counts
from entropy_explore_env.missions.localization import pose_errors
from entropy_explore_env.missions.records import COUNTED, SEEN_MARKS, MissionEnd
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.robots.range_sensor import (
    Return,
    Scene,
    SensorPose,
    new_scan,
    sensor_model,
    take_scan,
    true_coverage,
)
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.worlds.world import World

_FLOOR_SCANS = 256
_STEEPEST_RAD = math.pi / 4


def mission_figures(missions: Missions, mission: int, floor: bool | None = None) -> dict[str, Any]:
    """Return the figures of a mission.

    Entropies are those of the best-informed robot's map unless stated otherwise; counts are sums over the
    team; undefined figures are None.

    Args:
        missions: The missions.
        mission: Which.
        floor: Whether `scans_over_floor` is computed, which takes some milliseconds a world; None = only
            where the scenario tracks the truth.

    Returns:
        `scenario`, `world`, `robots`, `seed`, `finished`, `end_reason`; `ended_by`: whose maps were good
        enough, names of robots, or `["team"]` where what all have seen together was; `t_mission_s`, and
        `t50_s`, `t90_s`, `t99_s`: when the best map had lost that share of the bits that the mission asks
        for; `scans`, and `scans_over_floor`: over `information_floor`; `measurements`,
        `shared_measurements`, `overlap`:
        the share of measurements that added their own robot less than I_min; `bits_sent`,
        `bits_received`, `bits_gained_per_bit_sent`: taken from teammates' maps over sent;
        `messages_lost`; `entropy_start_bits`, `entropy_threshold_bits`, `entropy_end_bits`,
        `entropy_mean_bits` over the team; `balance`: the coefficient of variation of the bits that the
        robots gained themselves; `distance_m`, `blocked_moves`; `per_robot`: a list of the counts of
        each robot. If the scenario has faults, also `faults`: see `fault_counts`. If robots drift, also
        `localization`: see `localization_told`. If it tracks the truth, also `joint`: see `joint_figures`.
    """
    clock, robots = missions.state.missions[mission], missions.state.robots[mission]
    faults = missions.state.faults[mission]
    end, world = missions.over(mission), missions.worlds[mission]
    scans, sent = int(robots["scans"].sum()), int(robots["bits_sent"].sum())
    measurements, gained = int(robots["measurements"].sum()), robots["gained_bits"]
    wanted = missions.scenario.track_truth if floor is None else floor
    least = information_floor(missions.scenario, world) if wanted and world is not None else None
    return {
        "scenario": missions.scenario.name,
        "world": missions.scenario.world if world is None else world.name,
        "robots": missions.scenario.robots,
        "seed": missions.seeds[mission],
        "finished": end.reached_goal,
        "end_reason": end.name,
        "ended_by": _ended_by(missions, mission),
        "t_mission_s": float(clock["time_s"]),
        **{f"t{mark}_s": _reached(clock, place) for place, mark in enumerate((50, 90, 99))},
        "scans": scans,
        "scans_over_floor": None if least is None or math.isinf(least) else scans / least,
        "measurements": measurements,
        "shared_measurements": int(robots["measurements_sent"].sum()),
        "overlap": int(robots["redundant"].sum()) / measurements if measurements else None,
        "bits_sent": sent,
        "bits_received": int(robots["bits_received"].sum()),
        "bits_gained_per_bit_sent": float(robots["heard_bits"].sum()) / sent if sent else None,
        "messages_lost": int(robots["messages_lost"].sum()),
        "entropy_start_bits": float(clock["entropy_start_bits"]),
        "entropy_threshold_bits": float(clock["entropy_end_bits"]),
        "entropy_end_bits": float(robots["entropy_bits"].min()),
        "entropy_mean_bits": float(robots["entropy_bits"].mean()),
        "balance": float(gained.std() / gained.mean()) if gained.any() else None,
        "distance_m": float(robots["distance_m"].sum()),
        "blocked_moves": int(robots["blocked_moves"].sum()),
        **({"faults": fault_counts(faults)} if len(faults) else {}),
        **({"localization": localization_told(missions, mission)} if missions.scenario.drifts else {}),
        **({"joint": joint_figures(missions, mission)} if missions.scenario.track_truth else {}),
        "per_robot": [{name: robot[name].item() for name in COUNTED} for robot in robots],
    }


def _ended_by(missions: Missions, mission: int) -> list[str]:
    """Return whose maps were good enough when the mission reached its goal; empty where it did not."""
    end, scenario, faults = missions.over(mission), missions.scenario, missions.state.faults[mission]
    if not end.reached_goal:
        return []
    if end is MissionEnd.MAPPED:
        left_bits = missions.state.robots[mission]["entropy_bits"]
        passed = left_bits <= missions.state.missions[mission]["entropy_end_bits"]
    elif scenario.ending.termination in ("any", "all"):
        return ["team"]
    else:
        passed = _holding(missions, mission)
        if len(faults):
            passed &= ~(faults["stopped"] & np.isinf(faults["stop_until_s"]))
    return [name for name, own in zip(scenario.agents, passed, strict=True) if own]


def _holding(missions: Missions, mission: int) -> np.ndarray:
    """Return (A,) whether each robot's own map holds what ends a mission by what was seen."""
    state, clock = missions.state, missions.state.missions[mission]
    held = state.precision[mission] > missions.rules.params["prior_precision"][0]
    seen = (held & state.visible[mission]).sum(axis=-1)
    free = (held & state.visible[mission] & (state.truth[mission] <= 0.5)).sum(axis=-1)
    return (seen >= clock["explored_end"]) & (free >= clock["explored_free_end"])


def localization_told(missions: Missions, mission: int) -> dict[str, float | int | None]:
    """Return how wrong a mission's robots were about their poses, for tables and records.

    Returns:
        `rms_error_m` and `rms_error_rad`, root mean square over all scans: None before the first one;
        `mean_error_m` and `mean_error_rad` of the robots at last; `sightings` of fiducials. Where robots keep
        landmarks of their own maps, also `own_sightings` of those that they still keep, after the scans that
        chose them.
    """
    robots, estimates = missions.state.robots[mission], missions.state.estimates[mission]
    scans, errors = int(robots["scans"].sum()), pose_errors(estimates)
    squares = (float(estimates["squared_m2"].sum()), float(estimates["squared_rad2"].sum()))
    rms_m, rms_rad = (math.sqrt(total / scans) if scans else None for total in squares)
    told = {
        "rms_error_m": rms_m,
        "rms_error_rad": rms_rad,
        "mean_error_m": sum(off_m for off_m, _ in errors) / len(errors),
        "mean_error_rad": sum(off_rad for _, off_rad in errors) / len(errors),
        "sightings": int(estimates["sightings"].sum()),
    }
    landmarks = missions.state.landmarks[mission]
    if landmarks.size:
        told["own_sightings"] = int(landmarks["sightings"][landmarks["used"]].sum())
    return told


def _reached(clock: np.void, place: int) -> float | None:
    """Return the time at which one of the shares in PROGRESS was reached; None = it was not."""
    time_s = float(clock["reached_s"][place])
    return None if time_s < 0.0 else time_s


def joint_figures(missions: Missions, mission: int) -> dict[str, float | int | None]:
    """Return the map that fuses all measurements of the team, compared with the truth.

    Returns:
        `entropy_bits`; `explored`: share of the voxels that robots can observe at all that were
        measured; `error`: mean |expected - true coverage| over the measured voxels; `wrong`: share of
        them on the wrong side of ½; None where nothing was measured. `unseen_free_voxels`: those that can be
        observed and were not measured; `driven_m`: what the team has driven up to now. `t50_seen_s` and
        `path50_seen_m`, also for 90, 95, 99 and 100: time, and what the team had driven, when that
        percentage of the voxels that can be observed was measured; None = it was not.
    """
    clock, explored = missions.state.missions[mission], int(missions.state.missions[mission]["explored"])
    marks: dict[str, float | int | None] = {}
    for place, share in enumerate(SEEN_MARKS):
        seen = clock["seen_s"][place] >= 0.0
        marks[f"t{round(100 * share)}_seen_s"] = float(clock["seen_s"][place]) if seen else None
        marks[f"path{round(100 * share)}_seen_m"] = float(clock["seen_m"][place]) if seen else None
    return {
        "entropy_bits": float(clock["joint_bits"]),
        "explored": int(clock["explored_visible"]) / int(clock["visible"]),
        "error": float(clock["error"]) / explored if explored else None,
        "wrong": int(clock["wrong"]) / explored if explored else None,
        "unseen_free_voxels": int(clock["visible_free"]) - int(clock["explored_free"]),
        "driven_m": float(missions.state.robots[mission]["distance_m"].sum()),
        **marks,
    }


@lru_cache(maxsize=8)
def information_floor(scenario: Scenario, world: World) -> float:
    """Return the least number of scans that map the world: the precision needed over that of one scan.

    A voxel needs 1/σ_end² - 1/σ_prior² of precision; a ray adds 1/σ(d)² to each voxel that it crosses
    (Rocha04, eqs. 5 and 17). One scan is taken to add as much as the best of 256 scans from random voxels
    where robots may start, in random directions up to 45° up or down. Measuring a voxel more often than
    needed, which no team can avoid, is not taken into account. inf = none of them measured anything.

    Args:
        scenario: The task.
        world: The true world.
    """
    added = max(_most_added(scenario, kind, world) for kind in scenario.kinds)
    needed = scenario.ending.sigma_end**-2 - scenario.sigma_prior**-2
    return max(world.visible_voxels(scenario) * needed / added, 1.0) if added > 0.0 else math.inf


def _most_added(scenario: Scenario, kind: RobotKind, world: World) -> float:
    """Return the precision, summed over all voxels, that the best of some scans of a kind of robot adds."""
    rng, grid, sensor = np.random.default_rng(0), world.grid, kind.sensor
    layout, model = world.layout(scenario, kind), sensor_model(sensor)
    scan, rng_state = new_scan(grid, [sensor], sensor.rays), np.zeros(1, np.uint64)
    truth, added = true_coverage(world.occupied, world.unreadable), 0.0
    scene = Scene(truth, grid.shape, grid.voxel_size_m, np.zeros((0, 4)))
    voxels = np.stack(np.unravel_index(rng.choice(layout.starts, _FLOOR_SCANS), grid.shape), axis=-1)
    steepest = 0.0 if scenario.looks_level(kind.robot) else _STEEPEST_RAD
    for voxel in voxels + 0.5:
        start, yaw = tuple(voxel.tolist()), rng.uniform(-math.pi, math.pi)
        pitch = rng.uniform(-steepest, steepest)
        take_scan(scan, model, scene, SensorPose(start, yaw, pitch), rng_state)
        measured = scan.rays["returned"] != int(Return.NOTHING)
        added = max(added, float((scan.rays["voxels"] * scan.rays["precision"])[measured].sum()))
    return added
