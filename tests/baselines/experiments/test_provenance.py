"""Which code a strategy's results belong to."""

from __future__ import annotations

from functools import partial

import pytest

from baselines import strategies
from baselines.experiments import mission
from baselines.experiments import provenance as sources
from baselines.experiments.cells import Cell
from baselines.experiments.provenance import imported, sources_digest
from baselines.papers.sawhney.map_files import MapRun
from baselines.strategies import gradient, random_walk
from baselines.strategies.frontier import ExplorationConfig
from baselines.strategies.frontier.metrics import Nearest
from baselines.strategies.gradient import GradientStrategy
from baselines.strategies.information_rate import InformationRate, InformationRateConfig
from baselines.strategies.random_walk import RandomWalk
from entropy_explore_env.scenarios import find_scenario


@pytest.fixture
def entered(monkeypatch):
    """Puts strategies in the place of all others."""

    def enter(**named):
        monkeypatch.setattr(strategies, "STRATEGIES", named)

    return enter


def test_what_a_strategy_imports_is_found_however_far_away():
    assert imported("baselines.strategies.random_walk") == {
        "baselines.strategies.random_walk",
        "baselines.strategies.protocol",
    }
    assert {
        "baselines.strategies.gradient",
        "baselines.strategies.information_rate",
        "baselines.strategies.protocol",
    } <= imported("baselines.strategies")


def test_a_new_strategy_leaves_the_digest_of_another_as_it_is(entered):
    entered(walk=RandomWalk)
    before = sources_digest("walk")
    entered(walk=RandomWalk, other=GradientStrategy)
    assert sources_digest("walk") == before == sources_digest("walk")
    assert len({before, sources_digest("walk", mission.__name__), sources_digest("other")}) == 3


def test_settings_of_a_strategy_are_part_of_its_digest(entered):
    entered(
        a=GradientStrategy,
        b=partial(GradientStrategy, motion_plane=True),
        c=partial(GradientStrategy, motion_plane=False),
        d=partial(InformationRate, InformationRateConfig(candidates=80)),
        e=partial(InformationRate, InformationRateConfig(candidates=81)),
    )
    assert len({sources_digest(name) for name in "abcde"}) == 5


def test_code_of_the_strategy_and_of_the_library_counts(entered, monkeypatch, tmp_path):
    entered(walk=RandomWalk)
    before = sources_digest("walk")
    changed = tmp_path / "random_walk.py"
    changed.write_text("# another walk\n")
    files = sources._file_of
    with monkeypatch.context() as patch:
        patch.setattr(
            sources, "_file_of", lambda name: changed if name == random_walk.__name__ else files(name)
        )
        assert sources_digest("walk") != before
    with monkeypatch.context() as patch:
        patch.setattr(sources, "_file_of", lambda name: changed if name == gradient.__name__ else files(name))
        assert sources_digest("walk") == before
    monkeypatch.setattr(sources, "_library_digest", lambda: b"another library")
    assert sources_digest("walk") != before


def test_what_a_record_is_made_by_counts(entered, monkeypatch, tmp_path):
    """The settings of its fields, their modules, its neighbours in a package, and files that it names."""
    entered(walk=RandomWalk)
    world = tmp_path / "plan.png"
    world.write_bytes(b"one")

    def digest(metric=None):
        exploring = ExplorationConfig() if metric is None else ExplorationConfig(metric=metric)
        return Cell("cell", find_scenario("room"), "walk", 1, MapRun(exploring, str(world))).digest

    before = digest()
    assert digest() == before
    world.write_bytes(b"two")
    assert digest() != before
    world.write_bytes(b"one")
    assert digest() == before
    files, changed = sources._file_of, tmp_path / "changed.py"
    changed.write_text("# changed\n")
    nearest = digest(Nearest())
    for name in ("baselines.papers.sawhney.mission", "baselines.strategies.frontier.metrics"):
        with monkeypatch.context() as patch:
            patch.setattr(
                sources, "_file_of", lambda module, name=name: changed if module == name else files(module)
            )
            assert digest(Nearest()) != nearest
