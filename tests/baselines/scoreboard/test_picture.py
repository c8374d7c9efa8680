"""The picture of a mission: its moments, and what their colours say."""

from __future__ import annotations

import numpy as np

from baselines.experiments.mission import run_mission
from baselines.scoreboard import picture
from baselines.scoreboard.picture import Watch, known_colours
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from tests.planner.scenes import small_plan


def test_moments_come_as_more_is_seen_and_the_map_is_coloured_by_what_is_known():
    env = EntropyExploreEnv(small_plan(ending={"seen_share": 0.9, "time_limit_s": 500.0}))
    watch = Watch(env)
    run_mission(env, make_strategy("nearest-frontier"), 1, watch)
    watch.note(env)
    assert len(watch.moments) == 3
    unknown = [(moment.colours == picture._UNKNOWN).all(axis=-1).mean() for moment in watch.moments]
    assert unknown[0] > unknown[1] > unknown[2]
    lengths = [len(moment.paths_m[0]) for moment in watch.moments]
    assert lengths == sorted(lengths) and lengths[0] < lengths[2]
    colours, truth = known_colours(env), env.missions.state.truth[0].reshape(70, 60)
    free = (colours == picture._FREE).all(axis=-1)
    wall = (colours == picture._WALL).all(axis=-1)
    assert truth[free].mean() < 0.05 and truth[wall].mean() > 0.8  # ranges are noisy
    assert free.sum() > wall.sum() > 0
    figure = picture.picture(watch, env, "a title")
    titles = [axes.get_title() for axes in figure.axes]
    assert len(titles) == 3 and all("% seen" in title for title in titles)
    assert figure.axes[0].get_images()[0].get_array().shape == (60, 70, 3)
    assert np.allclose(figure.axes[2].lines[-1].get_xydata()[0], watch.moments[2].paths_m[0][-1][:2])
