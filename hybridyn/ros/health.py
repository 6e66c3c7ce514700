"""What diagnostics say of a model and its messages, by key, as `diagnostic_msgs` wants it: texts."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import HybridynError
from .complete_states import CompleteStates

#: Distance from singular postures below which diagnostics warn.
NEAR_SINGULAR = 1e-3


@dataclass
class Health:
    """Counts of messages, and what was said of the last refused one.

    Attributes:
        completed: Number of states that went out.
        refused: Number of messages that were refused, of any topic.
        reason: Why the last one was; "" once it has been told and a right message has followed.
    """

    completed: int = 0
    refused: int = 0
    reason: str = ""

    def refuse(self, topic: str, error: HybridynError) -> str:
        """Count a refused message, and return the line that says why."""
        self.refused += 1
        self.reason = f"{topic}: refused, the last right state is held: {' '.join(str(error).split())}"
        return self.reason

    def told(self, states: CompleteStates) -> tuple[bool, str, dict[str, str]]:
        """Return whether all is well, one line, and numbers by name.

        Args:
            states: What completes the states.
        """
        motors, closures = states.model.distances(states.q)
        reason, self.reason = self.reason, ""
        if not reason and min(motors, closures) < NEAR_SINGULAR:
            reason = "near a singular posture"
        values = {
            "states completed": f"{self.completed}",
            "messages refused": f"{self.refused}",
            "closure residual over size": f"{states.model.residual(states.q):.3g}",
            "distance from singular, motors (0 to 1)": f"{motors:.3g}",
            "distance from singular, closures (0 to 1)": f"{closures:.3g}",
            "models": "general path" if states.model.compiled is None else "compiled",
        }
        return not reason, reason or ("closed" if self.completed else "no state yet"), values
