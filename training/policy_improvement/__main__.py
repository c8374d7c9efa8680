"""Learn in three stages to choose better than a planner among the viewpoints that it proposes.

    python -m training.policy_improvement --tasks room-furnished:3 --out runs/improved

1. `labels`: what choosing another candidate would have saved, by roll-outs from states of the planner's
   missions. 2. `regression`: the residual learns that. 3. `ppo`: PPO from there, rewarded by less the
seconds. `--stage` does one of them, by default all are done, one after the other. What is there already is
not done again, so that the same command continues a run that was stopped; every stage ends with a comparison
with the planner, paired by start. `python -m training.evaluate --strategy runs/improved/ppo` evaluates the
result, `runs/improved/regression` that of the second stage.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import torch

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from entropy_explore_env.command import INTERRUPTED
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.observation.layout import ObservationLayout
from entropy_explore_env.missions.privileged import PRIVILEGED
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check_whole, is_whole
from entropy_explore_env.writing import write_atomically
from training import extra, ppo  # noqa: F401 - extra: before what is not there without it
from training.candidate_network import WIDTH, CandidatePolicy, check_width
from training.checkpoints import (
    Checkpoint,
    PolicySettings,
    checkpoint_name,
    latest_checkpoint,
    load_checkpoint,
    save_checkpoint,
)
from training.errors import CheckpointError
from training.interruption import Interruption
from training.normalisation import Normaliser
from training.policy import (
    POLICIES,
    check_same_networks,
    load_policy,
    make_policy,
    settings_of_policy,
    weights_of,
)
from training.policy_improvement.comparison import compare_with_planner
from training.policy_improvement.labelling import (
    LabelSettings,
    planner_acts,
    policy_acts,
    read_labels,
    weights_digest,
    write_labels,
)
from training.policy_improvement.ppo_stage import PpoStage, check_ppo, ppo_words
from training.policy_improvement.regression import RegressionSettings, as_json, regress
from training.policy_improvement.rollouts import RollOutEffort
from training.policy_improvement.tasks import task_of
from training.run_folder import FILE

STAGES = ("labels", "regression", "ppo")
_RESULT, _BEGINNING = "result.json", "begins-with.txt"
_STOPPED = "the shard that is under way is written first"


@dataclass
class Args:
    """Learn to choose better than a planner among the viewpoints that it proposes."""

    tasks: tuple[str, ...] = ("room-furnished:3",)
    """Named scenarios with their robots, NAME:ROBOTS; files of labels are dealt to them in turn, PPO learns
    in the first."""
    out: Path = Path("runs/improved")
    """Folder of the run, with a folder of each stage."""
    stage: Literal["labels", "regression", "ppo", "all"] = "all"
    """What to do; a stage needs what those before it wrote."""
    seed: int = 0
    """Seed of missions, weights and all other draws."""
    threads: int = 2
    """Threads for missions and for learning."""
    candidates: int = 24
    """Viewpoints that the planner proposes at most."""
    width: int = WIDTH
    """Units of each candidate in the networks."""
    compared: int = 64
    """Starts on which each stage's policy is compared with the planner; 0 = it is not."""
    json: bool = False
    """Print one JSON object and nothing else."""

    shards: int = 16
    """Files of labels."""
    missions: int = 4
    """Missions of a file of labels."""
    every: int = 40
    """One decision of so many is labelled, on average."""
    branches: int = 8
    """Candidates that are tried at a state, the planner's choice among them."""
    draws: int = 4
    """Random numbers over which a label is averaged."""
    horizon: int = 30
    """Decisions a robot until the learned time to go stands for the rest of a roll-out; 0 = never."""
    divisor: int = 4
    """So many times fewer viewpoints are drawn and refined in roll-outs."""
    states: int = 2
    """States whose roll-outs run at once: each takes branches × draws missions' memory."""
    policy: Path | None = None
    """A run whose policy leads the missions that are labelled; default: the planner."""

    epochs: int = 60
    """Passes over the labels."""
    batch: int = 128
    """States in a minibatch of the regression."""
    learning_rate: float = 1e-3
    """Of the regression."""

    ppo_steps: int = 200_000
    """Steps of PPO, counted per robot."""
    ppo_options: str = ""
    """Further options of training.ppo in one text: `--ppo-options='--batch 256 --clip 0.1'`."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check(args)
    tasks = [task_of(name, args.candidates) for name in args.tasks]
    torch.set_num_threads(args.threads)
    wanted = STAGES if args.stage == "all" else (args.stage,)
    if "ppo" in wanted:
        check_ppo(ppo_stage(args), tasks[0])  # before the stages that it comes after
    if wanted != ("ppo",):
        label_settings(args, tasks)  # refuses --policy before anything is written
    results: dict[str, Any] = {}
    for stage in wanted:
        make_folder("out", args.out / stage)
        with Interruption(_STOPPED) as interruption:
            run = {"labels": label, "regression": learn_labels, "ppo": learn_by_ppo}[stage]
            result = run(args, tasks, interruption)
        if result is None:
            return _say_stopped(args, words)
        results[stage] = result
        _say(args, f"{stage}: {result.get('line', 'done')}")
        for compared in result.get("compared", []):
            _say(args, f"  {compared['line']}")
    if args.json:
        print_json(results)
    return 0


def check(args: Args) -> None:
    """Raise a SettingError where an option is out of its range."""
    for name in (
        "threads",
        "shards",
        "missions",
        "every",
        "divisor",
        "states",
        "epochs",
        "batch",
        "ppo_steps",
    ):
        check_whole(name, getattr(args, name), 1)
    for name in ("seed", "horizon", "compared"):
        check_whole(name, getattr(args, name), 0)
    check_whole("candidates", args.candidates, 2)
    if not is_whole(args.branches, 2, args.candidates):
        raise SettingError(
            "branches", args.branches, f"a whole number from 2 to {args.candidates}, the candidates"
        )
    check_whole("draws", args.draws, 1)
    check_width(args.width)
    if not 0.0 < args.learning_rate < float("inf"):
        raise SettingError("learning_rate", args.learning_rate, "a number above 0")
    if not args.tasks:
        raise SettingError("tasks", args.tasks, "at least one NAME:ROBOTS")


def label(args: Args, tasks: list[Scenario], interruption: Interruption) -> dict[str, Any] | None:
    """Stage 1; None if Ctrl-C stopped it."""
    settings, policy = label_settings(args, tasks)
    acts = planner_acts if policy is None else policy_acts(policy)
    folder = args.out / "labels"
    written = write_labels(
        settings,
        folder,
        args.shards,
        args.threads,
        acts,
        lambda: interruption.asked,
        lambda line: _say(args, line),
    )
    if written < args.shards:
        return None
    states = len(read_labels(settings, folder, args.shards).observations)
    return {"states": states, "line": f"{states} states in {args.shards} files"}


def label_settings(args: Args, tasks: list[Scenario]) -> tuple[LabelSettings, CandidatePolicy | None]:
    """What decides the labels, and the policy whose missions are labelled; None = the planner.

    Raises:
        CheckpointError: The policy cannot be read, or its networks or candidates are others.
    """
    policy = None if args.policy is None else _policy_in(args.policy, described(args, tasks))
    settings = LabelSettings(
        tuple(tasks),
        args.missions,
        args.branches,
        args.draws,
        RollOutEffort(args.horizon, args.divisor),
        args.every,
        args.states,
        args.seed,
        "" if policy is None else weights_digest(policy),
    )
    return settings, policy


def described(args: Args, tasks: list[Scenario]) -> PolicySettings:
    """Settings of the policy that is learned."""
    return settings_of_policy(tasks[0], "candidates", (args.width,), len(PRIVILEGED))


def learn_labels(args: Args, tasks: list[Scenario], interruption: Interruption) -> dict[str, Any] | None:
    """Stage 2."""
    settings, led_by = label_settings(args, tasks)
    labels = read_labels(settings, args.out / "labels", args.shards)
    learning = RegressionSettings(args.epochs, args.batch, args.learning_rate, seed=args.seed)
    digest = _digest(settings.origin, args.shards, learning, args.width, args.compared)
    if (known := _known(args.out / "regression", digest)) is not None:
        return known
    torch.manual_seed(args.seed)
    policy = make_policy(described(args, tasks))
    assert isinstance(policy, CandidatePolicy)
    if led_by is not None:  # a further round goes on from the policy that led the missions
        policy.load_state_dict(led_by.state_dict())
    result, returns = regress(policy, labels, learning)
    observed = Normaliser(ObservationLayout(tasks[0]).size + len(PRIVILEGED))
    statistics = observed.arrays("observations") | returns.arrays("returns")
    found = {**as_json(result), "line": result.line()}
    progress = {"steps": 0, "regression": found}
    folder = args.out / "regression" / checkpoint_name("best", 0)
    save_checkpoint(folder, Checkpoint(described(args, tasks), progress, weights_of(policy), statistics))
    return _finished(args, tasks, "regression", policy, found, digest)


def learn_by_ppo(args: Args, tasks: list[Scenario], interruption: Interruption) -> dict[str, Any] | None:
    """Stage 3; None if Ctrl-C stopped it."""
    folder = args.out / "ppo"
    started = latest_checkpoint(args.out / "regression", *POLICIES)
    weights = weights_digest(_policy_in(started))
    digest = _digest(weights, ppo_words(ppo_stage(args), tasks[0]), args.compared)
    if (known := _known(folder, digest)) is not None:
        return known
    begun = (folder / FILE).is_file()
    _check_beginning(folder, weights, begun)
    words = [*ppo_words(ppo_stage(args), tasks[0]), "--start", str(started.absolute())]
    words += ["--resume" if begun else "--out", str(folder)]
    shown = contextlib.redirect_stdout(io.StringIO()) if args.json else contextlib.nullcontext()
    with shown:
        ended = ppo.main([*words, "--threads", str(args.threads), *(["--json"] if args.json else [])])
    if ended == INTERRUPTED:
        return None
    policy = _policy_in(folder)
    curve = (folder / "curve.csv").read_text("utf-8").strip().splitlines()
    found = {"line": f"{args.ppo_steps:,} steps, {len(curve) - 1} validations"}
    return _finished(args, tasks[:1], "ppo", policy, found, digest)


def ppo_stage(args: Args) -> PpoStage:
    """What the options say of the third stage."""
    return PpoStage(args.candidates, args.width, args.seed, args.ppo_steps, args.ppo_options)


def _check_beginning(folder: Path, weights: str, begun: bool) -> None:
    """Note which weights a run of PPO begins with; one that is begun goes on with no others.

    Raises:
        CheckpointError: The run in the folder began with other weights.
    """
    noted = folder / _BEGINNING
    if begun and noted.is_file() and noted.read_text("utf-8").strip() != weights:
        allowed = (
            "those that the run in it began with: the regression is another one since; remove the folder"
        )
        raise CheckpointError(f"{folder}: weights to begin with", f"{weights[:12]}…", allowed)
    write_atomically(noted, weights + "\n")


def _finished(
    args: Args, tasks: list[Scenario], stage: str, policy: CandidatePolicy, found: dict[str, Any], digest: str
) -> dict[str, Any]:
    """Compare a stage's policy with the planner, and write down what came out."""
    compared = []
    for task in tasks if args.compared else []:
        comparison = compare_with_planner(policy, task, args.compared, args.threads)
        compared.append({**comparison.as_json(), "line": comparison.line()})
    result = {**found, "compared": compared}
    text = json.dumps({"digest": digest, "result": result}, indent=1, allow_nan=False)
    write_atomically(args.out / stage / _RESULT, text + "\n")
    return result


