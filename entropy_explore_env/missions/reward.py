"""The reward: bits gained in a step, as a share of all the bits that the mission asks for."""

from __future__ import annotations

from entropy_explore_env.compilation.kernels import lean_kernel


@lean_kernel
def reward_robots(robots, bits_to_gain, team, cost):
    """Reward one mission's robots for one step.

        individual: own / (H(0) - H_th) - cost
        team:       mean over robots of (own + received) / (H(0) - H_th) - cost

    Args:
        robots: (A,) ROBOT with `own_bits` and `received_bits` of the step; `reward` is filled in.
        bits_to_gain: H(0) - H_th.
        team: Which of the two.
        cost: Of the time that the step took, in shares.
    """
    shared = 0.0
    for robot in robots:
        shared += (robot.own_bits + robot.received_bits) / len(robots)
    for robot in robots:
        gained = shared if team else robot.own_bits
        robot.reward = gained / bits_to_gain - cost
