"""What networks see of an observation: panorama, own state and team as numbers, maps through convolutions.

Observations are flat vectors; a layout says where each part lies.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

from entropy_explore_env.missions.observation import ObservationLayout, Part

_MAPS = ("patch", "overview")
_HIDDEN = ("action_mask",)
"""Parts that are not looked at."""
_MOST = 10.0
"""Scaled numbers are clipped to this: what was never seen in training must not drown the rest."""


class VectorFeatures(BaseFeaturesExtractor):
    """The parts that are no maps, scaled: the default, for an MLP."""

    places: torch.Tensor
    mean: torch.Tensor
    deviation: torch.Tensor

    def __init__(self, space: spaces.Box, layout: ObservationLayout) -> None:
        """Look at all parts but maps.

        Args:
            space: Of flat observations.
            layout: Where their parts lie.
        """
        chosen = [part for name, part in layout.parts.items() if name not in (*_MAPS, *_HIDDEN)]
        places = np.concatenate([np.arange(part.start, part.stop) for part in chosen])
        super().__init__(space, len(places))
        self.register_buffer("places", torch.as_tensor(places), persistent=False)
        self.register_buffer("mean", torch.zeros(layout.size), persistent=False)
        self.register_buffer("deviation", torch.ones(layout.size), persistent=False)

    def rescale(self, mean: np.ndarray, deviation: np.ndarray) -> None:
        """Take over means and deviations (F,) of flat observations."""
        self.mean.copy_(torch.as_tensor(mean))
        self.deviation.copy_(torch.as_tensor(deviation))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Features (N, K) of observations (N, F)."""
        scaled = (observations - self.mean) / self.deviation
        return scaled.index_select(1, self.places).clamp(-_MOST, _MOST)


class MapFeatures(VectorFeatures):
    """Besides the vector, the patch around the robot and the overview through small convolutions.

    Maps that are one voxel high are two-dimensional, and so are their convolutions. Maps hold numbers from
    0 to 1 and are not scaled.
    """

    def __init__(
        self, space: spaces.Box, layout: ObservationLayout, channels: int = 16, features: int = 64
    ) -> None:
        """Look at everything.

        Args:
            space: Of flat observations.
            layout: Where their parts lie.
            channels: Of the first convolution; the second has twice as many.
            features: That each map comes to.
        """
        super().__init__(space, layout)
        self._maps: dict[str, Part] = {name: layout.parts[name] for name in _MAPS if name in layout.parts}
        self.convolutions = nn.ModuleDict(
            {name: _convolution(part.shape, channels, features) for name, part in self._maps.items()}
        )
        self._features_dim += features * len(self._maps)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Features (N, K) of observations (N, F)."""
        seen = [super().forward(observations)]
        for name, part in self._maps.items():
            cells = observations[:, part.start : part.stop].reshape(-1, *part.shape)
            flat = part.shape[3] == 1
            seen.append(self.convolutions[name](cells[..., 0] if flat else cells))
        return torch.cat(seen, dim=1)


def _convolution(shape: tuple[int, ...], channels: int, features: int) -> nn.Module:
    """(N, C, x, y[, z]) maps to (N, features)."""
    flat = shape[3] == 1
    convolution = nn.Conv2d if flat else nn.Conv3d
    layers = nn.Sequential(
        convolution(shape[0], channels, 3, padding=1),
        nn.ReLU(),
        convolution(channels, 2 * channels, 3, stride=2, padding=1),
        nn.ReLU(),
        nn.Flatten(),
    )
    with torch.no_grad():
        size = layers(torch.zeros(1, *(shape[:3] if flat else shape))).shape[1]
    return nn.Sequential(layers, nn.Linear(size, features), nn.ReLU())


FEATURES: Mapping[str, type[VectorFeatures]] = {"vector": VectorFeatures, "maps": MapFeatures}
"""By the name that settings have for them."""


def policy_settings(features: str, layout: ObservationLayout, hidden: tuple[int, ...]) -> dict[str, Any]:
    """`policy_kwargs` of a Stable-Baselines3 policy: orthogonal weights, tanh, actor and critic apart."""
    return {
        "features_extractor_class": FEATURES[features],
        "features_extractor_kwargs": {"layout": layout},
        "net_arch": list(hidden),
        "activation_fn": nn.Tanh,
        "ortho_init": True,
    }
