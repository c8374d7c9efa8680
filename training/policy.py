"""A learned policy: built from its settings, loaded from a checkpoint, and used as a strategy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ActorCriticPolicy
from torch.distributions import Categorical, Normal

from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.observation.layout import ObservationLayout
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_observation import ViewObserver
from entropy_explore_env.planner.candidate_features import FEATURES_VERSION
from entropy_explore_env.planner.weights import SHIPPED
from entropy_explore_env.settings.scenario import Scenario
from training.advantages import Normaliser
from training.candidate_network import ATTENTION_LAYERS, CandidatePolicy
from training.checkpoints import (
    Checkpoint,
    CheckpointError,
    PolicySettings,
    latest_checkpoint,
    load_checkpoint,
)
from training.networks import VectorFeatures, policy_class, policy_keywords

_SHARED = ("pi_features_extractor.", "vf_features_extractor.")
"""Further names of `features_extractor`, which actor and critic share."""
_NORMALISATION = ("features_extractor.mean", "features_extractor.std")
"""Kept in the checkpoint's normalisation, not among its weights."""
PRETRAINED = Path(__file__).parent / "pretrained"
PREFIX = "pretrained:"
POLICIES = ("best", "step")
"""Kinds of checkpoints, in order of preference."""


def make_policy(
    settings: PolicySettings, schedule: Callable[[float], float] = lambda remaining: 0.0
) -> ActorCriticPolicy:
    """Return a policy with fresh weights, as Stable-Baselines3 trains it."""
    size = ObservationLayout(settings.scenario).size + settings.privileged
    return policy_class(settings.features)(
        spaces.Box(-np.inf, np.inf, (size,), np.float32),
        action_space(settings.scenario),
        schedule,
        **keywords_of(settings),
    )


def keywords_of(settings: PolicySettings) -> dict[str, Any]:
    """Return the `policy_kwargs` of a Stable-Baselines3 policy with these settings."""
    return policy_keywords(
        settings.features,
        settings.scenario,
        settings.hidden,
        settings.privileged,
        settings.attention_layers,
    )


def settings_of_policy(
    scenario: Scenario,
    features: str,
    hidden: tuple[int, ...],
    privileged: int = 0,
    attention_layers: int = ATTENTION_LAYERS,
) -> PolicySettings:
    """Return the settings of a new policy, with the version of its features: see PolicySettings."""
    version = FEATURES_VERSION if features == "candidates" else None
    return PolicySettings(scenario, features, hidden, privileged, version, attention_layers)


def load_policy(checkpoint: Checkpoint) -> ActorCriticPolicy:
    """Return the policy of a checkpoint.

    Raises:
        CheckpointError: Its weights do not fit its settings.
    """
    policy = make_policy(checkpoint.settings)
    load_weights(policy, checkpoint)
    policy.set_training_mode(False)
    return policy


def load_weights(policy: ActorCriticPolicy, checkpoint: Checkpoint) -> None:
    """Put a checkpoint's weights and its normalisation of observations into a policy.

    Raises:
        CheckpointError: They do not fit. Nothing has changed then.
    """
    expected = weights_of(policy)
    for name in expected.keys() | checkpoint.weights.keys():
        given, wanted = checkpoint.weights.get(name), expected.get(name)
        if given is None or wanted is None or given.shape != wanted.shape or given.dtype != wanted.dtype:
            shape = None if given is None else tuple(given.shape)
            allowed = "no such tensor" if wanted is None else f"{tuple(wanted.shape)}, as its settings say"
            raise CheckpointError(f"weights: {name}", shape, allowed)
        if not torch.isfinite(given).all():
            raise CheckpointError(f"weights: {name}", "not finite", "finite numbers")
    size = ObservationLayout(checkpoint.settings.scenario).size + checkpoint.settings.privileged
    stats = Normaliser(size)
    stats.load_arrays("observations", checkpoint.normalisation)
    policy.load_state_dict(checkpoint.weights, strict=False)
    normalise_observations(policy, stats)


