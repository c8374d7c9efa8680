"""True worlds: where bodies fit, where robots may start, what can be seen at all."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.worlds.world import Collision, World, no_fly_mask
from tests.reference.scenes import drawn, flood, free_box, random_cover, seeds

SIZE = (7, 11, 5)
STEPS = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]


def world_of(occupied, voxel_size_m=0.5):
    return World(Grid(occupied.shape, voxel_size_m), occupied, "by hand")


def parts_of(room):
    left, parts = {tuple(voxel) for voxel in np.argwhere(room).tolist()}, []
    while left:
        parts.append(flood(room, min(left)))
        left -= parts[-1]
    return parts


def body_hits(occupied, voxel, radius):
    """Whether a ball in a voxel's centre meets a solid voxel or the boundary; edges of 1."""
    centre = np.array(voxel) + 0.5
    flat = occupied.shape[2] == 1
    axes = 2 if flat else 3
    walls = np.minimum(centre, np.array(occupied.shape) - centre)[:axes]
    gaps = [
        np.linalg.norm(np.maximum(np.abs(np.array(solid) + 0.5 - centre) - 0.5, 0.0)[:axes])
        for solid in np.argwhere(occupied)
    ]
    return occupied[voxel] or walls.min() < radius - 1e-9 or min(gaps, default=math.inf) < radius - 1e-9


@drawn(40)
@given(
    seeds,
    st.sampled_from([SIZE, (3, 8, 6), (9, 6, 1)]),
    st.sampled_from([0.0, 0.1, 0.25, 0.3, 0.5, 0.6, 0.75, 0.8, 1.1]),
)
def test_a_body_fits_where_it_meets_nothing_solid(seed, size, body_radius_m):
    occupied = random_cover(size, 0.06, seed) > 0.5
    blocked = world_of(occupied).collision_mask(body_radius_m) > 0
    expected = np.zeros(size, bool)
    for voxel in np.ndindex(*size):
        expected[voxel] = body_hits(occupied, voxel, body_radius_m / 0.5)
    np.testing.assert_array_equal(blocked, expected)


@drawn(40)
@given(seeds, st.sampled_from([SIZE, (3, 8, 6), (9, 6, 1)]), st.sampled_from([0.1, 0.4]), st.integers(0, 1))
def test_starts_are_the_largest_component_and_all_that_is_connected_to_it_is_visible(
    seed, size, body_radius_m, behind
):
    occupied = random_cover(size, 0.35, seed) > 0.5
    world = world_of(occupied)
    room = world.collision_mask(body_radius_m) == Collision.NONE
    scenario = free_box(
        grid=world.grid, robot={"body_radius_m": body_radius_m}, sensor={"voxels_behind": behind}
    )
    if not room.any():
        with pytest.raises(WorldError, match="room for a body"):
            world.layout(scenario)
        return
    layout = world.layout(scenario)
    starts = {tuple(int(n) for n in np.unravel_index(index, size)) for index in layout.starts}
    parts = parts_of(room)
    assert starts in parts
    assert len(starts) == max(len(part) for part in parts)
    free = [part for part in parts_of(~occupied) if part & starts]
    seen = set().union(*free)
    skin = {
        tuple(voxel)
        for voxel in np.argwhere(occupied).tolist()
        if any(tuple(np.add(voxel, step).tolist()) in seen for step in STEPS)
    }
    assert layout.visible_voxels == len(seen) + behind * len(skin)
    assert world.layout(scenario) is layout


def divided_room():
    """A wall at x = 2 leaves 2 and 4 layers; in the larger part a closed chest with a hollow in it."""
    occupied = np.zeros(SIZE, bool)
    occupied[2] = True
    occupied[4:7, 4:7, 0:3] = True
    occupied[5, 5, 1] = False
    return occupied


