"""Train a policy with RLlib's PPO, for many cores or machines; one policy drives every robot.

    python -m training.rllib_ppo --scenario room --robots 3 --runners 2 --out runs/rllib-room

Runs on this machine, or with `--address HOST:PORT` on a Ray cluster (`ray start --head`). Networks,
advantages and normalisation are those of `training.ppo`; only steps in which a robot chose are learned from:
`envs.rllib_env` says how. The folder gets `run.json` (the options), `progress.csv` (a row for each
iteration), `curve.csv` (a row for each validation), the best policy, which `training.evaluate` and
`baselines.run` take as a strategy, and RLlib's checkpoints, of which `--resume FOLDER` takes the latest, with
the run's options. These are pickles: load only your own.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

import contextlib
import csv
import math
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.cli.interruption import Interruption
from baselines.cli.task_options import (
    base_task,
    is_whole_scenario,
    parsed_for,
    settled,
    tasked,
)
from baselines.experiments.tables import csv_table
from entropy_explore_env.command import INTERRUPTED
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training import extra  # noqa: F401 - before what is not there without it
from training.checkpoints import NotFiniteError, SilentRunnersError
from training.rllib_run import (
    FIGURES,
    POLICY,
    SAMPLE_TIMEOUT_S,
    check_address,
    configure,
    environment_settings,
    policy_of,
    start_ray,
)
from training.runs import (
    FILE,
    LearningOptions,
    check_new,
    check_options,
    resume_command,
    resumed_options,
    save_options,
    told,
)
from training.validation import OWN

if TYPE_CHECKING:
    from training.rllib_run import RunValidation
    from training.validation import Validation

_MODULE = "training.rllib_ppo"
_CHANGEABLE = frozenset(("total_steps", "address", "runners", "checkpoint_every", "validate_every"))
"""Options that may differ where a run is continued."""
_STOPPED = "a checkpoint is written when this iteration is done"
MOST_SILENT = 3
"""Iterations in a row in which no runner reports, before the run ends."""
LOSSES = ("total_loss", "policy_loss", "vf_loss", "entropy")


@dataclass
class Args(LearningOptions):
    """Train a policy with RLlib's PPO."""

    usual: ClassVar = (
        *("scenario", "robots", "runners", "missions", "total_steps", "seed", "world", "settings"),
        *("time_limit_s", "features", "batch", "address", "out", "resume"),
    )

    total_steps: int = 1_000_000
    """Robots' decisions to train for."""
    out: Path | None = None
    """Folder of a new run; default: runs/rllib-SCENARIO-ROBOTS."""
    address: str | None = None
    """HOST:PORT of a Ray cluster, or auto for that of this machine; by default this machine alone."""
    runners: int = 2
    """Processes that collect experience; 0: the trainer itself does."""
    missions: int = 32
    """Missions in each runner."""

    features: Literal["gazes", "vector"] = "gazes"
    """vector: an MLP; gazes: also a small network for gazes, over the panorama."""
    batch: int = 8192
    """Decisions in an iteration."""
    minibatch: int = 1024
    """Decisions in a minibatch."""

    validate_every: int = 100_000
    """Decisions between two validations; there is one at the end."""
    checkpoint_every: int = 10
    """Iterations between two checkpoints; there is one after the first, and one at the end or at Ctrl-C."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parsed(words)
    if (resume := args.resume) is not None:
        args, changed = resumed_options(Args, resume, words, _CHANGEABLE, __doc__, settled_arguments)
        print(f"{resume}: {_where(resume)}{told(changed)}", file=sys.stderr)
    named = base_task(args.scenario, args.task.settings, OWN).scenario
    args.out = args.out or Path("runs") / f"rllib-{named.name}-{args.robots}"
    if args.cost_per_s is None:
        args.cost_per_s = named.reward.cost_per_s
    check(args)
    env_settings = environment_settings(args)
    if args.resume is None:
        check_new(args.out, (args.out / FILE).exists() or last_checkpoint(args.out) is not None)
        make_folder("out", args.out)
    ray = start_ray(args.address, args.runners)
    try:
        if args.resume is None:
            save_options(args.out, args, _MODULE, words)
        with Interruption(_STOPPED) as interruption:
            done = train(args, env_settings, interruption)
    finally:
        ray.shutdown()
    if not done:
        command = resume_command(_MODULE, args.out)
        print(f"stopped, with a checkpoint in {args.out}; go on with\n\n    {command}\n")
        return INTERRUPTED
    return 0


def _where(folder: Path) -> str:
    """Return where a run continues, as the end of a message."""
    checkpoint = last_checkpoint(folder)
    if checkpoint is None:
        return "no checkpoint: from the beginning"
    return f"goes on after {iterations_of(checkpoint)} iterations"


def check(args: Args) -> None:
    """Raise a SettingError where an option is out of its range."""
    check_options(args)
    check_whole("runners", args.runners, 0)
    check_whole("minibatch", args.minibatch, 1)
    if args.minibatch > args.batch:
        raise SettingError("minibatch", args.minibatch, f"at most the batch, {args.batch}")
    check_address(args.address)


def parsed(words: Sequence[str]) -> Args:
    """Return the arguments of a command line; what is not given is the scenario's own.

    Raises:
        UsageError: The words do not fit.
        SettingError: There is no such scenario.
    """
    first = parse(Args, words, description=__doc__)
    task = base_task(first.scenario, first.task.settings, OWN)
    robots = {"robots": task.scenario.robots} if is_whole_scenario(first.task.settings) else {}
    return settled_arguments(parsed_for(task, first, words, **robots))


def settled_arguments(args: Args) -> Args:
    """Return the same arguments wherever the run is continued.

    Raises:
        SettingError: A file of JSON does not hold what it should.
    """
    return replace(args, task=settled(args.task))


def train(args: Args, env_settings: dict[str, Any], interruption: Interruption) -> bool:
    """Train, and write progress and checkpoints; False if Ctrl-C ended it early.

    Raises:
        NotFiniteError: A loss is not finite; the last checkpoint stays.
    """
    import torch

    from entropy_explore_env.envs.rllib_env import EntropyExploreMultiAgentEnv
    from training.rllib_run import RunValidation
    from training.validation import Validator

    assert args.out is not None
    torch.set_num_threads(1)  # minibatches are small: where runners take the other cores, two are slower
    checkpoint = last_checkpoint(args.out)
    iterations = 0 if checkpoint is None else iterations_of(checkpoint)
    warm_up = EntropyExploreMultiAgentEnv(env_settings)  # compiles the kernels, which every runner would
    observations, _ = warm_up.reset(seed=0)
    warm_up.step({agent: warm_up.action_spaces[agent].sample() for agent in observations})
    settings = policy_of(args, env_settings)
    around = tasked(settings.scenario, args.task, args.robots)[1]
    validator = Validator(settings.scenario, around, args.validation_missions, threads=1)
    validation = RunValidation(args.out, settings, validator, args.validate_every)
    algorithm = configure(args, env_settings, iterations).build_algo()
    try:
        if checkpoint is not None:
            algorithm.restore_from_path(str(checkpoint.resolve()))
        return iterate(args, algorithm, iterations, interruption, validation)
    finally:
        algorithm.stop()
        validation.close()
        with contextlib.suppress(OSError):
            Path(algorithm.logdir).rmdir()  # RLlib makes a folder in the home folder and leaves it empty


def iterate(
    args: Args,
    algorithm: Any,  # noqa: ANN401 - RLlib's Algorithm
    iteration: int,
    interruption: Interruption,
    validation: RunValidation,
) -> bool:
    """Repeat rollout and update until all steps are done, or until Ctrl-C, which returns False.

    Args:
        args: The command's.
        algorithm: RLlib's Algorithm.
        iteration: How many are done already.
        interruption: Says whether to stop.
        validation: Validates the policy when that is due.

    Raises:
        NotFiniteError: A loss is not finite.
        SilentRunnersError: No runner has reported for some iterations.
    """
    assert args.out is not None
    begun, steps, silent, started = iteration, 0, 0, time.perf_counter()
    done = rewind(args.out / "progress.csv", begun)
    if done is not None:
        validation.resume(done)
    while steps < args.total_steps:
        result = algorithm.train()
        if decisions_of(result) == steps:
            silent += 1
            if silent == MOST_SILENT:
                raise SilentRunnersError(args.runners, MOST_SILENT * SAMPLE_TIMEOUT_S, steps)
            print(f"{steps:>11,} decisions  no runner has reported: once more", file=sys.stderr, flush=True)
            if interruption.asked:
                if iteration > begun:
                    save_checkpoint(algorithm, args.out, iteration)
                return False
            continue
        iteration, silent = iteration + 1, 0
        row = progress_row(result, iteration, args.robots)
        steps = int(row["decisions"])
        row["seconds"] = round(time.perf_counter() - started, 1)
        append_row(args.out / "progress.csv", row)
        print(progress_line(row), file=sys.stderr, flush=True)
        for name in LOSSES:
            if not math.isfinite(row[name]):
                raise NotFiniteError(name, row[name], steps)
        if steps >= min(validation.next_at, args.total_steps):
            reached = {name: row[name] for name in ("decisions", "robot_steps", "seconds")}
            found = validation.validate(reached, algorithm.learner_group.get_weights()[POLICY])
            print(validation_line(steps, found), file=sys.stderr, flush=True)
        due = iteration % args.checkpoint_every == 0 or iteration == begun + 1
        if due or steps >= args.total_steps or interruption.asked:
            save_checkpoint(algorithm, args.out, iteration)
        if interruption.asked and steps < args.total_steps:
            return False
    return True


def decisions_of(result: dict[str, Any]) -> float:
    """Return the number of decisions of robots since the run began, from RLlib's result."""
    return sum(result["env_runners"].get("num_agent_steps_sampled_lifetime", {}).values())


