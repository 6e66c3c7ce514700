"""The effects that files state, and the joints or links that their numbers are by."""

from collections.abc import Mapping
from typing import Any

from ..extensions import added

#: Effects of hybridyn that files state with numbers by joint, and by link.
ON_JOINTS = (
    "rotor_inertia", "viscous_friction", "coulomb_friction", "stribeck_friction",
    "directed_friction", "spring", "damper", "stop",
    "polynomial_spring", "polynomial_damper", "ball_spring", "tendons", "load_friction", "gear_efficiency",
    "dc_motors", "limits",
)  # fmt: skip
ON_LINKS = ("ground_contact", "gravity_compensation", "line_springs", "bushings", "payload")


def is_added(effect: str) -> bool:
    """Return whether an effect that a file states is one of another package."""
    return effect not in (*ON_JOINTS, *ON_LINKS)


def acts_on(effect: str) -> str:
    """Return what the numbers of an effect are by: "joint" or "link"."""
    if is_added(effect):
        return str(getattr(added("effects", effect), "acts_on", "joint"))
    return "link" if effect in ON_LINKS else "joint"


def named_by(effect: str, numbers: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the joints or links that an effect names, see `acts_on`, each with its key."""
    by_name = {key: [*x] for key, x in numbers.items() if isinstance(x, dict)}
    if effect == "tendons":  # all but the arms is by tendon
        by_name = {"arms": by_name["arms"]}
    if effect in ("line_springs", "bushings"):
        by_name = {"ends": [link for links in numbers["ends"].values() for link in links]}
    if effect == "payload":
        by_name = {"link": [numbers["link"]]}
    return [(key, name) for key, names in by_name.items() for name in names]