def test_a_divided_room_by_hand():
    world = world_of(divided_room())
    layout = world.layout(free_box(grid=world.grid))
    starts = np.zeros(SIZE, bool)
    starts.ravel()[layout.starts] = True
    assert starts[3:].sum() == starts.sum() == 4 * 55 - 27
    assert not starts[5, 5, 1]
    # Seen from there: the part itself, the wall at x = 2, and of the chest's 26 solid voxels the
    # outer ones: of its 3 × 3 × 3 all but the hollow, (6, 5, 0), (5, 5, 0) and (5, 6, 0)… by faces:
    free_faces = sum(
        any(
            0 <= x + dx < 7 and 0 <= y + dy < 11 and 0 <= z + dz < 5 and starts[x + dx, y + dy, z + dz]
            for dx, dy, dz in STEPS
        )
        for x, y, z in np.argwhere(divided_room()).tolist()
    )
    assert layout.visible_voxels == starts.sum() + free_faces
    assert layout.visible_voxels < 4 * 55 + 55
    blind = free_box(grid=world.grid, sensor={"voxels_behind": 0})
    assert world.layout(blind).visible_voxels == starts.sum()


def test_planar_robots_start_in_their_plane():
    world = world_of(divided_room())
    planar = free_box(grid=world.grid, robot={"motion": "planar", "sensor_height_m": 1.2})
    assert planar.layer_of(planar.robot) == 2
    starts = np.stack(np.unravel_index(world.layout(planar).starts, SIZE), axis=-1)
    assert (starts[:, 2] == 2).all()
    assert len(starts) == 4 * 11 - 9
    assert free_box().layer_of(Robot()) is None
    assert free_box(grid=Grid((9, 6, 1), 0.5)).layer_of(Robot()) == 0
    on_edge = Robot(motion="planar", sensor_height_m=0.3)
    assert free_box(grid=Grid((9, 6, 5), 0.1)).layer_of(on_edge) == 3  # 0.3 / 0.1 is less in binary
    low = free_box(grid=world.grid, robot={"motion": "planar", "sensor_height_m": 0.2, "body_radius_m": 0.4})
    with pytest.raises(WorldError, match=r"at the height of the sensor, .* --robot\.sensor-height-m"):
        world.layout(low)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"grid": SIZE}, r"World\.grid"),
        ({"occupied": [[[False]]]}, "a NumPy array"),
        ({"occupied": np.zeros(SIZE, np.uint8)}, r"\(7, 11, 5\) bool"),
        ({"occupied": np.zeros((11, 7, 5), bool)}, r"\(7, 11, 5\) bool"),
        ({"occupied": np.ones(SIZE, bool)}, "free voxel"),
        ({"name": None}, r"World\.name"),
        ({"ceiling": np.full(SIZE[:2], 6, np.int32)}, "layers from 0 to 5"),
        ({"ceiling": np.full(SIZE[:2], -1, np.int32)}, "layers from 0 to 5"),
        ({"ceiling": np.zeros(SIZE[:2])}, "int32"),
    ],
)
def test_what_is_no_world_is_refused(changes, said):
    whole = {"grid": Grid(SIZE, 0.5), "occupied": np.zeros(SIZE, bool), "name": "by hand"}
    with pytest.raises(WorldError, match=said):
        World(**{**whole, **changes})


def terrain() -> World:
    """Ground up to layer 0, at x = 3 up to layer 2; closed from layer 4 on, over x = 5 from layer 2 on."""
    occupied = np.zeros(SIZE, bool)
    occupied[:, :, 0] = True
    occupied[3, :, :3] = True
    ceiling = np.full(SIZE[:2], 4, np.int32)
    ceiling[5] = 2
    return World(Grid(SIZE, 0.5), occupied, "terrain", ceiling=ceiling)


def test_between_ground_and_ceiling():
    world = terrain()
    columns = {
        0: [Collision.GROUND, Collision.NONE, Collision.NONE, Collision.NONE, Collision.CEILING],
        3: [Collision.GROUND, Collision.GROUND, Collision.GROUND, Collision.NONE, Collision.CEILING],
        5: [Collision.GROUND, Collision.NONE, Collision.CEILING, Collision.CEILING, Collision.CEILING],
    }
    small, large = world.collision_mask(0.1), world.collision_mask(0.3)  # 0.6 voxels: it meets the next ones
    for x, column in columns.items():
        assert small[x, 4].tolist() == column
    assert large[1, 4].tolist() == [2, 2, 0, 3, 3]
    assert large[5, 4].tolist() == [2, 2, 3, 3, 3]
    assert large[4, 4].tolist() == [2, 2, 2, 3, 3]  # beside the ridge; over it, beside the low ceiling
    layout = world.layout(free_box(grid=world.grid))
    assert len(layout.starts) == (small == Collision.NONE).sum() == 11 * (5 * 3 + 1 + 1)
    # Rays go above the ceiling: all free voxels can be seen, and the skin of the ground.
    skin = 11 * (7 + 1)  # the top of each column, and the ridge below its top
    assert layout.visible_voxels == (~world.occupied).sum() + skin


