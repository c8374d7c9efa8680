"""Which code results belong to: the meaning of what is imported, and nothing else."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from baselines import strategies
from baselines.experiments import mission, provenance
from baselines.experiments.cells import Cell
from baselines.experiments.outcome import Outcome
from baselines.experiments.provenance import CodeChangedError, code_digest, imported, modules_of
from baselines.experiments.runner import Conditions, run_all
from baselines.papers.sawhney.mission import MapRun
from baselines.strategies.metrics import ExplorationConfig, Nearest
from baselines.strategies.rules.gradient import GradientStrategy
from baselines.strategies.rules.next_best_view import NextBestView, NextBestViewConfig
from baselines.strategies.rules.random_walk import RandomWalk
from entropy_explore_env.scenarios import find_scenario

ROOT = Path(__file__).parents[3]
WALK, STEEP = "baselines.strategies.rules.random_walk", "baselines.strategies.rules.gradient"


def forget() -> None:
    for cached in (provenance._module, provenance._file_of, provenance.imported):
        cached.cache_clear()


@pytest.fixture(autouse=True)
def _fresh():
    """What other tests left in the caches, and what these leave, is nobody's."""
    forget()
    yield
    forget()


@pytest.fixture
def entered(monkeypatch):
    """Puts strategies in the place of all others."""

    def enter(**named):
        monkeypatch.setattr(strategies, "STRATEGIES", named)

    return enter


@pytest.fixture
def digest_with(monkeypatch, tmp_path):
    """The digest of a strategy's missions while a module has another text."""
    files = provenance._file_of.__wrapped__

    def edited_digest(module, change, strategy="random"):
        text = files(module).read_text()
        assert change(text) != text
        edited = tmp_path / "edited.py"
        edited.write_text(change(text))
        with monkeypatch.context() as patch:
            patch.setattr(provenance, "_file_of", lambda name: edited if name == module else files(name))
            forget_modules()
            found = code_digest(mission.__name__, strategy=strategy)
        forget_modules()
        return found

    def forget_modules():
        provenance._module.cache_clear()
        provenance.imported.cache_clear()

    return edited_digest


# --- what an edit does


def another_docstring(text: str) -> str:
    return text.replace('"""', '"""Said otherwise: ', 1)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\n# a comment\n", 3) + "\n\n# the end\n",
        another_docstring,
        lambda text: text.replace("\n\n\n", "\n\n\n\n\n"),
    ],
    ids=["comment", "docstring", "layout"],
)
@pytest.mark.parametrize("module", [WALK, mission.__name__, "entropy_explore_env.belief.raycast"])
def test_an_edit_of_words_or_layout_keeps_the_digest(module, change, digest_with):
    assert digest_with(module, change) == code_digest(mission.__name__, strategy="random")


@pytest.mark.parametrize(
    "module",
    [
        WALK,
        "baselines.strategies.protocol",
        mission.__name__,
        "entropy_explore_env.envs.parallel_env",  # imported by the mission
        "entropy_explore_env.missions.action",  # by that and by others
        "entropy_explore_env.belief.raycast",  # far below
    ],
)
def test_an_edit_of_code_changes_the_digest_however_far_away_it_is_imported(module, digest_with):
    before = code_digest(mission.__name__, strategy="random")
    assert digest_with(module, lambda text: text + "\n_NEW = 1\n") != before
    assert digest_with(module, lambda text: text + "\n_NEW = 2\n") != digest_with(
        module, lambda text: text + "\n_NEW = 1\n"
    )


def test_an_edit_of_another_strategy_or_of_what_reports_do_keeps_the_digest(digest_with):
    before = code_digest(mission.__name__, strategy="random")
    for module in (STEEP, "baselines.strategies", "baselines.experiments.runner", "baselines.cli.figures"):
        assert digest_with(module, lambda text: text + "\n_NEW = 1\n") == before
    steep = code_digest(mission.__name__, strategy="gradient")
    assert digest_with(STEEP, lambda text: text + "\n_NEW = 1\n", "gradient") != steep