def _known(folder: Path, digest: str) -> dict[str, Any] | None:
    """What a stage came to that was done with the same options; None = it is to be done."""
    try:
        known = json.loads((folder / _RESULT).read_text("utf-8"))
        return known["result"] if known["digest"] == digest else None
    except (OSError, ValueError, LookupError, TypeError):
        return None


def _digest(*options: object) -> str:
    return hashlib.sha256(repr(options).encode()).hexdigest()


def _policy_in(folder: Path, wanted: PolicySettings | None = None) -> CandidatePolicy:
    """The policy of a run.

    Raises:
        CheckpointError: There is none, or it is not over candidates, or not of the settings that are wanted.
    """
    checkpoint = load_checkpoint(latest_checkpoint(folder, *POLICIES))
    if wanted is not None:
        check_same_networks(folder, checkpoint.settings, wanted)
    policy = load_policy(checkpoint)
    if not isinstance(policy, CandidatePolicy):
        raise CheckpointError(f"{folder}: features", checkpoint.settings.features, "candidates")
    return policy


def _say(args: Args, line: str) -> None:
    if not args.json:
        print(line, flush=True)


def _say_stopped(args: Args, words: Sequence[str]) -> int:
    again = shlex.join(["python", "-m", "training.policy_improvement", *words])
    if args.json:
        print_json({"interrupted": True, "resume": again})
    else:
        print(f"stopped; the same command goes on:\n\n    {again}\n")
    return INTERRUPTED


if __name__ == "__main__":
    raise SystemExit(run_command(main))
