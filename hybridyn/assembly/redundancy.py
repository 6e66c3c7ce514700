"""The rules for freedoms that what is given leaves open, by name; `assemble` describes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from ..description.names import did_you_mean, listed
from ..errors import TrajectoryError

Rule = Literal["least motion", "middle of ranges", "away from singular"]
LEAST, MIDDLE, AWAY = get_args(Rule)
#: All rules, and what is told of each.
RULES = {
    LEAST: "the motors move least from each posture to the next, measured by their ranges",
    MIDDLE: "the motors are as near to the middle of their ranges as the targets allow",
    AWAY: "the posture is as far from singular ones, and from limits, as the targets allow",
}


def check_rule(name: str) -> None:
    """Raise a TrajectoryError unless there is a rule of this name."""
    if name not in RULES:
        hint = did_you_mean(name, RULES)
        raise TrajectoryError(f"unknown redundancy '{name}'{hint}; there are {listed(RULES)}")


@dataclass(frozen=True)
class LeftToRule:
    """Freedoms that what is given leaves to a rule.

    Attributes:
        count: Their number.
        modules: Names of the modules that share them.
        rule: The rule that takes them.
    """

    count: int
    modules: tuple[str, ...]
    rule: str = LEAST

    def __str__(self) -> str:
        """Return the sentence for a log or a summary."""
        freedoms = "1 freedom" if self.count == 1 else f"{self.count} freedoms"
        return f"what is given leaves {freedoms} of {listed(self.modules)} open: {RULES[self.rule]}"
