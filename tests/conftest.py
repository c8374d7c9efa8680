"""How Hypothesis draws examples: the same in every run of the suite, others and more in `make test-long`.

The option `--hypothesis-profile=long` chooses the second.
"""

from __future__ import annotations

from hypothesis import HealthCheck, settings

SLOW_MACHINES = {
    "deadline": None,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.filter_too_much],
}
settings.register_profile("suite", derandomize=True, max_examples=100, **SLOW_MACHINES)
settings.register_profile("long", derandomize=False, max_examples=1000, **SLOW_MACHINES)
settings.load_profile("suite")
