"""Bad actions: each is refused with its robot's name, its value and what is allowed."""

from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from entropy_explore_env import ActionError
from entropy_explore_env.envs.checks import ActionChecker

BOX = ActionChecker(spaces.Box(-1.0, 1.0, (5,), np.float32))
DISCRETE = ActionChecker(spaces.Discrete(7))


@pytest.mark.parametrize(
    "action",
    [
        np.linspace(-1, 1, 5),
        np.linspace(-1, 1, 5).astype(np.float32),
        [-1.0, -0.5, 0.0, 0.5, 1.0],
        np.linspace(-1, 1, 5).astype(np.float16),
    ],
)
def test_boxes_of_any_floating_type_are_taken(action: Any) -> None:
    boxes, numbers = BOX.batch([("robot_0", action), ("robot_1", np.zeros(5))])
    assert boxes.dtype == np.float64 and numbers.dtype == np.int64
    np.testing.assert_array_equal(boxes, [[-1, -0.5, 0, 0.5, 1], [0] * 5])
    assert boxes.flags.owndata


def test_boxes_may_leave_the_space_by_rounding_alone() -> None:
    BOX.batch([("robot_0", np.full(5, 1.0 + 5e-7))])
    with pytest.raises(ActionError):
        BOX.batch([("robot_0", np.full(5, 1.0 + 5e-6))])


@pytest.mark.parametrize("action", [6, np.int64(6), np.int8(6), np.array(6), np.uint64(6)])
def test_whole_numbers_of_any_type_are_taken(action: Any) -> None:
    assert DISCRETE.batch([("robot_0", 0), ("robot_1", action)])[1].tolist() == [0, 6]


@pytest.mark.parametrize("row", [0, 1, 2])
@pytest.mark.parametrize(
    "action", [np.array([0, 0, np.nan, 0, 0]), np.array([0, 0, 0, 0, -np.inf]), np.full(5, 1.01)]
)
def test_a_number_outside_is_refused_wherever_it_stands(row: int, action: np.ndarray) -> None:
    team: list[tuple[str, Any]] = [(f"robot_{n}", np.zeros(5)) for n in range(3)]
    team[row] = (f"robot_{row}", action)
    with pytest.raises(ActionError, match="finite numbers from -1 to 1") as caught:
        BOX.batch(team)
    assert caught.value.field == f"actions[robot_{row}]"
    np.testing.assert_array_equal(caught.value.value, action)  # type: ignore[arg-type]


RAGGED = [[0.0], [0.0, 0.0]]
NO_BOXES = [
    *(np.zeros(shape) for shape in (4, 6, (1, 5))),
    *(np.zeros(5, kind) for kind in (int, bool, complex, object, "m8[s]")),
    *(None, "up", {}, object(), 0.0, [0.0, 0.0, 0.0, 0.0, None], RAGGED),
]
NO_NUMBERS = (
    None,
    "1",
    -1,
    7,
    1.0,
    np.float64(1),
    np.nan,
    True,
    np.True_,
    [1],
    np.zeros(1, int),
    np.array(1.0),
)


@pytest.mark.parametrize(
    ("checker", "action", "said"),
    [
        *((BOX, action, "5 floating-point numbers|in the shape of the action") for action in NO_BOXES),
        *((DISCRETE, action, "a whole number from 0 to 6") for action in NO_NUMBERS),
    ],
)
def test_what_is_no_action_is_refused(checker: ActionChecker, action: Any, said: str) -> None:
    with pytest.raises(ActionError, match=said) as caught:
        checker.batch([("robot_0", action)])
    assert caught.value.field == "actions[robot_0]"


def test_tables_are_checked_as_a_whole() -> None:
    boxes, _ = BOX.table(np.zeros((4, 2, 5), np.float32), 4, 2)
    assert boxes.shape == (4, 2, 5) and boxes.dtype == np.float64
    assert BOX.table(np.zeros((4, 5), np.float32), 4, 1)[0].shape == (4, 1, 5)
    assert DISCRETE.table(np.arange(6).reshape(3, 2), 3, 2)[1].tolist() == [[0, 1], [2, 3], [4, 5]]
    assert DISCRETE.table(np.arange(3), 3, 1)[1].tolist() == [[0], [1], [2]]


@pytest.mark.parametrize("entry", [np.nan, np.inf, -1.01])
def test_a_number_outside_is_named_in_a_table(entry: float) -> None:
    table = np.zeros((4, 2, 5))
    table[2, 1, 3] = entry
    with pytest.raises(ActionError, match="finite numbers from -1 to 1") as caught:
        BOX.table(table, 4, 2)
    assert str(entry) in str(caught.value)


NO_TABLES_OF_BOXES = [
    *(np.zeros(shape) for shape in ((4, 2, 4), (2, 4, 5), (1, 4, 2, 5), 40)),
    *(np.zeros((4, 2, 5), kind) for kind in (int, object)),
    *(None, "up", RAGGED),
]
NO_TABLES_OF_NUMBERS = [
    *(np.zeros((4, 2), kind) for kind in (float, bool)),
    *(np.full((4, 2), number) for number in (-1, 7)),
    np.zeros((2, 4), int),
]


@pytest.mark.parametrize(
    ("checker", "table", "said"),
    [
        *((BOX, table, r"of shape \(4, 2, 5\)|in the shape of the action") for table in NO_TABLES_OF_BOXES),
        *((DISCRETE, table, "whole numbers") for table in NO_TABLES_OF_NUMBERS),
    ],
)
def test_what_is_no_table_of_actions_is_refused(checker: ActionChecker, table: Any, said: str) -> None:
    with pytest.raises(ActionError, match=said):
        checker.table(table, 4, 2)
