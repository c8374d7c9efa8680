"""Actions and viewpoints: what is written as an action is read back from it."""

import math

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.missions.action import ROUNDING as PULLED_IN_BEYOND
from entropy_explore_env.missions.action import action_space, decode_action, encode_viewpoint
from entropy_explore_env.missions.observation.mask import write_mask
from entropy_explore_env.missions.rules import discrete_moves, rules_of
from entropy_explore_env.settings.grid import Grid
from tests.reference.scenes import drawn, free_box, seeds

ODD_GRID = Grid((7, 11, 5), 0.3, (-1.7, 0.4, 2.05))
ROUNDING = 2.0**-22
"""A few times the rounding of float32 numbers up to 1."""


def decode(rules, pose, action):
    viewpoint = np.full(5, np.nan)
    pose = np.asarray(pose, np.float64)
    if np.ndim(action) == 0:
        continuous, discrete = np.zeros(5), int(action)
    else:
        continuous, discrete = np.asarray(action).astype(np.float64), 0
    decode_action(rules.params[0], rules.actions, pose, continuous, discrete, viewpoint)
    return viewpoint


def a_pose(grid, rng, planar=False):
    place = np.asarray(grid.origin_m) + rng.uniform(0.05, 0.95, 3) * grid.size_m
    return np.array([*place, rng.uniform(-3, 3), 0.0 if planar else rng.uniform(-1.5, 1.5)])


@drawn(100)
@given(seeds, st.sampled_from(["free", "planar"]), st.sampled_from([0.4, 1.0, math.inf]))
def test_continuous_actions_hold_a_viewpoint_up_to_rounding(seed, motion, reach_m):
    rng = np.random.default_rng(seed)
    robot = {"motion": motion, "reach_m": reach_m}
    scenario = free_box(grid=ODD_GRID, robot=robot)
    rules, planar = rules_of(scenario), motion == "planar"
    pose, wanted = a_pose(ODD_GRID, rng, planar), a_pose(ODD_GRID, rng, planar)
    if planar:
        wanted[2] = pose[2]
    if math.isfinite(reach_m):
        move = wanted[:3] - pose[:3]
        wanted[:3] = pose[:3] + move / np.linalg.norm(move) * rng.uniform(0.0, reach_m)
    else:  # from the centre of the first voxel to that of the last
        low, half = np.asarray(ODD_GRID.origin_m), 0.5 * ODD_GRID.voxel_size_m
        axes = slice(0, 2 if planar else 3)
        wanted[axes] = np.clip(wanted[:3], low + half, low + ODD_GRID.size_m - half)[axes]
    wanted[3] = rng.choice([rng.uniform(-math.pi, math.pi), -math.pi, math.pi, 0.0])
    wanted[4] = (
        0.0 if planar else rng.choice([rng.uniform(-math.pi / 2, math.pi / 2), math.pi / 2, -math.pi / 2])
    )
    action = encode_viewpoint(rules, pose, wanted)
    assert action_space(scenario).contains(action)
    got = decode(rules, pose, action)
    scale = reach_m if math.isfinite(reach_m) else ODD_GRID.size_m.max()
    np.testing.assert_allclose(got[:3], wanted[:3], rtol=0, atol=scale * ROUNDING)
    turn = (got[3] - wanted[3] + math.pi) % (2 * math.pi) - math.pi
    assert abs(turn) < math.pi * ROUNDING
    assert got[4] == pytest.approx(wanted[4], abs=math.pi * ROUNDING)


@drawn(60)
@given(seeds, st.sampled_from(["free", "planar"]))
def test_a_continuous_action_never_reaches_beyond_the_reach(seed, motion):
    rng = np.random.default_rng(seed)
    scenario = free_box(grid=ODD_GRID, robot={"motion": motion, "reach_m": 0.7})
    rules, space = rules_of(scenario), action_space(scenario)
    assert isinstance(space, spaces.Box)
    assert space.shape == ((3,) if motion == "planar" else (5,))
    pose = a_pose(ODD_GRID, rng, motion == "planar")
    for box in (np.sign(rng.uniform(-1, 1, space.shape)), rng.uniform(-1, 1, space.shape)):
        got = decode(rules, pose, box)
        driven, axes = got[:3] - pose[:3], len(box) - (1 if motion == "planar" else 2)
        assert np.linalg.norm(driven) <= 0.7 * (1 + 2e-6)
        along = driven[:axes] @ box[:axes]
        assert along == pytest.approx(
            np.linalg.norm(driven) * np.linalg.norm(box[:axes])
        )  # the same direction
        assert got[3] == pytest.approx(box[axes] * math.pi)
        if motion == "planar":
            assert (driven[2], got[4]) == (0.0, 0.0)
    # A viewpoint farther away is pulled onto the reach.
    wanted = pose + np.array([2.0, -1.0, 0.0, 0.0, 0.0])
    got = decode(rules, pose, encode_viewpoint(rules, pose, wanted))
    expected = pose[:2] + 0.7 * np.array([2.0, -1.0]) / math.sqrt(5)
    np.testing.assert_allclose(got[:2], expected, atol=1e-6)


