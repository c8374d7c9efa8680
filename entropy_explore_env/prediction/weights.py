"""Files of a predictor's weights: safetensors, read with NumPy alone and checked to the last byte.

A file is the length of its header (8 bytes, little-endian), the header as JSON, and the numbers. Its header
names the cells and channels that the network was trained on: another library's are refused.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.errors import SettingError, counted
from entropy_explore_env.prediction.crop import CHANNELS, PLANS
from entropy_explore_env.prediction.unet import LEVELS, Form, Layer, Network, layer_shapes

LEARNED = Path(__file__).parent / "learned"
SHIPPED = LEARNED / "plans.safetensors"
"""The weights that come with the library, for plans."""
_MOST_BYTES = 1 << 24
_MOST_HEADER = 1 << 16
_WROTE = "a file that training.map_predictor wrote"


def features_of(form: Form) -> dict[str, str]:
    """Return what a file says of the crops that it was trained on."""
    features = {"cell_m": f"{form.cell_m:g}", "cells": f"{form.cells}", "channels": " ".join(CHANNELS)}
    return {**features, "layers": f"{form.layers}"}


def read_network(file: Path, form: Form = PLANS) -> Network:
    """Read a file of weights of a network of a form.

    Raises:
        SettingError: The file cannot be read, is truncated or of another format, was trained on other cells,
            channels or layers, or holds a number that is not finite.
    """
    header, content = _header_and_content(file)
    _check_features(file, header.pop("__metadata__", None), form)
    expected = _tensor_shapes(form)
    if strange := next((name for name in header if name not in expected), None):
        raise SettingError(f"weights in {file}", strange, "only the layers of this library's network")
    tensors = {name: _tensor(file, header.get(name), content, name, expected[name]) for name in expected}
    if len(content) != sum(tensor.nbytes for tensor in tensors.values()):
        raise SettingError(f"weights in {file}", f"{len(content)} bytes of numbers", _WROTE)
    layers = {
        name: Layer(tensors[f"{name}.weight"].reshape(shape), tensors[f"{name}.bias"])
        for name, shape in layer_shapes(form).items()
    }
    return Network(
        first=tuple(layers[f"first.{level}"] for level in range(LEVELS)),
        second=tuple(layers[f"second.{level}"] for level in range(LEVELS)),
        lift=tuple(layers[f"lift.{level}"] for level in range(LEVELS - 1)),
        merge=tuple(layers[f"merge.{level}"] for level in range(LEVELS - 1)),
        head=layers["head"],
    )


def check_form(network: Network, form: Form) -> None:
    """Raise a SettingError where a network is of another form: kernels read its numbers unchecked."""
    layers = {"head": network.head}
    for part in ("first", "second", "lift", "merge"):
        layers |= {f"{part}.{level}": layer for level, layer in enumerate(getattr(network, part))}
    for name, shape in layer_shapes(form).items():
        numbers = layers[name]
        given = (numbers.weights.shape, numbers.bias.shape, numbers.weights.dtype, numbers.bias.dtype)
        if given != (shape, shape[:1], np.float32, np.float32):
            allowed = f"float32 of {shape}, as networks for crops of {counted(form.layers, 'layer')} have"
            raise SettingError(f"network: {name}", given, allowed)


def _tensor_shapes(form: Form) -> dict[str, tuple[int, ...]]:
    """Return the shape of each tensor of a file, by its name: weights as PyTorch has them, and biases."""
    shapes: dict[str, tuple[int, ...]] = {}
    for name, (outputs, inputs, taps) in layer_shapes(form).items():
        edge = math.isqrt(taps)
        shapes[f"{name}.weight"] = (outputs, inputs, edge, edge)
        shapes[f"{name}.bias"] = (outputs,)
    return shapes


def _header_and_content(file: Path) -> tuple[dict[str, Any], bytes]:
    """Return the header of a file, and the bytes behind it."""
    try:
        size = file.stat().st_size
        content = file.read_bytes() if size <= _MOST_BYTES else b""
    except OSError as error:
        raise SettingError("weights", str(file), f"a file that can be read ({error.strerror})") from None
    length = int.from_bytes(content[:8], "little")
    header: object = None
    if 8 < len(content) and length <= min(_MOST_HEADER, len(content) - 8):
        try:
            header = json.loads(content[8 : 8 + length])
        except (ValueError, RecursionError):
            header = None
    if not isinstance(header, dict):
        raise SettingError("weights", str(file), f"{_WROTE}: safetensors")
    return header, content[8 + length :]


def _check_features(file: Path, said: object, form: Form) -> None:
    """Check that the weights were trained on the crops that this library makes."""
    if not isinstance(said, dict):
        raise SettingError(f"weights in {file}", "no metadata", _WROTE)
    theirs = {"layers": "1", **said}
    for name, ours in features_of(form).items():
        if theirs.get(name) != ours:
            allowed = (
                f"{ours!r}: these weights are for other crops; plans and volumes have weights of their own"
            )
            raise SettingError(f"{file}: {name}", said.get(name), allowed)


def _tensor(file: Path, about: object, content: bytes, name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return a tensor as float32."""
    if not isinstance(about, dict) or about.get("dtype") != "F32" or about.get("shape") != list(shape):
        given = (about.get("dtype"), about.get("shape")) if isinstance(about, dict) else None
        raise SettingError(f"{file}: {name}", given, f"F32 of shape {list(shape)}")
    offsets, size = about.get("data_offsets"), 4 * math.prod(shape)
    if not isinstance(offsets, list) or len(offsets) != 2 or not all(type(at) is int for at in offsets):
        raise SettingError(f"{file}: {name}", offsets, "where its numbers begin and end")
    begin, end = offsets
    if not 0 <= begin <= end <= len(content) or end - begin != size:
        raise SettingError(f"{file}: {name}", offsets, f"{size} bytes of the {len(content)} that are there")
    numbers = np.frombuffer(content[begin:end], "<f4").astype(np.float32).reshape(shape)
    if not np.isfinite(numbers).all():
        raise SettingError(f"{file}: {name}", "a number that is not finite", "finite numbers")
    return numbers
