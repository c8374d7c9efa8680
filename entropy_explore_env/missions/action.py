"""Actions and viewpoints: the same viewpoint can be written as an action, and read back from it.

A viewpoint is (x, y, z, yaw, pitch): map frame, metres, radians, pitch downwards.

Continuous, Box(-1, 1): displacement in shares of the reach (x, y, z; planar robots x, y), yaw/π
and, unless the whole team looks level, pitch/(π/2). A displacement longer than the reach is shortened to
it. Where the reach is infinite, the first numbers are a place in the workspace instead: along each axis -1
is the centre of the first voxel and 1 that of the last.

Discrete: number m·D + g means move m of `discrete_moves` (a voxel offset from the robot's voxel, to
that voxel's centre) and gaze g of the D in `gaze_set`.

Candidates: the number of one of the viewpoints that were proposed to the robot when it began to decide
(`planner`); that of one that does not exist means the first, the planner's own choice.

All robots of a team have the same actions. Where only some fly, the numbers for height and pitch mean
nothing to the others; a discrete move beyond a robot's own reach is shortened to it.
"""

from __future__ import annotations

import math

import numpy as np
from gymnasium import spaces

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.errors import ActionError
from entropy_explore_env.missions.rules import Rules, action_count, rules_of
from entropy_explore_env.settings.scenario import Scenario

ROUNDING = 1e-6
"""A displacement may exceed the reach by this share: the rounding of float32 actions."""


def action_space(scenario: Scenario) -> spaces.Box | spaces.Discrete:
    """Return a new space object of one robot's action."""
    if scenario.action.kind == "continuous":
        return spaces.Box(-1.0, 1.0, (3 if scenario.planar else 5,), np.float32)
    return spaces.Discrete(action_count(scenario, rules_of(scenario)))