def weights_of(policy: ActorCriticPolicy) -> dict[str, torch.Tensor]:
    """Return a policy's weights, each under one name, without the normalisation of observations."""
    named = policy.state_dict().items()
    return {name: each for name, each in named if not name.startswith(_SHARED) and name not in _NORMALISATION}


def normalise_observations(policy: ActorCriticPolicy, stats: Normaliser) -> None:
    """Let a policy's networks see normalised observations; features of candidates are scaled as they are."""
    if isinstance(policy.features_extractor, VectorFeatures):
        policy.features_extractor.normalise_by(stats.mean, stats.std)


def choose_actions(
    policy: ActorCriticPolicy, observations: np.ndarray, rng: torch.Generator | None
) -> np.ndarray:
    """Return the actions for observations, without touching the random state that training draws from.

    Args:
        policy: Chooses; one over candidates always takes its likeliest action, which needs no draw.
        observations: (N, F) float32.
        rng: Draws the actions from the policy's distribution; None = its likeliest actions.

    Returns:
        (N,) int64, or (N, K) float32 within the space's bounds.
    """
    with torch.inference_mode():
        if isinstance(policy, CandidatePolicy):
            return policy.actor(torch.as_tensor(observations)).argmax(dim=1).numpy()
        chosen = policy.get_distribution(torch.as_tensor(observations)).distribution
        if isinstance(chosen, Categorical):
            if rng is None:
                return chosen.logits.argmax(dim=1).numpy()
            return torch.multinomial(chosen.probs, 1, generator=rng)[:, 0].numpy()
        assert isinstance(chosen, Normal)
        actions = chosen.mean
        if rng is not None:
            actions = torch.normal(actions, chosen.stddev, generator=rng)
        return actions.clamp(-1.0, 1.0).numpy()


def panorama_form(kind: str, yaws: int, pitches: int) -> dict[str, dict[str, Any]]:
    """Return the actions and observation of a policy that looks at a panorama, with a ray for each gaze."""
    return {
        "action": {"kind": kind, "moves": "axes", "yaws": yaws, "pitches": pitches},
        "observation": {
            "panorama_yaws": yaws,
            "panorama_pitches": pitches,
            "panorama_utility": "log2",
            "flat": True,
        },
    }


def candidate_form(candidates: int) -> dict[str, Any]:
    """Return the actions and observation of a policy over candidates, the same for all teams and worlds."""
    nothing_else = dict.fromkeys(("panorama", "self_state", "team"), False)
    seen = dict.fromkeys(("candidates", "overlaps", "action_mask", "flat"), True)
    return {
        "action": {"kind": "candidates", "candidates": candidates},
        "observation": {**nothing_else, **seen, "while_busy": False},
    }


class Misfit(NamedTuple):
    """Why a policy cannot act in a scenario: what differs, in the scenario and in that of training."""

    what: str
    given: object
    trained: object


def misfit(scenario: Scenario, trained: Scenario) -> Misfit | None:
    """Return the first reason why a scenario's observations or actions are not training's; None = they are.

    Args:
        scenario: With the observation and the action of training.
        trained: The scenario of training.
    """
    offered, wanted = ObservationLayout(scenario).parts, ObservationLayout(trained).parts
    shapes = {
        name: [parts[name].shape if name in parts else None for parts in (offered, wanted)]
        for name in (*wanted, *offered)
    }
    differing = {name: pair for name, pair in shapes.items() if pair[0] != pair[1]}
    kinds = [len(each.kinds) for each in (scenario, trained)]
    if "team" in differing:
        return Misfit("robots", scenario.robots, trained.robots)
    over_candidates = trained.action.kind == "candidates"
    if scenario.planar != trained.planar and not over_candidates:  # panorama, gazes and moves differ
        return Misfit("motion of the robots", _motion(scenario), _motion(trained))
    if "self" in differing and kinds[0] != kinds[1]:
        return Misfit("kinds of robots", *kinds)
    if "overview" in differing:
        return Misfit("world's voxels", scenario.grid.shape, f"{trained.grid.shape}, of which it saw all")
    for name, (given, fits) in differing.items():
        return Misfit(f"observation {name}", given, fits)
    actions = [action_space(each) for each in (scenario, trained)]
    return Misfit("actions", *actions) if actions[0] != actions[1] else None