def test_robots_that_look_level_see_what_their_field_of_view_can_hold():
    """Sensor at 1.25 m, the middle of layer 2; rays up to 26.565°: tan = ½."""
    world = world_of(np.zeros(SIZE, bool))
    steep = math.atan(0.5)
    sensor = {"field_of_view_rad": (1.0, 2 * steep), "angular_step_rad": 2 * steep}
    level = free_box(
        grid=world.grid,
        robot={"motion": "planar", "sensor_height_m": 1.25, "body_radius_m": 0.1},
        sensor=sensor,
    )
    assert level.sensor.rows == 2
    visible = world.layout(level).visible
    assert visible[:, :, 1:4].all()
    # Layers 0 and 4 lie 0.75 m off, so 1.5 m = 3 voxels away: every column has a place that far off.
    assert visible.all()
    near = with_settings(level, {"sensor": {"max_range_m": 1.4}})
    assert world.layout(near).visible[:, :, 1:4].all() and not world.layout(near).visible[:, :, [0, 4]].any()
    flatter = with_settings(
        level, {"sensor": {"field_of_view_rad": (1.0, 2 * math.atan(0.1)), "angular_step_rad": 0.1993}}
    )
    expected = np.zeros(SIZE, bool)
    expected[:, :, 1:4] = True  # layers 1 and 3 begin 0.25 m off: 2.5 m = 5 voxels; layers 0 and 4 15 voxels
    seen = world.layout(flatter).visible
    assert (seen <= expected).all() and seen[:, :, 2].all()
    assert seen[:, 0, 1].all() and not seen[:, :, 0].any()


def test_a_world_keeps_a_copy_unless_nobody_can_write_through_what_it_is_given():
    solid, ceiling = np.zeros(SIZE, bool), np.full(SIZE[:2], 3, np.int32)
    world = World(Grid(SIZE, 0.5), solid, "room", ceiling)
    solid[:], ceiling[:] = True, 0
    assert not world.occupied.any() and (world.ceiling == 3).all()
    again = World(world.grid, world.occupied, "again", world.ceiling)
    assert again.occupied is world.occupied and again.ceiling is world.ceiling
    for array in (world.ceiling, *pickled_arrays(world)):
        assert not array.flags.writeable


def pickled_arrays(world: World) -> tuple[np.ndarray, np.ndarray]:
    """Of the world as it comes out of a pickle."""
    back = pickle.loads(pickle.dumps(world))
    np.testing.assert_array_equal(back.occupied, world.occupied)
    return back.occupied, back.ceiling


def test_worlds_are_compared_and_hashed_by_identity():
    world, same = (world_of(np.zeros(SIZE, bool)) for _ in range(2))
    assert world == world and world != same and len({world, world, same}) == 2


def test_a_body_that_fits_nowhere():
    with pytest.raises(WorldError) as raised:
        world_of(np.zeros(SIZE, bool)).layout(free_box(robot={"body_radius_m": 2.0}))
    said = "expected room for a body with a radius of 2.0 m; see --robot.body-radius-m and --voxel-size-m"
    assert str(raised.value) == f"world = 'by hand': {said}"


def test_a_body_larger_than_all_but_one_side_of_a_world():
    """A filter with a table of all the voxels that it covers asks for more memory than there is."""
    assert (world_of(np.zeros((1, 48, 12), bool)).collision_mask(11.1) > 0).all()
    ceiling = np.full((1, 96), 12)
    ceiling[0, 20] = 3
    along = np.maximum(np.abs(np.arange(96) - 20) - 0.5, 0.0)
    below = np.maximum(2.5 - np.arange(12), 0.0)
    expected = along[:, None] ** 2 + below**2 < 22.2**2
    np.testing.assert_array_equal(no_fly_mask(ceiling, 12, 22.2)[0], expected)