def test_what_is_no_docstring_is_meant():
    import ast

    def meaning(source):
        return provenance.meaning(ast.parse(source))

    assert meaning('def f():\n    "said"\n    return 1') == meaning("def f():\n  return 1  # so")
    assert meaning('a = 1\n"""Of a."""') == meaning("a = 1")
    assert meaning('a = "said"') != meaning('a = "so"')
    assert meaning("def f():\n    return 1") != meaning("def f():\n    return 2")
    assert meaning("def f(a=1):\n    return a") != meaning("def f(a=2):\n    return a")


# --- which modules count


def test_what_a_module_imports_is_found_however_far_away():
    found = imported(WALK).keys()
    assert {WALK, "entropy_explore_env.frontiers.knowledge", "entropy_explore_env.missions.view"} <= found
    assert {STEEP, "baselines.strategies.loading"} <= imported("baselines.strategies").keys()
    assert not {"numpy", "numba", "numpy.random"} & found
    assert STEEP not in imported(mission.__name__, skipped="baselines.strategies")
    assert "entropy_explore_env.worlds.files.octomap_tree" in modules_of("entropy_explore_env.worlds.files")


def test_a_new_strategy_leaves_the_digest_of_another_as_it_is(entered):
    entered(walk=RandomWalk)
    before = code_digest(strategy="walk")
    entered(walk=RandomWalk, other=GradientStrategy)
    assert code_digest(strategy="walk") == before == code_digest(strategy="walk")
    assert len({before, code_digest(mission.__name__, strategy="walk"), code_digest(strategy="other")}) == 3


def test_settings_of_a_strategy_are_part_of_its_digest(entered):
    entered(
        a=GradientStrategy,
        b=partial(GradientStrategy, motion_plane=True),
        c=partial(GradientStrategy, motion_plane=False),
        d=partial(NextBestView, NextBestViewConfig(poses=50)),
        e=partial(NextBestView, NextBestViewConfig(poses=51)),
    )
    assert len({code_digest(strategy=name) for name in "abcde"}) == 5


def test_what_a_record_is_made_by_counts(entered, tmp_path):
    """The settings of its fields, their modules, and the files that it names with what reads them."""
    entered(walk=RandomWalk)
    world = tmp_path / "plan.png"
    world.write_bytes(b"one")

    def cell(metric=None):
        exploring = ExplorationConfig() if metric is None else ExplorationConfig(metric=metric)
        return Cell("cell", find_scenario("room"), "walk", 1, MapRun(exploring, str(world)))

    before = cell().settings_digest
    assert cell().settings_digest == before != cell(Nearest()).settings_digest
    world.write_bytes(b"two")
    assert cell().settings_digest != before
    world.write_bytes(b"one")
    assert cell().settings_digest == before
    plain = Cell("cell", find_scenario("room"), "walk", 1)
    assert len({cell().code_digest(), plain.code_digest()}) == 2
    with_file = cell().code_digest()
    world.unlink()
    assert cell().code_digest() != with_file  # nothing is left to be read


