"""The page of the policies' results, part by part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from baselines.experiments.outcome import Record
from baselines.experiments.tables import markdown_table
from baselines.scoreboard.page import ARCHIVE, CONFIRMED
from training.checkpoints import latest_checkpoint, load_checkpoint
from training.policy import POLICIES, policy_folder
from training.policy_improvement.policy_tests import BEST, TESTS, Compared, Test, compared, strategies_of

FILES = "policy"
"""Folder beside the page, with one of each policy: its part of the page, and its missions."""


class Experiments(NamedTuple):
    """Tables of other commands, in Markdown; empty where they were not run."""

    headroom: str
    ablations: str


Found = Mapping[tuple[str, str, str], Sequence[Record]]


def page_parts(policies: Sequence[str], experiments: Experiments) -> list[str]:
    """The page, part by part."""
    parts = [
        "# Policies that choose among a planner's candidates\n",
        "The policies "
        f"come from `make policy`. Each runs beside the recommended strategy, `{BEST}`, on the same starts, "
        "in worlds of the test split; the dungeons have no splits, and none was learned in. A ratio is the "
        "policy's over that of the other: below 1 the policy is faster. Intervals are 95 %, of a bootstrap "
        "paired by start; worst tenth is the ratio of the 90th percentiles; ms a decision are on the clock. "
        "In the dungeons the path counts, as with their authors, elsewhere the mission's time; a mission "
        "that was not finished counts with its time limit, and with the path that could be driven in it. A "
        "goal holds if the ratio of medians is at most the goal, for goals below 1 also its interval ends "
        "below 1, the worst tenth is at most 1.00, and the policy finished no fewer missions than the other. "
        "In ms a decision the number in brackets is what the policy's cost over the other's: 2 was wanted at "
        "most.\n",
    ]
    if experiments.headroom:
        parts += [_TO_WIN, experiments.headroom]
    parts += policies
    if experiments.headroom and experiments.ablations:
        parts += [_WHY]
    if experiments.ablations:
        parts += [_ABLATIONS, experiments.ablations]
    return parts


_TO_WIN = """## What there is to win

Written by `python -m training.policy_improvement.headroom --out docs/results/policy/headroom` with
`--scenario` and `--robots`, in worlds of training: geometric means of mission times over those of the
planner, on the same starts. The planner takes its own choice among the candidates that policies choose
among. The clairvoyant tries the eight best of them in branches, and keeps the best: no policy can know what
it knows. At one decision of so many it branches, to the end of the mission or some decisions deep, led by a
planner that draws fewer viewpoints where the table says so; such a branch is not quite what will happen, so
that it can lose, too. This is an estimate from 8 to 12 starts and a part of the decisions: intervals reach
from losses to gains of 17 %, and no bar is set by it. Caves, 3-D offices and dungeons were not measured.
Discrete actions are those of `training.ppo`, 784 in a volume and 80 in a plan.
"""


_WHY = """## Why goals are missed

Three experiments say most.

