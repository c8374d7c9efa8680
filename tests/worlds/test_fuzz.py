"""Broken and hostile files of every kind; `benchmarks.proofs files` reads as many as one likes."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from benchmarks.proofs.files import read_worlds
from benchmarks.proofs.hostile_worlds import MUTATORS, drawn_octree, mutant
from benchmarks.proofs.world_samples import SAMPLES
from entropy_explore_env.errors import WorldError
from entropy_explore_env.worlds.files.process import kept_reader
from entropy_explore_env.worlds.load import load_world

FEW, MANY = 40, 500
"""Files a loader. Most of their time goes into starting the reader again after it crashed."""


def check_loader(loader: str, files: int, folder: Path) -> None:
    found = read_worlds(loader, folder, files, 7)
    assert found.wrong == []
    assert found.files == files
    assert found.loaded < files, "some were broken"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder beside the working directory, so that what a file writes there is noticed."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path


@pytest.mark.parametrize("loader", SAMPLES)
def test_only_worlds_and_named_errors(folder, loader):
    check_loader(loader, FEW, folder)


@pytest.mark.long
@pytest.mark.parametrize("loader", SAMPLES)
def test_only_worlds_and_named_errors_of_many_files(folder, loader):
    check_loader(loader, MANY, folder)


def mutants(loader: str, count: int, seed: int) -> list:
    sources = SAMPLES[loader]()
    return [mutant(sources, number, np.random.default_rng([seed, number])) for number in range(count)]


def test_every_mutator_changes_something():
    for loader in ("map_server", "height npz", "height png", "glb", "octomap"):
        named = {name for name, _ in mutants(loader, 120, 0)}
        assert named == {mutate.__name__ for mutate in MUTATORS}


def test_drawn_octrees_are_read_and_refused(folder):
    """Some are sound, some have a wrong size, some are too deep: all changes are one after the other."""
    causes, loaded = Counter(), 0
    with kept_reader():
        for source in SAMPLES["octomap"]():
            name, data = next(iter(source.files.items()))
            for seed in range(60):
                (folder / name).write_bytes(drawn_octree(data, np.random.default_rng(seed)))
                try:
                    load_world(folder / name)
                    loaded += 1
                except WorldError as error:
                    causes[error.allowed.split(";")[0]] += 1
    assert loaded > 20
    assert causes["a whole OctoMap tree of at most 16 levels below its root"] > 2
    assert causes["an OctoMap tree of as many nodes as its head says"] > 5