# --- code from elsewhere


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """Writes modules of a user's own, outside the checkout."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(**texts):
        for name, text in texts.items():
            (tmp_path / f"{name}.py").write_text(text)
        forget()

    yield write
    for name in [name for name in sys.modules if name.startswith("own_")]:
        del sys.modules[name]


def test_a_file_from_elsewhere_counts_with_what_lies_beside_it(elsewhere):
    elsewhere(own_walk="import numpy\nimport own_far\n", own_far="from own_farther import A\n")
    elsewhere(own_farther="A = 1")
    assert imported("own_walk").keys() == {"own_walk", "own_far", "own_farther"}
    before = code_digest("own_walk")
    elsewhere(own_farther="A = 1  # so")
    assert code_digest("own_walk") == before
    elsewhere(own_farther="A = 2")
    assert code_digest("own_walk") != before


def test_a_package_from_elsewhere_counts_with_its_relative_imports(elsewhere, tmp_path):
    (tmp_path / "own_package").mkdir()
    texts = {
        "__init__": "",
        "walk": "from . import far\nfrom .near import B\nfrom baselines.strategies import protocol\n",
        "far": "A = 1",
        "near": "B = 1",
    }
    elsewhere(**{f"own_package/{name}": text for name, text in texts.items()})
    found = imported("own_package.walk").keys()
    assert {"own_package.walk", "own_package.far", "own_package.near"} <= found
    assert "baselines.strategies.protocol" in found


# --- code that is edited while it runs


@dataclass(frozen=True)
class OfTwoMinds:
    """Work whose code is another one in every process."""

    file: str = "work"
    settings_digest: str = ""

    def code_digest(self):
        return str(os.getpid())

    def run(self):
        return Outcome({"done": True})


def test_a_worker_with_other_code_does_nothing(tmp_path):
    works = [OfTwoMinds("one"), OfTwoMinds("two")]
    conditions = Conditions(tmp_path, 2, "test", quiet=True, keep_failures=True)
    with pytest.raises(CodeChangedError, match="edited after the experiment began"):
        run_all(works, conditions)
    assert list(tmp_path.iterdir()) == []
    assert run_all(works, dataclasses.replace(conditions, workers=1)) == [{"done": True}] * 2


def test_a_worker_refuses_files_that_were_edited_after_it_had_started(monkeypatch):
    code_digest(WALK)
    monkeypatch.setattr(provenance, "PROCESS_STARTED_NS", 0)
    forget()
    code_digest(WALK)  # the process that plans runs nothing
    monkeypatch.setattr(provenance.multiprocessing, "parent_process", lambda: object())
    code_digest(WALK)  # known since before
    forget()
    with pytest.raises(CodeChangedError, match=r"random_walk\.py|\.py was edited"):
        code_digest(WALK)


RECORDS = """
import os, pathlib, time
ANSWER = 1

def record(env, strategy, seed):
    if seed == 1 and ANSWER == 1:
        here = pathlib.Path(__file__)
        here.write_text(here.read_text().replace("ANSWER = 1", "ANSWER = 2"))
        os._exit(7)
    time.sleep(0.3 if ANSWER == 1 else 0.0)
    return {"answer": ANSWER, "seed": seed}
"""
SWEEP = """
import sys
from pathlib import Path
from baselines.experiments.cells import Cell, run_cells
from entropy_explore_env.scenarios import BOX
from own_records import record

if __name__ == "__main__":
    run_cells([Cell("cell", BOX, "random", 200, record)], Path(sys.argv[1]), 2, "", True, keep_failures=True)
"""


@pytest.mark.long
def test_an_edit_under_way_ends_the_experiment_and_labels_no_result_wrongly(tmp_path):
    """A worker that replaces one which ended would run the edited code: nothing is kept of it."""
    (tmp_path / "own_records.py").write_text(RECORDS)
    (tmp_path / "sweep.py").write_text(SWEEP)
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"}
    words = [sys.executable, "-B", str(tmp_path / "sweep.py"), str(tmp_path / "kept")]

    def run_and_read():
        ran = subprocess.run(words, env=environment, cwd=ROOT, capture_output=True, text=True)
        return ran, [file.read_text() for file in (tmp_path / "kept").rglob("seed-*.json")]

    ran, texts = run_and_read()
    assert ran.returncode and "CodeChangedError" in ran.stderr and "edited" in ran.stderr
    assert 1 <= len(texts) < 200 and not any('"answer": 2' in text for text in texts)
    ran, texts = run_and_read()
    assert ran.returncode == 0, ran.stderr
    assert sum('"answer": 2' in text for text in texts) == len(texts) == 200
