"""What a refused setting must say."""

import pytest

from entropy_explore_env.errors import EntropyExploreError, SettingError


def refusal(call):
    """The SettingError of a call: one line with field, value and what is allowed."""
    with pytest.raises(SettingError) as raised:
        call()
    error = raised.value
    assert isinstance(error, EntropyExploreError)
    assert isinstance(error, ValueError)
    assert str(error) == f"{error.field} = {error.value!r}: expected {error.allowed}"
    assert error.allowed
    assert "\n" not in str(error)
    return error
