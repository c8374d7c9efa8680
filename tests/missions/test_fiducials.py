"""Landmarks of the world: which are sighted, what that takes back, where they are drawn, what is refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.missions.fiducials import fiducial_places
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.state_digest import state_digest
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.worlds.world import World
from tests.missions.test_localization import DRIFTING, SOME, STAY, frozen
from tests.reference.scenes import build, drawn, free_box, put, seeds, started, toward, wander


def test_fiducials_are_sighted_in_range_in_view_and_not_behind_anything():
    places = ((1.75, 4.0, 1.25), (1.75, 1.0, 1.25), (3.0, 1.75, 1.25))
    scenario = free_box(
        robot={"turn_rate_rad_s": math.inf, "localization": SOME, "body_radius_m": 0.1},
        fiducials={"positions_m": places, "range_m": 2.5},
    )
    north, south, east = math.pi / 2, -math.pi / 2, 0.0

    def sightings(yaw, mate=(0.25, 5.25, 0.25, 0.0, 0.0), solid=None, **fiducials):
        missions = frozen(with_settings(scenario, {"fiducials": fiducials}))
        if solid is not None:
            build(missions, solid)
        put(missions, 0, (*STAY[:3], yaw, 0.0))
        put(missions, 1, mate)
        toward(missions, (*STAY[:3], yaw, 0.0), mate)
        return int(missions.state.estimates["sightings"][0, 0])

    assert [sightings(yaw) for yaw in (north, south, east, math.pi)] == [1, 1, 1, 0]
    assert sightings(north, range_m=2.0) == 0  # 2.25 m away
    assert [sightings(north + turn) for turn in (0.28, 0.32)] == [1, 0]  # half of 7 rays, 5° apart, is 17.5°
    assert sightings(north, mate=(1.75, 3.0, 1.25, 0.0, 0.0)) == 0
    assert sightings(north, mate=(1.75, 4.75, 1.25, 0.0, 0.0)) == 1  # behind it
    wall = np.zeros((7, 11, 5), bool)
    wall[:, 6] = True
    assert sightings(north, solid=wall) == 0 and sightings(south, solid=wall) == 1


def test_a_gaze_straight_down_sights_what_is_ahead_below_and_behind():
    x, y, z = STAY[:3]
    for place, sighted in (
        ((x, y + 0.1, z - 1.0), 1),
        ((x, y - 0.1, z - 1.0), 1),
        ((x, y - 0.9, z - 1.0), 0),
        ((x, y, z + 0.5), 0),
    ):
        missions = frozen(
            free_box(
                robot={"turn_rate_rad_s": math.inf, "localization": SOME}, fiducials={"positions_m": (place,)}
            )
        )
        put(missions, 0, (*STAY[:3], math.pi / 2, math.pi / 2))
        put(missions, 1, (0.25, 0.25, 0.25, 0.0, 0.0))
        toward(missions, (*STAY[:3], math.pi / 2, math.pi / 2), (0.25, 0.25, 0.25, 0.0, 0.0))
        assert missions.state.estimates["sightings"][0, 0] == sighted, place


def test_fiducials_do_not_change_how_robots_drift():
    states = []
    for number in (0, 6):
        around = {"field_of_view_rad": (2 * math.pi, math.pi / 3), "angular_step_rad": math.pi / 12}
        scenario = free_box(robot={"localization": SOME}, sensor=around, fiducials={"number": number})
        missions = Missions(scenario, 1)
        missions.reset_some([0], [3])
        wander(missions, 4, 0)
        states.append(missions.state.estimates[0].copy())
    assert (states[1]["sightings"] > 0).any()
    assert (states[0]["drift_rng"] == states[1]["drift_rng"]).all()
    spreads = [np.trace(state["covariance"], axis1=1, axis2=2).sum() for state in states]
    assert spreads[1] < 0.5 * spreads[0]  # sightings take back what driving added
    assert (states[0]["sighting_rng"] != states[1]["sighting_rng"]).any()


@drawn(15)
@given(seeds, st.sampled_from(["furnished", "empty", "office"]))
def test_drawn_fiducials_are_on_surfaces_that_robots_can_see(seed, world):
    grid = {"shape": (31, 23, 1), "voxel_size_m": 0.5} if world == "office" else {}
    scenario = free_box(world=world, grid=grid, fiducials={"number": 5}, **DRIFTING)
    truth = make_world(scenario, seed % 100)
    places = fiducial_places(scenario, truth, seed, 0)
    voxels = truth.grid.voxel_of(places)
    solid = np.pad(truth.occupied, 1, constant_values=True)
    assert len({tuple(voxel) for voxel in voxels.tolist()}) == 5
    for place, voxel in zip(places, voxels, strict=True):
        assert truth.visible(scenario)[tuple(voxel)] and not truth.occupied[tuple(voxel)]
        towards = np.rint((place - truth.grid.centre_of(voxel)) / (0.49 * truth.grid.voxel_size_m)).astype(
            int
        )
        assert np.abs(towards).sum() == 1 and solid[tuple(voxel + 1 + towards)]
    assert (places == fiducial_places(scenario, truth, seed, 0)).all()
    assert (places != fiducial_places(scenario, truth, seed + 1, 0)).any()


def test_fiducials_where_none_can_be_are_refused_before_anything_changes():
    with pytest.raises(
        SettingError, match=r"Fiducials.positions_m = \(1.0, 6.0, 1.0\): expected places from"
    ):
        free_box(fiducials={"positions_m": ((1.0, 6.0, 1.0),)})
    occupied = np.zeros((7, 11, 5), bool)
    occupied[3, 4, 2] = True
    box = World(free_box().grid, occupied, "one block")
    for drifting in ({}, DRIFTING):
        inside = free_box(fiducials={"positions_m": ((1.0, 1.0, 1.0), (1.75, 2.25, 1.25))}, **drifting)
        env = EntropyExploreEnv(inside, world=box)
        with pytest.raises(
            WorldError, match=r"Fiducials.positions_m = \(1.75, 2.25, 1.25\): expected a place in free"
        ):
            env.reset(seed=0)
    many = started(free_box(fiducials={"number": 200}, **DRIFTING))
    before = state_digest(many, 0)
    many.rules = many.rules._replace()  # a reset that cannot be done leaves all as it was
    object.__setattr__(many.scenario.fiducials, "number", 900)
    with pytest.raises(WorldError, match=r"Fiducials.number = 900: expected at most 250"):
        many.reset(0, 1)
    object.__setattr__(many.scenario.fiducials, "number", 200)
    assert state_digest(many, 0) == before
