"""The second nearest frontier cell of a corridor that is open at both ends is its far end."""

from second_nearest import pick

from tests.planner.scenes import cell, corridor, scene_of


def test_of_two_ends_it_takes_the_farther_one():
    """Cells are known from (1, 1) to (27, 1)."""
    plan = corridor()
    assert cell(plan, pick(scene_of(plan, (8, 1)))) == (27, 1)
    assert cell(plan, pick(scene_of(plan, (20, 1)))) == (1, 1)