def test_with_infinite_reach_an_action_is_a_place_from_the_first_voxel_s_centre_to_the_last_s():
    for grid in (ODD_GRID, Grid((7, 1, 5), 0.25)):
        rules = rules_of(free_box(grid=grid, robot={"reach_m": math.inf}))
        pose = np.array([0.0, 1.0, 3.0, 0.0, 0.0])
        for box, share in (
            ((-1, -1, -1), (0, 0, 0)),
            ((1, 1, 1), (1, 1, 1)),
            ((0, 0.5, -0.5), (0.5, 0.75, 0.25)),
        ):
            got = decode(rules, pose, np.array([*box, 0.5, -0.5]))
            expected = grid.centre_of(np.array(share) * (np.array(grid.shape) - 1))
            np.testing.assert_allclose(got[:3], expected)
            assert got[3:].tolist() == [math.pi / 2, -math.pi / 4]
            again = decode(rules, pose, encode_viewpoint(rules, pose, got))
            np.testing.assert_allclose(again[:3], expected, atol=1e-6)


@pytest.mark.parametrize("kind", ["continuous", "discrete"])
def test_rovers_keep_their_height_and_take_the_pitch(kind):
    """Their moves lie in the plane, though the team's actions have a number for it."""
    rover = {"motion": "planar", "tilts": True, "reach_m": 1.0, "sensor_height_m": 1.25}
    action = {"kind": kind, "yaws": 4, "pitches": 3}
    scenario = free_box(robots=1, robot=rover, action=action, observation={"panorama": False})
    rules, space, grid = rules_of(scenario), action_space(scenario), scenario.grid
    pose = np.array([*grid.centre_of(np.array([3, 5, 2])), 0.7, 0.3])
    wanted = np.array([pose[0] + 0.5, pose[1] - 0.5, 2.0, math.pi / 2, math.pi / 4])
    action = encode_viewpoint(rules, pose, wanted)
    assert space.contains(action)
    got = decode(rules, pose, action)
    assert got == pytest.approx([*wanted[:2], pose[2], math.pi / 2, math.pi / 4], abs=1e-6)
    if kind == "discrete":
        assert (rules.actions.moves[:, 2] == 0).all() and len(rules.actions.gazes) == 12


@pytest.mark.parametrize("motion", ["free", "planar"])
@pytest.mark.parametrize(
    "grid", [ODD_GRID, Grid((7, 11, 5), 0.25, (-0.125, -0.125, -0.125)), Grid((9, 6, 1), 0.1)]
)
def test_discrete_actions_hold_every_centre_within_reach_and_every_gaze_exactly(grid, motion):
    scenario = free_box(
        grid=grid,
        robot={
            "motion": motion,
            "reach_m": 2 * grid.voxel_size_m,
            "sensor_height_m": 0.5 * grid.voxel_size_m,
        },
        action={"kind": "discrete", "yaws": 5, "pitches": 2},
        observation={"panorama": False},
    )
    rules, space = rules_of(scenario), action_space(scenario)
    assert isinstance(space, spaces.Discrete)
    level = scenario.planar
    here = np.array([3, 4, 0])
    pose = np.array([*grid.centre_of(here), 0.7, 0.0])
    offsets = [np.array(index) - 2 for index in np.ndindex(5, 5, 1 if level else 5)]
    if level:
        offsets = [offset * [1, 1, 0] for offset in offsets]
    offsets = [offset for offset in offsets if np.linalg.norm(offset) <= 2]
    assert len(offsets) == (13 if level else 33)
    yaws = [0.0, 2 * math.pi / 5, 4 * math.pi / 5, -4 * math.pi / 5, -2 * math.pi / 5]
    pitches = [0.0] if level else [-math.pi / 4, math.pi / 4]
    numbers = set()
    for offset in offsets:
        for yaw in yaws:
            for pitch in pitches:
                wanted = np.array([*grid.centre_of(here + offset), yaw, pitch])
                number = encode_viewpoint(rules, pose, wanted)
                assert space.contains(number)
                got = decode(rules, pose, number)
                assert got[:3].tolist() == wanted[:3].tolist()
                assert got[3:] == pytest.approx([yaw, pitch], abs=1e-15)
                assert encode_viewpoint(rules, pose, got) == number
                numbers.add(int(number))
    assert numbers == set(range(int(space.n)))  # and there are no others


@pytest.mark.parametrize("motion", ["free", "planar"])
@pytest.mark.parametrize("reach_m", [0.5, 1.2, 3.0, 300.0])
def test_moves_along_the_axes_are_those_of_all_moves_that_reach_farthest(motion, reach_m):
    """The slow way: out of all moves. The box is shorter than 300 m."""
    robot, axes = {"motion": motion, "reach_m": min(reach_m, 5.5)}, 2 if motion == "planar" else 3
    every = discrete_moves(free_box(robot=robot, action={"kind": "discrete", "yaws": 1, "pitches": 1}))
    along = every[(every != 0).sum(axis=1) <= 1]
    farthest = np.abs(along).max(axis=0)
    slow = [
        move for move in along.tolist() if all(abs(m) in (0, f) for m, f in zip(move, farthest, strict=True))
    ]
    fast = free_box(robot={**robot, "reach_m": reach_m}, action={"kind": "discrete", "moves": "axes"})
    assert discrete_moves(fast).tolist() == slow and len(slow) == 1 + 2 * axes


