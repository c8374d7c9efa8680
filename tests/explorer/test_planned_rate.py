"""The strategy `planned-rate`: how soon it is done, what it remembers, and that it never stands still."""

from __future__ import annotations

import pytest

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies.rules.nearest_frontier import NearestFrontier
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import ROOM, SCENARIOS, find_scenario


class FirstCandidate:
    """Chooses the first of the candidates that the planner proposes to a policy, which is its own choice."""

    def reset(self, scenario, rng):
        self._proposer = ViewProposer(with_settings(scenario, {"action": {"kind": "candidates"}}), rng)

    def choose(self, view):
        return self._proposer.propose(view)[0].copy()


def figures_of(strategy, scenario=ROOM, seed=0, **settings):
    env = EntropyExploreEnv(with_settings(scripted(scenario), settings))
    run_mission(env, strategy, seed)
    return mission_figures(env.missions, 0)


@pytest.mark.parametrize(
    ("name", "robots", "share"),
    [("room-furnished", 3, 0.4), ("office", 1, 0.7)],
)
def test_it_is_sooner_done_than_nearest_frontier(name, robots, share):
    ours, theirs = (
        [figures_of(make(), find_scenario(name), seed, robots=robots)["t_mission_s"] for seed in (0, 1)]
        for make in (PlannedRate, NearestFrontier)
    )
    assert sum(ours) < share * sum(theirs)


def test_mixed_teams_take_the_recipe_of_each_kind():
    mixed = find_scenario("office-mixed")
    figures = figures_of(PlannedRate(), mixed, seed=1, robots=2, ending={"time_limit_s": 40.0})
    assert all(robot["scans"] > 4 for robot in figures["per_robot"])


def test_where_everything_is_to_be_seen_no_time_goes_to_known_walls():
    """The planner's first candidate took 4,377 scans and 2,818 s here, most of them of walls that it knew."""
    ending = {"seen_share": 1.0, "time_limit_s": 3000.0}
    settings = {"robots": 1, "track_truth": True, "split": "train", "ending": ending}
    figures = figures_of(FirstCandidate(), SCENARIOS["office"], **settings)
    assert figures["finished"] and figures["scans"] < 400 and figures["t_mission_s"] < 1500.0
