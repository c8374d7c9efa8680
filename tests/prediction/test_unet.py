"""The compiled U-Net against NumPy in double precision, and against PyTorch; kernels on planes by hand."""

from __future__ import annotations

import numpy as np
import pytest

from entropy_explore_env.prediction.crop import PLANS
from entropy_explore_env.prediction.predictor import new_predicting
from entropy_explore_env.prediction.unet import Layer, convolve, fill_unmeasured, infer, new_planes
from entropy_explore_env.prediction.weights import read_network
from tests.prediction.networks import file_bytes, random_tensors, written
from tests.reference import prediction as reference


def drawn_cells(seed: int) -> np.ndarray:
    """Channels as of a crop: patches of free, solid and unmeasured cells, and a border outside."""
    rng = np.random.default_rng(seed)
    kinds = rng.integers(0, 3, (16, 16)).repeat(8, axis=0).repeat(8, axis=1)
    cells = np.stack([kinds == 0, kinds == 1, np.zeros_like(kinds)]).astype(np.float32)
    cells[:, :20], cells[2, :20] = 0.0, 1.0
    cells[:2] *= rng.choice([0.25, 0.5, 1.0], cells[:2].shape).astype(np.float32)
    return cells


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    file = written(tmp_path_factory.mktemp("network") / "w.safetensors", file_bytes(random_tensors()))
    return read_network(file)


def logits(network, cells) -> np.ndarray:
    """The logits of a crop, (N, N), put together from their planes."""
    predicting = new_predicting(network)
    infer(network, predicting.planes, cells)
    parts = predicting.planes.logits.reshape(2, 2, 66, 66)[:, :, 1:-1, 1:-1]
    return parts.transpose(2, 0, 3, 1).reshape(128, 128)


@pytest.mark.parametrize("seed", range(2))
def test_logits_are_those_of_numpy(network, seed):
    cells = drawn_cells(seed)
    expected = reference.logits(random_tensors(), cells)[0]
    assert expected.std() > 0.3
    np.testing.assert_allclose(logits(network, cells), expected, atol=2e-4 * np.abs(expected).max())


def test_logits_are_those_of_pytorch(network):
    torch = pytest.importorskip("torch")
    from training.map_predictor import UNet

    model = UNet(PLANS)
    model.load_state_dict({name: torch.from_numpy(each) for name, each in random_tensors().items()})
    cells = drawn_cells(5)
    with torch.no_grad():
        expected = model(torch.from_numpy(cells)[None])[0, 0].numpy()
    np.testing.assert_allclose(logits(network, cells), expected, atol=2e-4 * np.abs(expected).max())


def test_memory_of_earlier_crops_changes_no_bit(network):
    used, planes = new_predicting(network), new_planes(PLANS)
    for seed in range(3):
        infer(network, used.planes, drawn_cells(seed))
    infer(network, planes, drawn_cells(2))
    assert np.array_equal(used.planes.logits, planes.logits)
    for mine, fresh in zip(used.planes.outer, planes.outer, strict=True):
        assert np.array_equal(mine, fresh)


def test_a_convolution_by_hand():
    """A plane of side 2 with 1 2 / 3 4, weights 1 … 9, bias -40: 0s around, sums below 0 become 0."""
    image = np.zeros((1, 16), np.float32)
    image[0, [5, 6, 9, 10]] = 1.0, 2.0, 3.0, 4.0
    layer = Layer(np.arange(1, 10, dtype=np.float32).reshape(1, 1, 9), np.array([-40.0], np.float32))
    out = np.zeros((1, 16), np.float32)
    convolve(image, layer, 2, out)
    expected = np.zeros((4, 4))  # 5·1 + 6·2 + 8·3 + 9·4 = 77, 4·1 + 5·2 + 7·3 + 8·4 = 67 and so on
    expected[1:3, 1:3] = [[37.0, 27.0], [7.0, 0.0]]
    assert np.array_equal(out.reshape(4, 4), expected)


def test_only_what_was_not_measured_is_predicted(network):
    predicting = new_predicting(network)
    infer(network, predicting.planes, drawn_cells(4))
    solid = np.where(drawn_cells(9)[0] > 0.0, -1.0, 0.125).astype(np.float32)
    before = solid.copy()
    fill_unmeasured(predicting.planes, solid[None])
    assert (solid[before >= 0.0] == 0.125).all()
    expected = 1.0 / (1.0 + np.exp(-logits(network, drawn_cells(4)).astype(float)))
    np.testing.assert_allclose(solid[before < 0.0], expected[before < 0.0], rtol=1e-6)
