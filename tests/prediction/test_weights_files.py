"""Files of a predictor's weights: read as they were written, and refused by name where something is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.prediction.crop import PLANS
from entropy_explore_env.prediction.predictor import read_predictor, shipped_predictor
from entropy_explore_env.prediction.unet import layer_shapes
from entropy_explore_env.prediction.volumes import SHIPPED_VOLUMES, VOLUMES, shipped_volume_predictor
from entropy_explore_env.prediction.weights import SHIPPED, features_of, read_network
from tests.prediction.networks import FEATURES, file_bytes, random_tensors, written


def test_numbers_are_those_written(tmp_path):
    tensors = random_tensors(3)
    network = read_network(written(tmp_path / "w", file_bytes(tensors)))
    assert np.array_equal(network.first[2].weights, tensors["first.2.weight"].reshape(64, 32, 9))
    assert np.array_equal(network.merge[0].bias, tensors["merge.0.bias"])
    assert np.array_equal(network.head.weights[:, :, 0], tensors["head.weight"][:, :, 0, 0])


def test_the_file_is_that_of_the_safetensors_package(tmp_path):
    numpy = pytest.importorskip("safetensors.numpy")
    tensors = random_tensors(4)
    network = read_network(written(tmp_path / "w", numpy.save(tensors, FEATURES)))
    assert np.array_equal(network.lift[1].bias, tensors["lift.1.bias"])
    loaded = numpy.load(file_bytes(tensors))
    assert all(np.array_equal(loaded[name], each) for name, each in tensors.items())


def test_the_shipped_weights_are_small_and_read_once():
    for form, file in ((PLANS, SHIPPED), (VOLUMES, SHIPPED_VOLUMES)):
        shapes = layer_shapes(form).values()
        assert sum(outputs * inputs * taps + outputs for outputs, inputs, taps in shapes) <= 700_000
        assert file.stat().st_size < 3 * 2**20
    assert shipped_predictor() is shipped_predictor()
    assert shipped_volume_predictor() is shipped_volume_predictor()


def test_weights_are_those_of_one_form(tmp_path):
    """A file of plans says nothing of layers if an earlier version wrote it."""
    earlier = {name: said for name, said in FEATURES.items() if name != "layers"}
    plans = written(tmp_path / "plans", file_bytes(random_tensors(), earlier))
    volumes = written(tmp_path / "volumes", file_bytes(random_tensors(form=VOLUMES), features_of(VOLUMES)))
    assert read_network(plans).head.weights.shape == (4, 16, 1)
    assert read_network(volumes, VOLUMES).head.weights.shape == (128, 16, 1)
    with pytest.raises(SettingError, match=r"cell_m = '0\.2': expected '0\.4'"):
        read_network(plans, VOLUMES)
    with pytest.raises(SettingError, match=r"cell_m = '0\.4': expected '0\.2'"):
        read_network(volumes)


def changed(**changes: np.ndarray | None) -> bytes:
    tensors = {**random_tensors(), **{name.replace("__", "."): each for name, each in changes.items()}}
    return file_bytes({name: each for name, each in tensors.items() if each is not None})


WHOLE = file_bytes(random_tensors())
NAN = np.where(np.arange(16) == 7, np.nan, 0.0)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (file_bytes(random_tensors(), {**FEATURES, "cell_m": "0.4"}), "cell_m = '0.4': expected '0.2'"),
        (file_bytes(random_tensors(), {**FEATURES, "cells": "64"}), "cells = '64': expected '128'"),
        (file_bytes(random_tensors(), {**FEATURES, "channels": "mean"}), "channels = 'mean'"),
        (file_bytes(random_tensors(), {**FEATURES, "layers": "32"}), "layers = '32': expected '1'"),
        (file_bytes(random_tensors(), {"cells": "128"}), "cell_m = None"),
        (file_bytes(random_tensors(), None), "no metadata"),
        (WHOLE[:-4], "merge.2.bias|head.bias"),
        (WHOLE[:-100_000], "bytes of the"),
        (WHOLE[:500], "safetensors"),
        (WHOLE[:5], "safetensors"),
        (b"", "safetensors"),
        (WHOLE + b"more", "bytes of numbers"),
        (b"\x89PNG\r\n\x1a\n" + bytes(5000), "safetensors"),
        (b'{"weights": {}}' * 40, "safetensors"),
        ((2).to_bytes(8, "little") + b"[]" + bytes(100), "safetensors"),
        (changed(first__0__bias=NAN), "first.0.bias = 'a number that is not finite'"),
        (
            changed(first__0__bias=np.zeros(8)),
            r"first.0.bias = \('F32', \[8\]\): expected F32 of shape \[16\]",
        ),
        (changed(lift__1__weight=None), "lift.1.weight = None"),
        (changed(fourth__weight=np.zeros(3)), "fourth.weight"),
        (WHOLE.replace(b'"F32"', b'"I32"', 1), "first.0.weight"),
        (WHOLE.replace(b'"data_offsets": [0, ', b'"data_offsets": [4, ', 1), "first.0.weight"),
        (WHOLE.replace(b'"data_offsets": [0, ', b'"data_offsets": [[0],', 1), "first.0.weight|safetensors"),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(content, said, tmp_path):
    with pytest.raises(SettingError, match=said) as refused:
        read_predictor(written(tmp_path / "weights.safetensors", content))
    assert "weights.safetensors" in str(refused.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SettingError, match="No such file"):
        read_predictor(tmp_path / "missing.safetensors")
    with pytest.raises(SettingError, match=r"a file that can be read|training\.map_predictor"):
        read_predictor(tmp_path)
