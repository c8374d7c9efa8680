"""What a step is worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from entropy_explore_env.settings.validation import check_choice, check_within


@dataclass(frozen=True)
class Reward:
    """What a step is worth, in shares of H(0) - H_th, so that map size does not matter.

    Attributes:
        kind: `individual`: bits that the robot's own measurements took from its own map;
            `team`: mean decrease of the robots' map entropies.
        cost_per_s: Subtracted for every second that passes, 0 to 1e6. In the named scenarios 0.2 / the
            time of a good strategy's mission, so that returns tell fast from slow.
    """

    kind: Literal["individual", "team"] = "individual"
    cost_per_s: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "kind")
        check_within(self, "cost_per_s", least=0, most=1e6)
