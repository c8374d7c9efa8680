"""Bhattacharya, Michael and Kumar 2010, reproduced: `python -m baselines.papers bhattacharya`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from baselines.experiments.experiment import Experiment
from baselines.papers.bhattacharya import claims, figures
from baselines.papers.bhattacharya.sweep import experiment

EXPERIMENT = Experiment(
    name="bhattacharya",
    title="Bhattacharya",
    template=Path(__file__).with_name("page.md.j2"),
    trials=experiment,
    claims=claims.all_claims,
    groups=claims.GROUPS,
    figures={
        "figure-2": figures.figure_2,
        "figure-3": figures.figure_3,
        "figure-4": figures.figure_4,
        "figure-6-paper": partial(figures.figure_6, variant="paper", settings="the paper's settings"),
        "figure-6-nearest-length": partial(
            figures.figure_6, variant="nearest-length", settings="plain cells, nearest target"
        ),
        "progress": figures.figure_progress,
    },
    tables={
        "coverage": claims.coverage_table,
        "exploration": claims.exploration_table,
        "split": claims.split_table,
        "channel": claims.channel_table,
    },
    seeds=20,
    quick_seeds=5,
)
