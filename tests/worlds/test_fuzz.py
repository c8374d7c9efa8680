"""Broken and hostile files, 500 of each loader: `python -m tests.worlds.fuzz` runs as many as one likes."""

from __future__ import annotations

import pytest

from tests.worlds.fuzz import MUTATORS, Outcome, fuzz, mutants, table
from tests.worlds.samples import samples

FILES = 500
"""A loader; 500 take minutes, most of them to start the reader again after it crashed."""


@pytest.mark.parametrize("loader", samples())
def test_only_worlds_and_named_errors(tmp_path, monkeypatch, loader):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    found = fuzz(samples()[loader], FILES, 7, tmp_path)
    assert found.wrong == []
    assert found.files == FILES
    assert found.loaded < FILES  # something was broken


def test_mutants_are_the_same_for_the_same_seed():
    sources = samples()["image"]
    first, again, other = ([data for _, data in mutants(sources, 40, seed)] for seed in (1, 1, 2))
    assert first == again != other


def test_every_mutator_changes_something():
    for loader in ("map_server", "height npz", "height png", "glb"):
        named = {name for name, _ in mutants(samples()[loader], 200, 0)}
        assert named == {mutate.__name__ for mutate in MUTATORS}


def test_the_table_counts():
    text = table({"a": Outcome(files=5, loaded=2, killed=1, most_s=0.5, most_mib=100.0, wrong=["x"])}, 5)
    assert "| a | 5 | 2 | 3 | 1 | 0.50 | 100 | 1 |" in text