- **There is little to win by choosing better among the same candidates.** A clairvoyant that looks one choice
  ahead is not clearly faster than the planner in any of the three tasks that were measured ([what there is to
  win](#what-there-is-to-win)).
- **Labels say little about one decision.** At labelled states of `office` with one robot a label is uncertain
  by 3 to 4 s, where the best of eight branches saves 0.5 to 6 s. The regression lowers the loss on missions
  that were held out by 1 to 8 %.
- **Seeds of the learning differ by more than its parts do.** The whole, three times, came to 0.99, 1.01 and
  1.05 of the planner's time, and no stage, network or reward tells itself from the others ([what the stages
  are worth](#what-the-stages-are-worth)). These runs had less than a fifth of a whole training's budget.
"""


_ABLATIONS = """## What the stages are worth

Written by `python -m training.policy_improvement.ablations --out docs/results/policy/ablations`: the stages
without one of them, at small cost, on several seeds of labels, weights and missions. Ratios are of mission
times to those of the planner whose candidates are chosen among, in worlds of validation, paired by start,
geometric means.
"""


def policy_parts(name: str, found: Found, seeds: int, confirmed: bool) -> list[str]:
    """The part of a policy."""
    policy, flags, said = f"pretrained:{name}", f" --seeds {seeds}", ""
    if confirmed:
        flags, said = f"{flags} --confirm", CONFIRMED
    learned = [test for test in TESTS[name] if test.learned]
    others = [test for test in TESTS[name] if not test.learned]
    return [
        f"## `{policy}`\n",
        f"Written by `python -m training.policy_improvement.results_page --policies {name}{flags} "
        f"--out docs/results`.{said} All missions lie in [`{ARCHIVE}`]({FILES}/{name}/{ARCHIVE}).\n",
        _how_learned(policy),
        f"In tasks that it learned, in other worlds, against `{BEST}`:\n",
        _table(name, learned, found),
        f"In tasks, teams and other settings that it did not learn, against `{BEST}`:\n",
        _table(name, others, found),
        _missed(name, found),
        _SAID_OF[name],
    ]


def _missed(name: str, found: Found) -> str:
    """Which goals do not hold, and by how much."""
    said = []
    for test in TESTS[name]:
        ours, theirs = (found.get((name, test.title, each), ()) for each in strategies_of(name))
        result = compared(test, ours, theirs) if test.goal is not None and theirs else None
        if result is not None and test.goal is not None and not result.holds(test.goal):
            said.append(f"- {test.title}, over `{BEST}`: {_shortfall(result, test.goal)}")
    return "Goals that do not hold, and by how much:\n\n" + "\n".join(said) + "\n" if said else ""


def _shortfall(result: Compared, goal: float) -> str:
    """What of a goal is missed."""
    ratio, parts = result.measured.ratio, []
    if ratio.value > goal:
        digits = 2 if round(ratio.value, 2) > goal else 4
        parts.append(f"{ratio.value:.{digits}f} where {goal:.2f} was asked")
    if goal < 1.0 <= ratio.high:
        parts.append(f"the interval ends at {ratio.high:.2f}")
    if round(result.measured.worst_tenth, 2) > 1.0:
        parts.append(f"the worst tenth takes {result.measured.worst_tenth:.2f} of the other's")
    if result.finished[0] < result.finished[1]:
        parts.append(f"{result.finished[1] - result.finished[0]} missions fewer were finished")
    return "; ".join(parts)


_SAID_OF: Mapping[str, str] = {
    "plans": (
        "What a mission asks for decides. These missions end when the map's entropy is low, but for the "
        "dungeons. Where a plan is to be seen whole, the recommended strategy visits frontier cells on "
        "tours, and the policy, which weighs expected bits, drives farther than it: see `pretrained:plans` "
        "among the plans of [the scoreboard](scoreboard.md#plans-until-everything-is-seen). It does not "
        "replace "
        f"`{BEST}`. [A film](../training.md#better-than-the-planner-in-stages) shows both in one office.\n\n"
        "Up to commit `aefa487`, which holds their code, two more strategies stood here. In the three tasks "
        "that it learned the policy took 0.99, 0.91 and 0.98 of the time of the planner's own choice among "
        "the same candidates, and 0.72 (0.68 … 0.75), 0.69 (0.62 … 0.75) and 0.67 (0.61 … 0.73) of that of "
        "`information-rate-v0`.\n"
    ),
    "volumes": (
        "In building 079, a scanned corridor that nothing learned in, the policy and the others stand in "
        "[the scoreboard](scoreboard.md#volumes-and-offices-until-the-map-is-known).\n\n"
        "Up to commit `aefa487`, which holds their code, two more strategies stood here. In the three tasks "
        "that it learned the policy took 1.00, 1.00 and 0.99 of the time of the planner's own choice among "
        "the same candidates, and 0.89 (0.87 … 0.90), 0.77 (0.73 … 0.83) and 0.79 (0.74 … 0.81) of that of "
        "`information-rate-v0`.\n"
    ),
}
"""What a reader of a policy's tables has to know besides."""


def _table(name: str, tests: Sequence[Test], found: Found) -> str:
    """Return the policy against the recommended strategy, a row a task."""
    head = ["task", "starts", "finished", "policy", "other"]
    head += ["ratio of medians", "mean of ratios", "worst tenth", "ms a decision", "goal", "holds"]
    rows = []
    for test in tests:
        ours, theirs = (found[name, test.title, each] for each in strategies_of(name))
        result = compared(test, ours, theirs)
        if result is not None:
            rows.append(_row(test, result, test.goal))
    return markdown_table(head, rows)


def _row(test: Test, result: Compared, goal: float | None) -> list[str]:
    unit = "m" if test.measure.figure == "path_m" else "s"
    own, other = (f"{median:,.0f} {unit}" for median in result.measured.medians)
    return [
        test.title,
        str(result.starts),
        "{} and {}".format(*result.finished),
        own,
        other,
        result.measured.ratio.text(),
        result.measured.mean_ratio.text(),
        f"{result.measured.worst_tenth:.2f}",
        _costs(*result.decision_ms),
        "" if goal is None else f"≤ {goal:.2f}",
        "" if goal is None else "yes" if result.holds(goal) else "no",
    ]


def _costs(ours_ms: float, theirs_ms: float) -> str:
    times = f" ({ours_ms / theirs_ms:.1f})" if theirs_ms > 0.0 else ""
    return f"{ours_ms:.1f} and {theirs_ms:.1f}{times}"


def _how_learned(policy: str) -> str:
    """What the search came to, as the checkpoint says it."""
    progress = load_checkpoint(latest_checkpoint(policy_folder(policy), *POLICIES)).progress
    learned = progress.get("search")
    if not learned:
        return ""
    searches = [learned]
    while "before" in searches[0]:
        searches.insert(0, searches[0]["before"])
    rows = [
        [str(number), ", ".join(one.get("tasks", ())), f"{each['mean_s']:.1f} s", f"{each['slope']:.3f}"]
        for one in searches
        for number, each in enumerate(one["rounds"], start=1)
    ]
    head = ["round", "tasks", "missions take", "slope"]
    if not any(one.get("tasks") for one in searches):  # checkpoints did not always hold them
        head.remove("tasks")
        rows = [[number, *figures] for number, _, *figures in rows]
    heaviest = sorted(learned["weights"].items(), key=lambda item: -abs(item[1]))
    words = ", ".join(f"{name} {weight:+.2f}" for name, weight in heaviest)
    return (
        "How the search went: mission times (geometric mean over its tasks, around the weights of the "
        "round), and by which share they fall with a step of σ against the slope. Each round has other "
        "starts, so that the times of two rounds are no pair.\n\n"
        + markdown_table(head, rows)
        + f"\nWeights of features, in the logits: {words}.\n"
    )
