"""Weights of the planner's features: what one candidate is worth beside another, learned from whole missions.

The logit of candidate k is what the planner says of it, and a weighted sum of its features f,

    l_k = β ln s_k + m [k = c] + w · f_k,

where c is the planner's own choice and s_k ≤ 1 what it holds k to be worth, as a share of c. A robot takes
the candidate with the largest logit; with w = 0 that is the planner's choice. `training.search` finds w.
A file of weights is a JSON object with the fields of PlannerWeights.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.planner.candidate_features import COLUMNS, FEATURES_VERSION
from entropy_explore_env.settings.validation import is_number, is_whole

SHIPPED = Path(__file__).parent / "learned"
"""Folder of the weights that come with the library, as NAME.json."""
BETA = 8.0
"""β: a score that is a tenth smaller halves the odds."""
MARGIN = 0.1
"""m, so that the planner's choice also leads where others have its score."""
CANDIDATES = 12
"""Viewpoints that the planner proposes at most."""
_LEAST_SCORE = 1e-3
"""Smaller scores count as this one."""
_MOST_CANDIDATES = 64
_SCORE, _CHOSEN = COLUMNS["score"], COLUMNS["chosen"]


@dataclass(frozen=True)
class PlannerWeights:
    """What a planner that chooses by weights is made of.

    Attributes:
        weights: Name of a feature → w; 0 for those that are left out.
        beta, margin: β and m.
        candidates: Viewpoints that are proposed at most.
        features_version: `FEATURES_VERSION` of the features that were weighed.
        tasks: NAME:ROBOTS of the missions that the weights were found in.
    """

    weights: Mapping[str, float] = field(default_factory=dict)
    beta: float = BETA
    margin: float = MARGIN
    candidates: int = CANDIDATES
    features_version: int = FEATURES_VERSION
    tasks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check all fields.

        Raises:
            SettingError: A field is not allowed, or the features are not those of this library.
        """
        if self.features_version != FEATURES_VERSION or isinstance(self.features_version, bool):
            allowed = f"{FEATURES_VERSION}: these weights are of other features than this library's"
            raise SettingError("PlannerWeights.features_version", self.features_version, allowed)
        if not isinstance(self.weights, Mapping):
            raise SettingError("PlannerWeights.weights", self.weights, "names of features and their weights")
        for name, weight in self.weights.items():
            if name not in COLUMNS:
                raise SettingError("PlannerWeights.weights", name, one_of(str(name), COLUMNS))
            if not is_number(weight) or math.isinf(weight):
                raise SettingError(f"PlannerWeights.weights: {name}", weight, "a finite number")
        for name in ("beta", "margin"):
            value = getattr(self, name)
            if not is_number(value) or not 0.0 <= value < math.inf:
                raise SettingError(f"PlannerWeights.{name}", value, "a finite number ≥ 0")
        if not is_whole(self.candidates, 1, _MOST_CANDIDATES):
            allowed = f"a whole number from 1 to {_MOST_CANDIDATES}"
            raise SettingError("PlannerWeights.candidates", self.candidates, allowed)
        if not isinstance(self.tasks, tuple) or not all(isinstance(task, str) for task in self.tasks):
            raise SettingError("PlannerWeights.tasks", self.tasks, "texts NAME:ROBOTS")

    def row(self) -> np.ndarray:
        """Return w (F,) in the order of `candidate_features.FEATURES`."""
        row = np.zeros(len(COLUMNS))
        for name, weight in self.weights.items():
            row[COLUMNS[name]] = weight
        return row

    def choices(self, features: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """Return the numbers (N,) int64 of the candidates that N robots take.

        Args:
            features: (N, K, F) float32 of their candidates.
            counts: (N,) int64, how many of these there are; the first one is the planner's own choice.
        """
        best = np.zeros(len(features), np.int64)
        _fill_choices(features, counts, self.row(), (float(self.beta), float(self.margin)), best)
        return best

    def text(self) -> str:
        """Return the JSON of a file of these weights."""
        fields = {
            "features_version": self.features_version,
            "tasks": list(self.tasks),
            "candidates": self.candidates,
            "beta": self.beta,
            "margin": self.margin,
            "weights": dict(self.weights),
        }
        return json.dumps(fields, indent=1, allow_nan=False) + "\n"


@lean_kernel
def _fill_choices(features, counts, weights, scaling, best):
    """Fill in the number of the candidate with the largest logit, the first one of equals.

    Args:
        features: (N, K, F) float32.
        counts: (N,) int64, how many candidates there are.
        weights: (F,) float64.
        scaling: (β, m).
        best: (N,) int64, filled in.
    """
    beta, margin = scaling
    for robot in range(len(features)):
        best[robot] = 0
        largest = -np.inf
        for k in range(counts[robot]):
            own = features[robot, k]
            logit = beta * math.log(min(max(np.float64(own[_SCORE]), _LEAST_SCORE), 1.0))
            logit += margin * own[_CHOSEN]
            for number in range(len(own)):
                logit += weights[number] * own[number]
            if logit > largest:
                largest, best[robot] = logit, k


def read_weights(file: Path) -> PlannerWeights:
    """Read a file of weights.

    Raises:
        SettingError: It cannot be read, is none, or is of other features.
    """
    fields = _read_object(file)
    known = PlannerWeights.__dataclass_fields__
    if (strange := next((name for name in fields if name not in known), None)) is not None:
        raise SettingError(f"weights in {file}", strange, one_of(strange, known))
    if missing := [name for name in ("features_version", "weights") if name not in fields]:
        raise SettingError(f"weights in {file}", f"no {missing[0]}", "a file that training.search wrote")
    if isinstance(fields.get("tasks"), list):
        fields["tasks"] = tuple(fields["tasks"])
    try:
        return PlannerWeights(**fields)
    except SettingError as error:
        name = error.field.removeprefix("PlannerWeights.")
        raise SettingError(f"{file}: {name}", error.value, error.allowed) from None


def _read_object(file: Path) -> dict[str, Any]:
    try:
        fields = json.loads(file.read_text("utf-8"))
    except OSError as error:
        raise SettingError("weights", str(file), f"a file that can be read ({error.strerror})") from None
    except (ValueError, RecursionError):
        fields = None
    if not isinstance(fields, dict):
        raise SettingError("weights", str(file), "a file that training.search wrote: JSON with an object")
    return fields


def shipped_weights(name: str) -> PlannerWeights:
    """Return the weights with this name that come with the library.

    Raises:
        SettingError: There are none.
    """
    names = sorted(path.stem for path in SHIPPED.glob("*.json"))
    if name not in names:
        raise SettingError("weights", name, one_of(name, names))
    return read_weights(SHIPPED / f"{name}.json")
