"""Running means and deviations are those of all samples, or of the latest ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.reference.scenes import drawn
from training.errors import CheckpointError
from training.normalisation import Normaliser


@drawn()
@given(st.lists(st.integers(1, 9), min_size=1, max_size=6), st.integers(0, 1000))
def test_mean_and_deviation_are_those_of_all_samples(sizes: list[int], seed: int) -> None:
    rng, stats = np.random.default_rng(seed), Normaliser(3)
    parts = [rng.normal(2.0, 5.0, (size, 3)) for size in sizes]
    for part in parts:
        stats.update(part)
    whole = np.concatenate(parts)
    assert np.allclose(stats.mean, whole.mean(axis=0)) and np.allclose(stats.var, whole.var(axis=0))
    assert np.allclose(stats.denormalise(stats.normalise(whole)), whole)


def test_with_a_memory_old_samples_fade_and_a_constant_is_not_blown_up() -> None:
    stats = Normaliser(1, memory=10)
    stats.update(np.full(1000, 7.0))
    assert stats.normalise(np.array([7.0])) == 0.0 and stats.std == 1.0
    for _ in range(20):
        stats.update(np.full(10, -1.0))
    assert abs(stats.mean[0] + 1.0) < 1e-3
    stats.update(np.zeros((0, 1)))
    assert stats.count == 10


def test_arrays_come_back_and_what_does_not_fit_changes_nothing() -> None:
    stats, again = Normaliser(3), Normaliser(3)
    stats.update(np.random.default_rng(0).normal(2.0, 5.0, (7, 3)))
    kept = stats.arrays("observations")
    again.load_arrays("observations", kept)
    assert again.count == 7 and (again.mean == stats.mean).all() and (again.var == stats.var).all()
    for broken in ({"observations_variance": np.ones(2)}, {"observations_mean": np.full(3, np.nan)}):
        with pytest.raises(CheckpointError, match=r"observations_.*finite float64"):
            again.load_arrays("observations", kept | {"observations_count": np.array(1.0)} | broken)
        assert again.count == 7 and (again.mean == stats.mean).all()
