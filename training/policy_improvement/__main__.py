"""Learn in stages to choose better than a planner among the viewpoints that it proposes.

    python -m training.policy_improvement --tasks room-furnished:3 --out runs/improved

1. `labels`: what choosing another candidate would have saved, by roll-outs from states of the planner's
   missions. 2. `regression`: the residual learns that. 3. `search`: weights of features, by whole missions.
4. `ppo`: PPO from there, rewarded by less the seconds. `--stage` does one of them, by default all are done,
one after the other; `search` and `ppo` begin with what the last one before them wrote, else with the
planner, and the search with any policy that `--begin` names. What is there already is not done again, so
that the same command continues a run that was stopped; every stage ends with a comparison with the planner,
paired by start.
`python -m training.evaluate --strategy runs/improved/search` evaluates what a stage came to.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from entropy_explore_env.command import INTERRUPTED
from entropy_explore_env.missions.observation.layout import ObservationLayout
from entropy_explore_env.missions.privileged import PRIVILEGED
from entropy_explore_env.planner.candidate_features import COLUMNS
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.writing import write_atomically
from training import extra, ppo  # noqa: F401 - extra: before what is not there without it
from training.candidate_network import CandidatePolicy
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
    policy_folder,
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
from training.policy_improvement.search import SEARCHED, SearchSettings, search
from training.policy_improvement.stage_options import Args, check
from training.policy_improvement.tasks import task_of
from training.run_folder import FILE

RESULT, _BEGINNING = "result.json", "begins-with.txt"
_STOPPED = "the shard that is under way is written first; of a search what is done is there already"


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check(args)
    tasks = [task_of(name, args.candidates) for name in args.tasks]
    torch.set_num_threads(args.threads)
    wanted = tuple(_RUN) if args.stage == "all" else (args.stage,)
    if "ppo" in wanted:
        check_ppo(ppo_stage(args), tasks[0])  # before the stages that it comes after
    if wanted != ("ppo",):
        label_settings(args, tasks)  # refuses --policy before anything is written
    if args.begin:
        _policy_in(policy_folder(args.begin), described(args, tasks))  # refused before anything is written
    results: dict[str, Any] = {}
    for stage in wanted:
        make_folder("out", args.out / stage)
        with Interruption(_STOPPED) as interruption:
            result = _RUN[stage](args, tasks, interruption)
        if result is None:
            return _say_stopped(args, words)
        results[stage] = result
        _say(args, f"{stage}: {result.get('line', 'done')}")
        for compared in result.get("compared", []):
            _say(args, f"  {compared['line']}")
    if args.json:
        print_json(results)
    return 0


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
    return settings_of_policy(tasks[0], "candidates", (args.width,), len(PRIVILEGED), args.attention_layers)


def learn_labels(args: Args, tasks: list[Scenario], interruption: Interruption) -> dict[str, Any] | None:
    """Stage 2."""
    settings, led_by = label_settings(args, tasks)
    labels = read_labels(settings, args.out / "labels", args.shards)
    learning = RegressionSettings(args.epochs, args.batch, args.learning_rate, seed=args.seed)
    digest = _digest(settings.origin, args.shards, learning, args.width, args.attention_layers, args.compared)
    if (known := _known(args.out / "regression", digest)) is not None:
        return known
    torch.manual_seed(args.seed)
    policy = make_policy(described(args, tasks))
    assert isinstance(policy, CandidatePolicy)
    if led_by is not None:  # a further round goes on from the policy that led the missions
        policy.load_state_dict(led_by.state_dict())
    result, returns = regress(policy, labels, learning)
    found = {**as_json(result), "line": result.line()}
    _save(args, tasks, "regression", policy, found, returns)
    return _finished(args, tasks, "regression", policy, found, digest)


def search_weights(args: Args, tasks: list[Scenario], interruption: Interruption) -> dict[str, Any] | None:
    """Stage 3; None if Ctrl-C stopped it."""
    folder, settings_of = args.out / "search", described(args, tasks)
    before = _beginning_of_search(args)
    torch.manual_seed(args.seed)
    policy = make_policy(settings_of) if before is None else _policy_in(before, settings_of)
    assert isinstance(policy, CandidatePolicy)
    begins = "" if before is None else weights_digest(policy)
    settings = SearchSettings(tuple(tasks), args.rounds, args.pairs, args.sigma, args.step, args.seed, begins)
    digest = _digest(settings.origin, args.width, args.attention_layers, args.compared)
    if (known := _known(folder, digest)) is not None:
        return known
    result = search(
        policy,
        settings,
        folder,
        args.threads,
        args.at_once,
        lambda: interruption.asked,
        lambda line: _say(args, line),
    )
    if result is None:
        return None
    with torch.no_grad():
        policy.actor.weights.add_(torch.as_tensor(result.weights, dtype=torch.float32))
    weights = policy.actor.weights.tolist()
    found = {
        "weights": {name: weights[COLUMNS[name]] for name in SEARCHED},
        "rounds": result.rounds,
        "tasks": list(args.tasks),
        "line": result.line(),
        "begins": begins,
    }
    returns = Normaliser()
    if before is not None:
        beginning = load_checkpoint(before)
        returns.load_arrays("returns", beginning.normalisation)  # the scale of what its critic learned
        if "search" in beginning.progress:
            found["before"] = beginning.progress["search"]
    _save(args, tasks, "search", policy, found, returns)
    return _finished(args, tasks, "search", policy, found, digest)


def learn_by_ppo(args: Args, tasks: list[Scenario], interruption: Interruption) -> dict[str, Any] | None:
    """Stage 4; None if Ctrl-C stopped it."""
    folder = args.out / "ppo"
    started = _beginning_of_ppo(args)
    weights = "" if started is None else weights_digest(_policy_in(started))
    digest = _digest(weights, ppo_words(ppo_stage(args), tasks[0]), args.compared)
    if (known := _known(folder, digest)) is not None:
        return known
    begun = (folder / FILE).is_file()
    _check_beginning(folder, weights, begun)
    words = ppo_words(ppo_stage(args), tasks[0])
    words += [] if started is None else ["--start", str(started.absolute())]
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


_RUN = {"labels": label, "regression": learn_labels, "search": search_weights, "ppo": learn_by_ppo}
"""The stages, one after the other."""


def _written(args: Args, stage: str) -> Path | None:
    """The checkpoint that a stage wrote; None = it did not."""
    folder = args.out / stage
    return latest_checkpoint(folder, *POLICIES) if any(folder.glob("best-*")) else None


def _beginning_of_search(args: Args) -> Path | None:
    """The checkpoint that the search begins with; None = the planner.

    Raises:
        CheckpointError: There is none where `--begin` says.
    """
    if args.begin:
        return latest_checkpoint(policy_folder(args.begin), *POLICIES)
    return _written(args, "regression")


def _beginning_of_ppo(args: Args) -> Path | None:
    """The checkpoint that PPO begins with: the search's, else the regression's; None = the planner.

    Raises:
        CheckpointError: The search began with another policy than it would today.
    """
    searched, before = _written(args, "search"), _beginning_of_search(args)
    if searched is None:
        return before
    begins = "" if before is None else weights_digest(_policy_in(before))
    if load_checkpoint(searched).progress["search"].get("begins") != begins:
        allowed = "those that it would begin with today: run --stage search again, or remove its folder"
        raise CheckpointError(f"{searched}: weights that it began with", "others", allowed)
    return searched


def _save(
    args: Args,
    tasks: list[Scenario],
    stage: str,
    policy: CandidatePolicy,
    found: dict[str, Any],
    returns: Normaliser,
) -> None:
    """Write what a stage came to as a checkpoint."""
    observed = Normaliser(ObservationLayout(tasks[0]).size + len(PRIVILEGED))
    statistics = observed.arrays("observations") | returns.arrays("returns")
    folder = args.out / stage / checkpoint_name("best", 0)
    progress = {"steps": 0, stage: found}
    save_checkpoint(folder, Checkpoint(described(args, tasks), progress, weights_of(policy), statistics))


def ppo_stage(args: Args) -> PpoStage:
    """What the options say of the last stage."""
    networks = (args.candidates, args.width, args.attention_layers)
    return PpoStage(*networks, args.seed, args.ppo_steps, args.ppo_options)


def _check_beginning(folder: Path, weights: str, begun: bool) -> None:
    """Note which weights a run of PPO begins with; one that is begun goes on with no others.

    Raises:
        CheckpointError: The run in the folder began with other weights.
    """
    noted = folder / _BEGINNING
    if begun and noted.is_file() and noted.read_text("utf-8").strip() != weights:
        allowed = (
            "those that the run in it began with: the stage before is another one since; remove the folder"
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
    write_atomically(args.out / stage / RESULT, text + "\n")
    return result


def _known(folder: Path, digest: str) -> dict[str, Any] | None:
    """What a stage came to that was done with the same options; None = it is to be done."""
    try:
        known = json.loads((folder / RESULT).read_text("utf-8"))
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
