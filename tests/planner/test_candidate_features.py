import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.planner.candidate_features import (
    COLUMNS,
    CONTEXT,
    CONTEXT_COLUMNS,
    FEATURES,
    FEATURES_VERSION,
    check_features_version,
)


@pytest.mark.parametrize(("table", "columns"), [(FEATURES, COLUMNS), (CONTEXT, CONTEXT_COLUMNS)])
def test_columns_number_the_names_of_the_table(table, columns):
    assert [columns[feature.name] for feature in table] == list(range(len(table)))
    assert all(feature.meaning and feature.least in (-1.0, 0.0) for feature in table)


@pytest.mark.parametrize("version", [FEATURES_VERSION + 1, 0, None, "1", True])
def test_another_version_is_refused_by_name(version):
    with pytest.raises(SettingError, match="FEATURES_VERSION"):
        check_features_version(version)


def test_this_version_is_not_refused():
    check_features_version(FEATURES_VERSION)
