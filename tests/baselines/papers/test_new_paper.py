"""A new paper's skeleton: five claims on two cells, a figure and a page; and what pages refuse.

What stands between the two lines of dashes is all that a paper needs: it is counted.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from baselines import papers
from baselines.cli.arguments import run_command
from baselines.experiments.experiment import Amount
from baselines.experiments.page import Page
from baselines.papers.__main__ import find_experiment, main
from entropy_explore_env.errors import SettingError
from tests.baselines.papers.pages import run_paper

SWEEP = """
from baselines.experiments.experiment import Amount
from baselines.experiments.trials import Cell, CellTrial, trials_of
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX

def experiment(amount: Amount) -> list[CellTrial]:
    cells = []
    for robots in (1, 2):
        scenario = with_settings(BOX, {"robots": robots, "time_limit_s": 20.0})
        cells.append(Cell(f"robots-{robots}", scenario, "random", amount.seeds))
    return trials_of(cells)
"""
CLAIMS = """
from baselines.experiments.claims import Claim, above, below
from baselines.experiments.experiment import Records, ratio_of, sample
from baselines.experiments.statistics import mean_interval
from baselines.experiments.tables import cells_table

GROUPS = {"more-": "two robots do more than one", "time": "time", "none": "robots do not hit each other"}
CELLS = ("robots-2", "robots-1")

def all_claims(records: Records) -> list[Claim]:
    more = ("scans", "distance_m", "measurements")
    claims = [above(f"more-{figure}", ratio_of(records, *CELLS, figure)) for figure in more]
    claims.append(below("time", ratio_of(records, *CELLS), 1.5))
    blocked = sample(records, "robots-1", "blocked_moves").sum()
    return [*claims, Claim("none", 0, blocked, None, None, True, "drives that were blocked")]

def table(records: Records) -> str:
    scans = {"scans": lambda cell: f"{mean_interval(sample(records, cell, 'scans')):.1f}"}
    return cells_table(["cell"], [((cell,), cell) for cell in records], scans)
"""
FIGURES = """
from matplotlib.figure import Figure
from baselines.experiments.experiment import Records
from baselines.experiments.plots import interval_line, one_axes
from baselines.experiments.statistics import mean_interval

def figure_scans(records: Records) -> Figure:
    figure, axes = one_axes(xlabel="robots", ylabel="scans")
    points = [mean_interval([record["scans"] for record in found]) for found in records.values()]
    interval_line(axes, (1, 2), points)
    return figure
"""
INIT = """
from pathlib import Path
from baselines.experiments.experiment import Experiment
from new_paper import claims, figures, sweep

EXPERIMENT = Experiment(
    name="new-paper",
    title="A new paper",
    template=Path(__file__).with_name("page.md.j2"),
    trials=sweep.experiment,
    claims=claims.all_claims,
    groups=claims.GROUPS,
    figures={"scans": figures.figure_scans},
    tables={"scans": claims.table},
    values={"worlds": lambda records: len(records["robots-1"])},
)
"""
PAGE = """
# A new paper, reproduced

Written by `{{ command }}` in {{ value("worlds") }} worlds. {{ rows }}

## Claims: {{ held }}

{{ claims }}

{{ table("scans") }}

{{ figure("scans", "Scans over team size") }}
"""
# --- end of what a paper needs
FILES = {
    "sweep.py": SWEEP,
    "claims.py": CLAIMS,
    "figures.py": FIGURES,
    "__init__.py": INIT,
    "page.md.j2": PAGE,
}


@pytest.fixture
def new_paper(tmp_path, monkeypatch):
    """The skeleton as a package, which the command knows."""
    for name, text in FILES.items():
        (tmp_path / "new_paper").mkdir(exist_ok=True)
        (tmp_path / "new_paper" / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(papers.PAPERS, "new-paper", "new_paper")
    yield tmp_path / "new_paper"
    for name in [name for name in sys.modules if name.split(".")[0] == "new_paper"]:
        del sys.modules[name]


def test_a_new_paper_takes_a_hundred_lines(new_paper, tmp_path, capsys):
    assert sum(len(text.strip().splitlines()) for text in FILES.values()) <= 120
    ran = run_paper("new-paper", tmp_path / "out", capsys, "--seeds", "2")
    assert len(ran.claims) == 5 and ran.claims["more-scans"]["paper"] == "> 1"
    assert [row.cell for row in ran.rows] == ["robots-1", "robots-1", "robots-2", "robots-2"]
    assert "in 2 worlds. Rows: 4, of commit" in ran.page and "| two robots do more than one |" in ran.page


def test_the_command_shows_a_table(new_paper, tmp_path, capsys):
    words = ["new-paper", "--seeds", "2", "--jobs", "1", "--out", str(tmp_path), "--runs", str(tmp_path)]
    assert run_command(main, words) == 0
    said = capsys.readouterr().out
    assert "A new paper" in said and "more-scans" in said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            '{{ figure("scan", "x") }}',
            "figure of the page = 'scan': expected one of scans; did you mean scans",
        ),
        ('{{ table("scan") }}', "table of the page = 'scan'"),
        ('{{ value("scan") }}', "value of the page = 'scan'"),
        ("{{ clams }}", "template = 't.md.j2': expected one that asks for .*'clams' is undefined"),
        ("{{ figure( }}", "template = 't.md.j2, line 1'"),
    ],
)
def test_a_template_that_asks_for_what_is_not_there_is_named(text, said, tmp_path):
    (tmp_path / "t.md.j2").write_text(text)
    there = {"scans": lambda: "x"}
    page = Page(tmp_path / "t.md.j2", there, there, {"scans": 1}, {"claims": "x"})
    with pytest.raises(SettingError, match=said):
        page.write(tmp_path, "page")
    assert not (tmp_path / "page.md").exists()


def test_a_template_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SettingError, match="template"):
        Page(tmp_path / "none.md.j2").write(tmp_path, "page")


@pytest.mark.parametrize("name", papers.PAPERS)
def test_every_page_is_short_and_has_its_claims(name):
    experiment = find_experiment(name)
    assert experiment.name == name and experiment.template.is_file()
    results = Path(__file__).parents[3] / "docs" / "results"
    words = (results / f"{name}.md").read_text("utf-8").split()
    assert len(words) <= 1500 and (results / name / "claims.csv").is_file()


@pytest.mark.parametrize("name", papers.PAPERS)
def test_trials_differ_by_what_decides_them_and_a_quick_run_has_some_of_the_cells(name):
    trials = find_experiment(name).trials
    whole = trials(Amount(quick=False, seeds=2))
    keys = [(trial.cell, trial.seed) for trial in whole]
    cells = {trial.cell: str(trial.settings) for trial in whole if trial.seed == 0}
    assert len(set(keys)) == len(keys)
    assert len(cells) == len(set(cells.values()))
    assert {trial.cell for trial in trials(Amount(quick=True, seeds=2))} <= set(cells)
