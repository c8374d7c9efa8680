"""What tests of papers share: their cells, and a run of the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image

from baselines.cli.arguments import run_command
from baselines.experiments.experiment import Amount, Experiment
from baselines.experiments.rows import Row, read_table
from baselines.experiments.trials import Cell, CellTrial
from baselines.papers.__main__ import main

MOST_WORDS = 1500
"""Of a page of results."""


class Ran(NamedTuple):
    """What the command left."""

    claims: dict[str, dict[str, Any]]
    page: str
    rows: list[Row]


def cells_of(experiment: Experiment, seeds: int, quick: bool = False) -> dict[str, Cell]:
    """Name → cell."""
    trials = experiment.trials(Amount(quick, seeds))
    return {trial.cell: trial.point for trial in trials if isinstance(trial, CellTrial)}


def run_paper(name: str, folder: Path, capsys: Any, *words: str) -> Ran:
    """Run the command for one experiment, by one process; look at its page and figures."""
    places = ["--out", str(folder), "--runs", str(folder / "rows"), "--jobs", "1", "--json"]
    assert run_command(main, [name, *words, *places]) == 0
    printed = json.loads(capsys.readouterr().out, parse_constant=None)
    page = (folder / f"{name}.md").read_text("utf-8")
    assert " ".join(["python -m baselines.papers", name, *words]) in page
    assert len(page.split()) <= MOST_WORDS and "nan" not in page.split()
    linked = [line.rpartition("(")[2].rstrip(")") for line in page.splitlines() if line.startswith("![")]
    pictures = sorted(path.relative_to(folder) for path in (folder / name).glob("*.png"))
    assert linked and sorted(map(Path, linked)) == pictures
    for picture in pictures:
        with Image.open(folder / picture) as image:
            image.load()
            assert min(image.size) > 250
    claims = {claim["id"]: claim for claim in printed["experiments"][name]["claims"]}
    lines = (folder / name / "claims.csv").read_text("utf-8").splitlines()
    assert len(lines) == 1 + len(claims) == 1 + len(printed["experiments"][name]["claims"])
    table = folder / "rows" / f"{name}.jsonl"
    content = table.read_bytes()
    assert run_command(main, [name, *words, *places]) == 0
    again = json.loads(capsys.readouterr().out)["experiments"][name]["claims"]
    assert again == printed["experiments"][name]["claims"]
    assert table.read_bytes() == content and (folder / f"{name}.md").read_text("utf-8") == page
    return Ran(claims, page, read_table(table))
