"""Networks of random weights, and files of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.prediction.crop import PLANS
from entropy_explore_env.prediction.unet import Form, layer_shapes
from entropy_explore_env.prediction.weights import features_of

FEATURES = features_of(PLANS)


def random_tensors(seed: int = 0, form: Form = PLANS) -> dict[str, np.ndarray]:
    """Weights and biases by their names in files, such that activations neither vanish nor grow."""
    rng, tensors = np.random.default_rng(seed), {}
    for name, (outputs, inputs, taps) in layer_shapes(form).items():
        edge = 3 if taps == 9 else 1
        scale = (2.0 / (inputs * taps)) ** 0.5
        weights = scale * rng.standard_normal((outputs, inputs, edge, edge))
        tensors[f"{name}.weight"] = weights.astype(np.float32)
        tensors[f"{name}.bias"] = (0.2 * rng.standard_normal(outputs)).astype(np.float32)
    return tensors


def file_bytes(tensors: Mapping[str, np.ndarray], metadata: Mapping[str, Any] | None = FEATURES) -> bytes:
    """A safetensors file, written by the format's description alone."""
    header: dict[str, Any] = {} if metadata is None else {"__metadata__": dict(metadata)}
    content = b""
    for name, numbers in tensors.items():
        packed = numbers.astype("<f4").tobytes()
        offsets = [len(content), len(content) + len(packed)]
        header[name] = {"dtype": "F32", "shape": list(numbers.shape), "data_offsets": offsets}
        content += packed
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + content


def written(file: Path, content: bytes) -> Path:
    """The file, with this content."""
    file.write_bytes(content)
    return file
