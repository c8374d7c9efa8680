"""Rocha's coordination by mutual information, reproduced: `python -m baselines.papers rochami`."""

from __future__ import annotations

from pathlib import Path

from baselines.experiments.experiment import Experiment, cut_off
from baselines.papers.rochami import claims, figures
from baselines.papers.rochami.sweep import experiment

EXPERIMENT = Experiment(
    name="rochami",
    title="RochaMI",
    template=Path(__file__).with_name("page.md.j2"),
    trials=experiment,
    claims=claims.all_claims,
    groups=claims.GROUPS,
    figures={
        "figure-6": figures.figure_6,
        "figure-7": figures.figure_7,
        "sharing": figures.figure_sharing,
    },
    tables={"teams": claims.teams_table},
    values={"cut off": cut_off},
    seeds=50,
    quick_seeds=10,
    least_seeds=2,
)
