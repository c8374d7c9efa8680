"""Shards of labels: what was written comes back, and what cannot be used is refused by name."""

from __future__ import annotations

import tracemalloc
import zipfile

import numpy as np
import pytest

from tests.training.policy_improvement.test_regression import labels
from training.errors import LabelsError
from training.policy_improvement.origin import Origin
from training.policy_improvement.shards import Labels, load_shard, save_shard, shard_file

HERE = Origin("a" * 64, "b" * 64)


def test_labels_come_back_as_they_were_written(tmp_path):
    told, file = labels(1.0, states=20), shard_file(tmp_path, 3)
    save_shard(file, told, HERE, [2**63 + 5])
    back = load_shard(file, HERE)
    assert file.name == "labels-00003.npz" and [each.name for each in tmp_path.iterdir()] == [file.name]
    for name, array in told._asdict().items():
        assert np.array_equal(array, getattr(back, name), equal_nan=array.dtype.kind == "f"), name
    both = Labels.joined([told, back])
    assert len(both.observations) == 40 and np.array_equal(both.candidates[20:], told.candidates)


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        (HERE._replace(code="c" * 64), "version of the code"),
        (HERE._replace(settings="c" * 64), "these options"),
    ],
)
def test_labels_of_other_code_or_settings_are_refused(tmp_path, origin, said):
    file = shard_file(tmp_path, 0)
    save_shard(file, labels(1.0, states=5), HERE, [1])
    with pytest.raises(LabelsError, match=said):
        load_shard(file, origin)


def test_a_small_file_cannot_fill_the_memory(tmp_path):
    """300 MiB of zeros in 300 kB; no array is made of them."""
    file = shard_file(tmp_path, 0)
    file.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("observations.npy", bytes(300 << 20))
    assert file.stat().st_size < 2 << 20
    tracemalloc.start()
    with pytest.raises(LabelsError, match="its arrays are compressed"):
        load_shard(file, HERE)
    assert tracemalloc.get_traced_memory()[1] < 20 << 20
    tracemalloc.stop()


def test_broken_shards_are_refused(tmp_path):
    file, told = shard_file(tmp_path, 0), labels(1.0, states=5)
    save_shard(file, told, HERE, [1])
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(LabelsError, match="as it was written"):
        load_shard(file, HERE)
    with pytest.raises(LabelsError, match="as it was written"):
        load_shard(tmp_path / "none.npz", HERE)
    np.savez(file, format=np.zeros(1))
    with pytest.raises(LabelsError, match="head"):
        load_shard(file, HERE)
    changes = {
        "seconds": told.seconds[:, :, :2],
        "to_go_s": told.to_go_s.astype(np.float64),
        "at_end": np.full_like(told.at_end, np.nan),
    }
    for name, array in changes.items():
        save_shard(file, told._replace(**{name: array}), HERE, [1])
        with pytest.raises(LabelsError):
            load_shard(file, HERE)