def progress_row(result: dict[str, Any], iteration: int, robots: int) -> dict[str, float]:
    """Return a row of progress.csv from RLlib's result; figures of missions are NaN until one has ended.

    `robot_steps` are those of `training.ppo`: steps of the environment times robots.
    """
    runners, learner = result["env_runners"], result["learners"][POLICY]
    row: dict[str, float] = {
        "iteration": iteration,
        "decisions": decisions_of(result),
        "robot_steps": robots * runners["num_env_steps_sampled_lifetime"],
    }
    row["return"] = float(runners.get("episode_return_mean", math.nan)) / robots
    row.update({name: float(runners.get(name, math.nan)) for name in FIGURES})
    row.update({name: float(learner[name]) for name in LOSSES})
    return row


def progress_line(row: dict[str, float]) -> str:
    """Return an iteration as the terminal shows it."""
    begin = f"{row['decisions']:>11,.0f} decisions"
    if math.isnan(row["t_mission_s"]):
        return f"{begin}  no mission has ended yet"
    ended = f"missions of {row['t_mission_s']:,.0f} s, {row['finished']:.0%} finished"
    return f"{begin}  return {row['return']:>7.3f}  {ended}"


def validation_line(steps: int, found: Validation) -> str:
    """Return a validation as the terminal shows it."""
    took = f"missions take {found.median_s:,.1f} s (median), {found.finished:.0%} finished"
    return f"{steps:>11,} decisions  validated: {took}"