@lean_kernel
def decode_action(params, actions, pose, continuous, discrete, viewpoint):
    """Turn an action into a viewpoint.

    Args:
        pose: (5,) float64, its pose.
        continuous: (N,) float64 action; where a candidate was chosen, (5,) its viewpoint; not read where
            actions are discrete.
        discrete: Number of the action; not read where actions are continuous.
        viewpoint: (5,) float64, filled in; within reach of the pose.
    """
    axes = 2 if params.planar else 3
    for i in range(5):
        viewpoint[i] = pose[i]
    if params.discrete:
        move, gaze = (
            actions.moves[discrete // len(actions.gazes)],
            actions.gazes[discrete % len(actions.gazes)],
        )
        for axis in range(axes):
            voxel = math.floor((pose[axis] - params.origin_m[axis]) / params.voxel_size_m) + move[axis]
            viewpoint[axis] = params.origin_m[axis] + (voxel + 0.5) * params.voxel_size_m
        viewpoint[3], viewpoint[4] = gaze[0], 0.0 if params.level else gaze[1]
    elif params.proposed:
        for axis in range(axes):
            viewpoint[axis] = continuous[axis]
        viewpoint[3], viewpoint[4] = continuous[3], 0.0 if params.level else continuous[4]
    else:
        for axis in range(axes):
            if math.isinf(params.reach_m):
                share = 0.5 * (continuous[axis] + 1.0)
                voxels = 0.5 + share * (params.size[axis] - 1)
                viewpoint[axis] = params.origin_m[axis] + voxels * params.voxel_size_m
            else:
                viewpoint[axis] = pose[axis] + continuous[axis] * params.reach_m
        viewpoint[3] = continuous[params.action_axes] * math.pi
        viewpoint[4] = 0.0 if params.level else continuous[params.action_axes + 1] * math.pi / 2.0
    if not math.isinf(params.reach_m):
        length = 0.0
        for axis in range(axes):
            length += (viewpoint[axis] - pose[axis]) ** 2
        length = math.sqrt(length)
        if length > params.reach_m * (1.0 + ROUNDING):
            for axis in range(axes):
                viewpoint[axis] = pose[axis] + (viewpoint[axis] - pose[axis]) * params.reach_m / length


def encode_viewpoint(
    rules: Rules,
    pose: np.ndarray,
    viewpoint: np.ndarray,
    robot: int = 0,
    candidates: np.ndarray | None = None,
) -> np.ndarray | np.int64:
    """Return the action that sends a robot to a viewpoint.

    Continuous actions hold it up to float32 rounding; a place beyond the reach is pulled onto it.
    Discrete actions hold it exactly if it is the centre of a voxel within reach with a gaze of the
    set; otherwise the nearest move and the nearest gaze are taken. Of candidates the nearest one is taken,
    by voxel edges and radians.

    Args:
        rules: The scenario.
        pose: (5,) the robot's pose.
        viewpoint: (5,) x, y, z, yaw, pitch.
        candidates: (K, 5) viewpoints that were proposed to it, where actions are their numbers.

    Returns:
        (N,) float32, or an int64; 0 where nothing is proposed.

    Raises:
        ActionError: The viewpoint has the wrong shape or is not finite.
    """
    try:
        wanted = np.asarray(viewpoint)
    except Exception:  # lists of different lengths, or an __array__ of somebody else's
        wanted = np.asarray(None)
    if wanted.shape != (5,) or wanted.dtype.kind not in "fiu" or not np.isfinite(wanted).all():
        raise ActionError("viewpoint", viewpoint, "five finite numbers (x, y, z, yaw, pitch)")
    wanted = wanted.astype(np.float64)
    settings = rules.params[robot]
    axes = 2 if settings["planar"] else 3
    if settings["proposed"]:
        return _nearest_candidate(settings, wanted, candidates)
    if not settings["discrete"]:
        return _encoded_box(settings, pose, wanted, axes)
    corner = np.floor((pose[:axes] - settings["origin_m"][:axes]) / settings["voxel_size_m"])
    lengths = np.linalg.norm(rules.actions.moves, axis=1) * settings["voxel_size_m"]  # the nearest come first
    moves = rules.actions.moves[lengths <= settings["reach_m"] + 1e-9 * settings["voxel_size_m"], :axes]
    ends = settings["origin_m"][:axes] + (corner + moves + 0.5) * settings["voxel_size_m"]
    move = int(np.argmin(((ends - wanted[:axes]) ** 2).sum(axis=1)))
    pitches = settings["pitches"]
    if settings["level"]:
        yaws = rules.actions.gazes[::pitches, 0]
        gaze = int(np.argmax(np.cos(yaws - wanted[3]))) * pitches + (pitches - 1) // 2
    else:
        yaw, pitch = rules.actions.gazes[:, 0], rules.actions.gazes[:, 1]
        toward = math.cos(wanted[4])
        alike = np.cos(pitch) * toward * np.cos(yaw - wanted[3]) + np.sin(pitch) * math.sin(wanted[4])
        gaze = int(np.argmax(alike))
    return np.int64(move * len(rules.actions.gazes) + gaze)


def _nearest_candidate(settings: np.void, wanted: np.ndarray, candidates: np.ndarray | None) -> np.int64:
    """Return the number of the candidate that is nearest to a viewpoint."""
    if candidates is None or len(candidates) == 0:
        return np.int64(0)
    places = np.linalg.norm(candidates[:, :3] - wanted[:3], axis=1) / settings["voxel_size_m"]
    turns = np.abs((candidates[:, 3] - wanted[3] + math.pi) % (2.0 * math.pi) - math.pi)
    return np.int64(np.argmin(places + turns + np.abs(candidates[:, 4] - wanted[4])))


def _encoded_box(settings: np.void, pose: np.ndarray, wanted: np.ndarray, axes: int) -> np.ndarray:
    """Return the continuous action for a viewpoint."""
    if math.isinf(settings["reach_m"]):
        last = np.maximum(settings["size"][:axes] - 1, 1) * settings["voxel_size_m"]
        move = (
            2.0 * (wanted[:axes] - settings["origin_m"][:axes] - 0.5 * settings["voxel_size_m"]) / last - 1.0
        )
    else:
        move = (wanted[:axes] - pose[:axes]) / settings["reach_m"]
        length = math.sqrt(float((move**2).sum()))
        if length > 1.0:
            move = move / length
    yaw = (wanted[3] + math.pi) % (2.0 * math.pi) - math.pi
    action = np.zeros(3 if settings["action_axes"] == 2 else 5)
    action[:axes], action[settings["action_axes"]] = move, yaw / math.pi
    if not settings["level"]:
        action[4] = wanted[4] / (math.pi / 2.0)
    return np.clip(action, -1.0, 1.0).astype(np.float32)
