"""The rows about learning say what was timed."""

from __future__ import annotations

from benchmarks.learning import PARTS, learning_rounds, learning_rows
from benchmarks.rows import QUICK

TINY = "--scenario box-7x11x5 --robots 2 --missions 2 --rollout-steps 8 --hidden 8 --validation-missions 1"


def test_rounds_are_those_after_the_first_and_their_parts_add_up() -> None:
    found = learning_rounds((1, 2), 3, tuple(TINY.split()))
    assert list(found) == [1, 2] and all(len(rounds) == 3 for rounds in found.values())
    for each in [each for rounds in found.values() for each in rounds]:
        assert each["steps"] == 2 * 2 * 8 and all(each[part] > 0.0 for part in PARTS)
        assert sum(each[part] for part in PARTS) < each["seconds"]


def test_shares_add_up_and_goals_are_judged() -> None:
    rows = {(row.job, row.peer): row for row in learning_rows(QUICK, tuple(TINY.split()))}
    shares = [row.ours for row in rows.values() if row.unit == "%"]
    assert len(shares) == 4 and all(0 < share < 100 for share in shares)
    assert 90 < sum(shares) < 110  # medians, each of its own
    loop = rows["PPO, 64 missions × 3 robots, 2 threads", None]
    assert loop.goal == "≥ 12000 robot-steps/s" and loop.holds is (loop.ours >= 12_000)
