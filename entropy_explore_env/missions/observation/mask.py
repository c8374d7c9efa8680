"""The part `action_mask`: which discrete actions make sense by the robot's own belief."""

from __future__ import annotations

import math

from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.action import ROUNDING
from entropy_explore_env.missions.localization import believed_pose, estimate_in
from entropy_explore_env.missions.poses import pose_at, within_grid


@lean_kernel
def write_mask(params, actions, start, mean, out):
    """Mark the discrete actions that make sense by the robot's own belief.

    A move makes sense if it ends inside the workspace, within reach, in a voxel that is not
    believed covered; to stay always does. Planar robots have no use for moves up and down, nor, if they look
    level, for more than one of the gazes of a yaw.

    Args:
        out: (K·D,) filled with 0 and 1.
    """
    gazes = len(actions.gazes)
    for move in range(len(actions.moves)):
        inside, voxel, apart = True, 0, 0.0
        for axis in range(3):
            index = math.floor(start[axis]) + actions.moves[move, axis]
            inside = inside and 0 <= index < params.size[axis]
            voxel = voxel * params.size[axis] + index
            if axis < 2 or not params.planar:
                apart += (index + 0.5 - start[axis]) ** 2
        near = math.sqrt(apart) * params.voxel_size_m <= params.reach_m * (1.0 + ROUNDING)
        near = near and not (params.planar and actions.moves[move, 2] != 0)
        sensible = move == 0 or (inside and near and mean[voxel] <= STOP_AT_COVERED)
        for gaze in range(gazes):
            level = gaze % params.pitches == (params.pitches - 1) // 2
            out[move * gazes + gaze] = 1 if sensible and (level or not params.level) else 0


@lean_kernel
def observe_mask(begin, params, actions, start, mean, row):
    """Fill (K·D,): the mask as part of an observation."""
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    write_mask(params, actions, start, mean, row[begin:])


@lean_kernel
def mask_missions(params, actions, missions, robots, estimates, mean, out):
    """Fill (E, A, N) int8, the masks of all robots' discrete actions."""
    for mission in range(out.shape[0]):
        for robot in range(out.shape[1]):
            own = params[robot]
            pose = pose_at(own, robots[mission, robot], missions[mission].time_s)
            start = within_grid(own, believed_pose(estimate_in(estimates, mission, robot), own, pose))
            write_mask(own, actions, start, mean[mission, robot], out[mission, robot])
