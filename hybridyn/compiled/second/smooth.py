"""Which effects have second derivatives."""

from __future__ import annotations

from ...effects.bodies import LineSprings
from ...effects.choice import Choice, choose, without_losses
from ...effects.tendons import Tendons
from ...errors import ModelError
from ...structure.robot import HybridRobot

#: Effects with kinks in the first derivative of their law, and what has them.
KINKED = {
    "stop": "its end",
    "ground_contact": "the touch",
    "polynomial_damper": "the size of the rate",
}


def check_smooth(robot: HybridRobot, effects: Choice) -> None:
    """Check that all effects have second derivatives.

    Raises:
        ModelError: One has none, or is not available.
    """
    on = without_losses(choose(robot, effects), "second derivatives do not take")
    kinks = {"limits": "each limit"} if on.limits is not None else {}
    laws = [*(law.effect for law in on.joints), *on.links]
    kinks |= {law.name: KINKED[law.name] for law in laws if law.name in KINKED}
    lines = [law for law in laws if isinstance(law, Tendons | LineSprings)]
    kinks |= {law.name: "the slack range" for law in lines if _slack(law)}
    for name, what in kinks.items():
        raise ModelError(
            f"the effect '{name}' has no second derivative: {what} is a kink of its law; leave it out",
            element=name,
        )


def _slack(law: Tendons | LineSprings) -> bool:
    """Return whether a length has a range without force; bounds that are not stated are zero."""
    return any(law.lower.get(x, 0.0) != law.upper.get(x, 0.0) for x in {*law.lower, *law.upper})
