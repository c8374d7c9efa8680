"""The digest of a mission's state sees all of it."""

from collections.abc import Iterator

import numpy as np
import pytest

from entropy_explore_env.missions.state import FROM_WORLD
from entropy_explore_env.reports.state_digest import state_digest
from tests.missions.kinds import KINDS
from tests.reference.scenes import free_box, started

BY_SEEN = {"robots": 2, "ending": {"seen_share": 0.9}}


def leaf_arrays(state: object) -> Iterator[np.ndarray]:
    """All arrays of a state, however they are grouped, and all fields of structured ones."""
    for part in state if isinstance(state, tuple) else ():
        yield from leaf_arrays(part)
    if isinstance(state, np.ndarray):
        yield from [state[name] for name in state.dtype.names] if state.dtype.names else [state]


@pytest.mark.parametrize("scenario", [free_box(**BY_SEEN), *(kind.scenario for kind in KINDS.values())])
def test_a_digest_sees_every_array_and_field(scenario):
    missions = started(scenario, seed=3, missions=2)
    before, other = state_digest(missions, 0), state_digest(missions, 1)
    assert before != other
    left_out = [getattr(missions.state, name) for name in FROM_WORLD]
    seen = 0
    for array in leaf_arrays(missions.state):
        skipped = any(np.shares_memory(array, part) for part in left_out)
        if skipped or array[0:1].size == 0:
            continue
        kept, target = array.copy(), array[0:1]
        target[...] = ~target if target.dtype == bool else np.where(np.isinf(target), 0, target + 1)
        assert state_digest(missions, 0) != before
        assert state_digest(missions, 1) == other
        array[...] = kept
        assert state_digest(missions, 0) == before
        seen += 1
    assert seen > 50
