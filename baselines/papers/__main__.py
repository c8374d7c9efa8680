"""Reproduce a paper: `python -m baselines.papers NAME [--quick] [--out DIR] [--json]`.

Runs what is missing of its experiments, judges the paper's claims and writes a page of each experiment.
Their rows are kept in --runs, a table an experiment: what was stopped goes on where it was.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from baselines.cli.arguments import make_folder, parse, print_json, run_command, told_command
from baselines.cli.options import Mark
from baselines.cli.worker_options import TrialOptions
from baselines.papers import PAPERS
from entropy_explore_env.errors import SettingError, one_of

if TYPE_CHECKING:
    from baselines.experiments.experiment import Experiment

_NOT_TOLD = ("--out", "--runs", "--jobs", "--cluster", "--json", "--rerun", "--since")
"""Options that a page does not tell."""


@dataclass
class Args(TrialOptions):
    """Reproduce a paper."""

    paper: Annotated[str, Mark.POSITIONAL] = "rocha04"
    """rocha04, rochami, bhattacharya, sawhney or sujan; of Sujan also one of its six experiments, such as
    sujan-cliff."""
    quick: bool = False
    """Fewer seeds and cells."""
    seeds: int | None = None
    """Missions a cell, the same seeds in every cell; default: as many as the page says."""
    out: Path = Path("results/papers")
    """Folder for the pages, their figures and claims."""
    runs: Path = Path("results/papers/rows")
    """Folder that keeps the rows."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    names = [name for name in PAPERS if name == args.paper or name.startswith(f"{args.paper}-")]
    if not names:
        raise SettingError("paper", args.paper, one_of(args.paper, [*PAPERS, "sujan"]))
    how = args.how(args.paper, args.json)
    experiments = [find_experiment(name) for name in names]
    amounts = [each.amount(args.quick, args.seeds) for each in experiments]
    make_folder("out", args.out)
    make_folder("runs", args.runs)
    from baselines.experiments.claims import terminal_claims
    from baselines.experiments.experiment import reproduce

    options = [word for word in words if word != args.paper]
    command = told_command(f"python -m baselines.papers {args.paper}", options, _NOT_TOLD)
    found = {}
    for experiment, amount in zip(experiments, amounts, strict=True):
        table, started = args.runs / f"{experiment.name}.jsonl", time.perf_counter()
        claims = reproduce(experiment, amount, table, how, args.out, command)
        wall_s = round(time.perf_counter() - started, 1)
        found[experiment.name] = {"claims": [claim.row() for claim in claims], "wall_s": wall_s}
        if not args.json:
            print(f"{experiment.title}\n{terminal_claims(claims)}\n")
    if args.json:
        print_json({"paper": args.paper, "experiments": found})
    return 0


def find_experiment(name: str) -> Experiment:
    """Return the experiment with a name of PAPERS."""
    return importlib.import_module(PAPERS[name]).EXPERIMENT


if __name__ == "__main__":
    raise SystemExit(run_command(main))
