"""Rocha, Dias and Carvalho 2004, reproduced: `python -m baselines.papers rocha04`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from baselines.experiments.experiment import Experiment, cut_off
from baselines.papers.rocha04 import claims, figures
from baselines.papers.rocha04.sweep import experiment

EXPERIMENT = Experiment(
    name="rocha04",
    title="Rocha04",
    template=Path(__file__).with_name("page.md.j2"),
    trials=experiment,
    claims=claims.all_claims,
    groups=claims.GROUPS,
    figures={
        "figure-3": figures.figure_3,
        "figure-4": figures.figure_4,
        "figure-5": partial(figures.figure_time, what="burst"),
        "figure-6": partial(figures.figure_time, what="I_min"),
        "figure-7": partial(figures.figure_shared, what="burst"),
        "figure-8": partial(figures.figure_shared, what="I_min"),
    },
    tables={"teams": claims.teams_table},
    values={"cut off": cut_off},
    seeds=100,
    quick_seeds=10,
)
