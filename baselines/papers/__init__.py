"""The papers that the environment builds on, reproduced: `python -m baselines.papers NAME`."""

PAPERS = {
    "rocha04": "baselines.papers.rocha04",
    "rochami": "baselines.papers.rochami",
    "bhattacharya": "baselines.papers.bhattacharya",
    "sawhney": "baselines.papers.sawhney",
    "sujan-planar": "baselines.papers.sujan.planar",
    "sujan-cliff": "baselines.papers.sujan.cliff",
    "sujan-localization": "baselines.papers.sujan.localization",
    "sujan-drift": "baselines.papers.sujan.drift",
    "sujan-sharing": "baselines.papers.sujan.sharing",
    "sujan-summaries": "baselines.papers.sujan.summaries",
}
"""Name of an experiment → the module whose EXPERIMENT it is; names that begin alike are one paper."""