@drawn(60)
@given(seeds)
def test_a_viewpoint_that_no_discrete_action_holds_goes_to_the_nearest(seed):
    rng = np.random.default_rng(seed)
    scenario = free_box(action={"kind": "discrete", "yaws": 16, "pitches": 3})
    rules, grid = rules_of(scenario), scenario.grid
    pose = np.array([*grid.centre_of(np.array([3, 5, 2])), 0.0, 0.0])
    wanted = pose + np.array([*rng.uniform(-0.8, 0.8, 3), 0.0, 0.0])
    wanted[3:] = rng.uniform(-math.pi, math.pi), rng.uniform(-1.0, 1.0)
    got = decode(rules, pose, encode_viewpoint(rules, pose, wanted))
    steps = np.array([index for index in np.ndindex(5, 5, 5) if np.linalg.norm(np.array(index) - 2) <= 2]) - 2
    ends = grid.centre_of(np.array([3, 5, 2]) + steps)
    nearest = np.linalg.norm(ends - wanted[:3], axis=1).min()
    assert np.linalg.norm(got[:3] - wanted[:3]) == pytest.approx(nearest)

    def direction(yaw, pitch):
        return np.array([math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch)])

    gazes = [(2 * math.pi * y / 16, p) for y in range(16) for p in (-math.pi / 4, 0.0, math.pi / 4)]
    closest = max(direction(*gaze) @ direction(*wanted[3:]) for gaze in gazes)
    assert direction(*got[3:]) @ direction(*wanted[3:]) == pytest.approx(closest)


def test_a_discrete_move_from_anywhere_in_a_voxel_goes_to_a_centre_but_not_beyond_reach():
    scenario = free_box(action={"kind": "discrete", "yaws": 4, "pitches": 1})  # 0.5 m voxels, 1 m reach
    rules, grid = rules_of(scenario), scenario.grid
    stay = decode(rules, [1.55, 2.6, 1.45, 1.0, 0.5], 0)
    assert stay.tolist() == [1.75, 2.75, 1.25, 0.0, 0.0]
    pose = np.array([1.55, 2.75, 1.25, 0.0, 0.0])
    centre = np.array([*grid.centre_of(np.array([5, 5, 2])), 0.0, 0.0])  # 1.2 m ahead
    got = decode(rules, pose, encode_viewpoint(rules, pose, centre))
    assert got[:3] == pytest.approx([2.55, 2.75, 1.25])


def test_a_viewpoint_beyond_reach_by_more_than_rounding_is_pulled_in():
    rules, farthest = rules_of(free_box(robot={"reach_m": 1.0})), 1.0 + PULLED_IN_BEYOND
    assert decode(rules, np.zeros(5), [farthest, 0.0, 0.0, 0.0, 0.0])[0] == farthest
    beyond = np.nextafter(farthest, 2.0)
    assert decode(rules, np.zeros(5), [0.0, beyond, 0.0, 0.0, 0.0])[1] == pytest.approx(1.0, abs=1e-12)


@drawn(40)
@given(seeds, st.sampled_from(["free", "planar"]))
def test_the_mask_marks_moves_to_voxels_inside_within_reach_and_not_believed_covered(seed, motion):
    rng = np.random.default_rng(seed)
    scenario = free_box(
        robot={"motion": motion, "reach_m": 1.0, "sensor_height_m": 1.2},
        action={"kind": "discrete", "yaws": 3, "pitches": 2},
    )
    rules, grid = rules_of(scenario), scenario.grid
    gazes = 3 if motion == "planar" else 6
    mean = rng.choice(np.array([0.0, 0.5, 0.51, 1.0], np.float32), grid.shape)
    start = np.array([rng.uniform(0, n) for n in grid.shape])
    mask = np.full(len(rules.actions.moves) * gazes, 7, np.float32)
    write_mask(rules.params[0], rules.actions, tuple(start.tolist()), mean.ravel(), mask)
    pose = np.array([*start * 0.5, 0.0, 0.0])
    for move, marks in enumerate(mask.reshape(-1, gazes)):
        voxel = np.floor(start).astype(int) + rules.actions.moves[move]
        inside = (voxel >= 0).all() and (voxel < grid.shape).all()
        offset = (voxel + 0.5 - start) * 0.5
        if motion == "planar":
            offset[2] = 0.0
        near = np.linalg.norm(offset) <= 1.0 + 1e-6
        sensible = move == 0 or bool(inside and near and mean[tuple(voxel)] <= 0.5)
        assert marks.tolist() == [float(sensible)] * gazes
        if sensible and move > 0:  # … and it leads to that voxel's centre
            got = decode(rules, pose, move * gazes)
            assert np.floor(got[:3] / 0.5).tolist() == voxel.tolist()
    assert (rules.actions.moves[0] == 0).all()
