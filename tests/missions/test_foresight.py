"""Foresight: predictions of unknown voxels, where they count, when they are renewed, and what follows."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted_env
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.missions import foresight
from entropy_explore_env.missions.foresight import LearnedForesight, predictions_pay
from entropy_explore_env.missions.view_candidates import ViewProposer, _foresee
from entropy_explore_env.planner.thresholds import (
    COURSE_DECISIONS,
    RENEWED_DECISIONS,
    RENEWED_M,
    SOLID_SHARE,
    SOLID_SHARE_IN_VOLUMES,
)
from entropy_explore_env.prediction.crop import UNPREDICTED
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.viewpoints.expected_scan import MOST_SCANS, new_scan_scratch

SHAPE, PRIOR = (7, 11, 1), 0.25


def view_of(solid, voxel_size_m=0.2, shape=SHAPE, origin_m=(0.0, 0.0), precision=None, cell_m=0.2):
    """Return what foresight reads of a robot at (0.5, 0.5) m, with a prediction from (0, 0) m on."""
    known = np.full(shape, PRIOR, np.float32) if precision is None else precision
    prediction = SimpleNamespace(solid=solid, origin_m=np.zeros(2), cell_m=cell_m)
    grid = Grid(shape, voxel_size_m, (*origin_m, 0.0))
    scenario = SimpleNamespace(grid=grid, sigma_prior=PRIOR**-0.5)
    pose = np.array([0.5, 0.5, 0.1, 0.0, 0.0])
    return SimpleNamespace(robot=0, pose=pose, precision=known, prediction=prediction, scenario=scenario)


def drawn_cells(shape, seed=1):
    return np.random.default_rng(seed).uniform(0.4, 1.0, shape).astype(np.float32)


@pytest.mark.parametrize("voxel_size_m", [0.1, 0.2, 0.25, 0.4])
def test_voxels_are_predicted_by_the_cell_of_their_centre(voxel_size_m):
    """Those whose centre no cell holds are not; of n voxels across a cell one stops as often as the cell."""
    cells = drawn_cells((5, 6))
    found = LearnedForesight()(view_of(cells, voxel_size_m, origin_m=(-0.3, -0.2))).reshape(SHAPE)
    for x, y, _ in np.ndindex(*SHAPE):
        at = [((n + 0.5) * voxel_size_m - off) / 0.2 for n, off in ((x, 0.3), (y, 0.2))]
        expected = UNPREDICTED
        if 0.0 <= at[0] < 5.0 and 0.0 <= at[1] < 6.0:
            across = max(0.2 / voxel_size_m, 1.0)
            expected = 1.0 - (1.0 - cells[int(at[0]), int(at[1])]) ** (1.0 / across)
        assert found[x, y, 0] == pytest.approx(expected, abs=1e-6), (x, y)


def test_nothing_is_predicted_where_little_of_what_is_unknown_is_solid():
    """What was measured does not count, whatever it is."""
    cells, precision = np.full(SHAPE[:2], 0.99, np.float32), np.full(SHAPE, PRIOR, np.float32)
    cells[:3], precision[3:] = SOLID_SHARE - 0.01, 10.0
    assert LearnedForesight()(view_of(cells, precision=precision)) is None
    cells[:3] = SOLID_SHARE + 0.01
    found = LearnedForesight()(view_of(cells, precision=precision))
    assert found is not None and (found > 0.0).all()
    assert LearnedForesight()(view_of(cells, precision=np.full(SHAPE, 9.0))) is None


def test_a_prediction_is_renewed_as_its_robot_moves_on_or_the_grid_grows():
    foreseen, first, second = LearnedForesight(), drawn_cells(SHAPE[:2], 1), drawn_cells(SHAPE[:2], 2)
    before = foreseen(view_of(first))
    view = view_of(second)
    view.pose[0] += 0.99 * RENEWED_M
    assert foreseen(view) is before
    view.robot = 1
    assert not np.array_equal(foreseen(view), before)
    view.robot = 0
    for _ in range(RENEWED_DECISIONS - 2):
        assert foreseen(view) is before
    again = foreseen(view)
    assert not np.array_equal(again, before)
    view = view_of(first)
    view.pose[0] += 1.98 * RENEWED_M
    assert foreseen(view) is again
    view.pose[0] += 0.02 * RENEWED_M
    assert np.array_equal(foreseen(view), before)
    assert len(foreseen(view_of(drawn_cells((8, 11)), shape=(8, 11, 1)))) == 88


@pytest.mark.parametrize(
    ("places_m", "without"),
    [
        ([(0.0, 0.0), (3.0, 4.0)], True),  # 15 times the diagonal
        ([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 0.0)], True),  # 7.5 times
        ([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (2.0, 0.0), (1.0, 0.0)], False),  # 5 times
        ([(0.0, 0.0), (0.6, 0.7)], False),  # on one spot
        ([(0.1 * n, 0.0) for n in range(400)], False),
    ],
)
def test_a_robot_that_drives_to_and_fro_goes_on_without_predictions(places_m, without):
    foreseen, view = LearnedForesight(), view_of(drawn_cells(SHAPE[:2]))
    for number in range(3 * COURSE_DECISIONS):
        view.pose[:2] = places_m[number % len(places_m)]
        found = foreseen(view)
        assert (found is None) == (without and number + 1 >= COURSE_DECISIONS), number
    view.robot = 1
    assert foreseen(view) is not None


def test_height_counts_in_volumes():
    """A robot that climbs gets another prediction, and one that flies up and down goes on without."""
    foreseen, view = LearnedForesight(), view_of(None, shape=(3, 4, 5))
    view.predicted_volume = np.full((3, 4, 5), 0.9, np.float32)
    before = foreseen(view)
    view.pose[2] += 0.9 * RENEWED_M
    assert np.shares_memory(foreseen(view), before)
    view.predicted_volume = np.full((3, 4, 5), 0.8, np.float32)
    view.pose[2] += 0.2 * RENEWED_M
    assert not np.shares_memory(foreseen(view), before)
    for number in range(COURSE_DECISIONS):
        view.pose[2] = 2.0 * (number % 2)
        found = foreseen(view)
    assert found is None


def test_a_prediction_that_holds_no_centre_says_nothing():
    assert LearnedForesight()(view_of(drawn_cells((5, 6)), voxel_size_m=4.0)) is None


@pytest.mark.parametrize(
    ("name", "changes", "pays"),
    [
        ("corridor", {}, True),
        ("office", {"robots": 3}, True),
        ("office", {"ending": {"seen_share": 1.0}}, False),
        ("room", {}, False),
        ("cave", {}, True),
        ("cave", {"robots": 3}, True),
        ("cave", {"ending": {"seen_share": 0.5}}, False),
        ("cave", {"robot": {"navigator": "straight"}}, False),
        ("cave", {"sensor": {"field_of_view_rad": (6.28, 1.0)}}, False),
        ("office-3d", {}, True),
        ("cave", {"grid": {"shape": (400, 250, 40)}}, True),
        ("cave", {"grid": {"shape": (400, 250, 41)}}, False),
        ("lab", {}, False),
        ("office-mixed", {}, False),
        ("corridor", {"robot": {"redecide": "on_scan"}, "sensor": {"scan_every_m": 1.0}}, False),
        ("corridor", {"robot": {"redecide": 0.5}}, False),
        ("corridor", {"sensor": {"field_of_view_rad": (1.0, 0.1)}}, False),
    ],
)
def test_missions_in_which_predictions_pay(name, changes, pays):
    assert predictions_pay(with_settings(SCENARIOS[name], changes)) == pays


def test_a_volume_is_predicted_where_much_of_it_is_solid():
    """As the view says, as it is; what nothing is said of does not count."""
    predicted = np.full((3, 4, 5), UNPREDICTED, np.float32)
    predicted[0], predicted[1] = SOLID_SHARE_IN_VOLUMES + 0.1, SOLID_SHARE_IN_VOLUMES - 0.05
    view = view_of(None, shape=predicted.shape)
    for voxel_size_m in (0.2, 0.4, 0.8):
        view = view_of(None, voxel_size_m, predicted.shape)
        view.predicted_volume = predicted
        found = LearnedForesight()(view).reshape(predicted.shape)
        across = max(0.4 / voxel_size_m, 1.0)  # one of these voxels stops a ray as often as the cell
        np.testing.assert_allclose(found[:2], 1.0 - (1.0 - predicted[:2]) ** (1.0 / across), atol=1e-6)
        assert (found[2] == UNPREDICTED).all()
    view.predicted_volume = predicted - np.float32(0.1) * (predicted > 0.0)
    assert LearnedForesight()(view) is None
    view.predicted_volume = np.full(predicted.shape, UNPREDICTED, np.float32)
    assert LearnedForesight()(view) is None


def test_several_scans_count_where_something_is_predicted():
    scratch, solid = new_scan_scratch(6, 10, 1, predicted=True), np.array([UNPREDICTED, 0.0] * 3)
    for given, most in ((solid, MOST_SCANS), (None, 1), (None, 1), (solid, MOST_SCANS)):
        _foresee(given, scratch)
        assert scratch.scans[0] == most
        assert np.array_equal(scratch.solid, np.full(6, UNPREDICTED) if given is None else given)


def test_a_proposer_whose_grid_has_grown_predicts_on():
    plan = with_settings(
        SCENARIOS["corridor"], {"robots": 1, "action": {"kind": "candidates", "candidates": 1}}
    )
    larger = with_settings(plan, {"grid": {"shape": (310, 205, 1)}})
    proposer = ViewProposer(plan, np.random.default_rng(0), foresight=LearnedForesight())
    proposer.grow(larger, np.zeros(3))
    assert [len(each.scratch.scan.solid) for each in proposer._proposers] == [larger.grid.voxels]


def goals_of(strategy, scenario):
    """Return the viewpoints of the first decisions of a mission."""
    env, goals = scripted_env(scenario), []

    def note(actions):
        goals.append(np.concatenate(list(actions.values())))
        return len(goals) == 40

    run_mission(env, strategy, 3, before_step=note)
    return np.array(goals)


@pytest.mark.parametrize(("rock", "rooms"), [("corridor", "office"), ("cave", "office-3d")])
def test_the_planner_heeds_predictions_in_rock_alone(rock, rooms, monkeypatch):
    """In offices, and where nothing is predicted, its goals are those of the planner without predictions."""
    changes = {"split": "validation", "robots": 1}
    rock, rooms = (with_settings(SCENARIOS[name], changes) for name in (rock, rooms))
    assert not np.array_equal(goals_of(PlannedRate(), rock), goals_of(PlannedRate(foresight=None), rock))
    assert np.array_equal(goals_of(PlannedRate(), rooms), goals_of(PlannedRate(foresight=None), rooms))
    for share in ("SOLID_SHARE", "SOLID_SHARE_IN_VOLUMES"):
        monkeypatch.setattr(foresight, share, 1.1)
    assert np.array_equal(goals_of(PlannedRate(), rock), goals_of(PlannedRate(foresight=None), rock))