def check_same_networks(folder: Path, theirs: PolicySettings, ours: PolicySettings) -> None:
    """Raise a CheckpointError where a policy's weights cannot go on in a policy of other settings.

    Args:
        folder: Of the weights, for the message.
        theirs: Settings that the weights were learned with.
        ours: Settings of the policy that is to begin with them.
    """
    for name in ("features", "hidden", "privileged", "attention_layers"):
        if getattr(theirs, name) != getattr(ours, name):
            raise CheckpointError(f"{folder}: {name}", getattr(theirs, name), f"{getattr(ours, name)}")
    if (differs := misfit(theirs.scenario, ours.scenario)) is not None:
        raise CheckpointError(f"{folder}: {differs.what}", differs.given, f"{differs.trained}")


def _motion(scenario: Scenario) -> str:
    return "in a plane, looking level" if scenario.planar else "flying"


class LearnedPolicy:
    """The strategy of a checkpoint: every robot's policy observes that robot's own RobotView.

    As in training, actions are drawn from the policy's distribution; the mission's random stream for
    strategies seeds the draws. A policy over candidates takes its likeliest ones; its planner draws them from
    that stream.
    """

    def __init__(self, folder: Path) -> None:
        """Read a checkpoint.

        Args:
            folder: A checkpoint, or a run of `training.ppo`, whose best checkpoint is taken.

        Raises:
            CheckpointError: It cannot be used.
        """
        self._checkpoint = load_checkpoint(latest_checkpoint(folder, *POLICIES))
        self._policy = load_policy(self._checkpoint)
        self._folder = folder

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission.

        Raises:
            CheckpointError: The policy was trained for another number of robots, or with observations or
                actions that this scenario does not have.
        """
        trained = self._checkpoint.settings.scenario
        self._observer = ViewObserver(scenario, trained.observation, trained.action, rng)
        reason = misfit(self._observer.scenario, trained)
        if reason is None and scenario.action.by_number and scenario.action != trained.action:
            reason = Misfit("Scenario.action", scenario.action, f"continuous, or {trained.action}")
        if reason is not None:
            allowed = f"{reason.trained}, as the policy was trained"
            raise CheckpointError(f"{self._folder}: {reason.what}", reason.given, allowed)
        self._rng = torch.Generator().manual_seed(int(rng.integers(2**63)))

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoint (5,) of one robot."""
        return self.choose_all([view])[0]

    def choose_all(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """Return the policy's viewpoint for each view."""
        if not views:  # all robots drive
            return []
        observations = np.stack([self._observer.observe(view) for view in views])
        actions = choose_actions(self._policy, observations, self._rng)
        return [self._observer.viewpoint(view, action) for view, action in zip(views, actions, strict=True)]


def policy_folder(name: str) -> Path:
    """Return the folder that a strategy's name means: `pretrained:NAME`, or a folder.

    Raises:
        SettingError: No policy of this name comes with the project.
    """
    if not name.startswith(PREFIX):
        return Path(name)
    known = sorted(path.name for path in PRETRAINED.glob("*") if path.is_dir())
    if name.removeprefix(PREFIX) not in known:
        weights = (file.stem for file in SHIPPED.glob("*.json"))
        raise SettingError("strategy", name, one_of(name, (PREFIX + each for each in (*known, *weights))))
    return PRETRAINED / name.removeprefix(PREFIX)


def make_policy_strategy(name: str) -> LearnedPolicy:
    """Return the strategy of a learned policy.

    Args:
        name: `pretrained:NAME`, or a folder.

    Raises:
        SettingError: There is no such policy.
        CheckpointError: It cannot be used.
    """
    return LearnedPolicy(policy_folder(name))


def policy_files(name: str) -> list[Path]:
    """Return the files that determine, with the code, what a learned policy does: those of its checkpoint."""
    checkpoint = latest_checkpoint(policy_folder(name), *POLICIES)
    return [checkpoint / "policy.json", checkpoint / "policy.safetensors"]