def append_row(path: Path, row: dict[str, float]) -> None:
    """Add a row to a CSV file."""
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, row)
        if new:
            writer.writeheader()
        writer.writerow(row)


def rewind(path: Path, iteration: int) -> int | None:
    """Remove the rows of a CSV file after an iteration; return the decisions so far, None without a row."""
    rows = []
    if path.is_file():
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                whole = row["iteration"].isdigit() and None not in row.values()  # a killed run may cut one
                if whole and int(row["iteration"]) <= iteration:
                    rows.append(row)
    if not rows:
        path.unlink(missing_ok=True)
        return None
    write_atomically(path, csv_table({name: [row[name] for row in rows] for name in rows[0]}))
    return int(float(rows[-1]["decisions"]))


def last_checkpoint(folder: Path) -> Path | None:
    """Return the latest whole checkpoint; None where there is none."""
    return max(folder.glob("checkpoint-[0-9]*[0-9]"), default=None)


def iterations_of(checkpoint: Path) -> int:
    """Return after how many iterations a checkpoint was written."""
    return int(checkpoint.name.rpartition("-")[2])


def save_checkpoint(algorithm: Any, folder: Path, iteration: int) -> None:  # noqa: ANN401 - RLlib's Algorithm
    """Write a checkpoint, whole or not at all, and then remove the one before it."""
    before = last_checkpoint(folder)
    unfinished = folder / "unfinished-checkpoint"
    shutil.rmtree(unfinished, ignore_errors=True)
    algorithm.save_to_path(str(unfinished.resolve()))
    unfinished.replace(folder / f"checkpoint-{iteration:06}")
    if before is not None:
        shutil.rmtree(before)


if __name__ == "__main__":
    sys.exit(run_command(main))
