"""`<tendon>` of a compiled MJCF model: fixed tendons as sums over joints; their own forces are refused."""

from __future__ import annotations

from .compiling import Compiled
from .fields import nonzero

#: What a tendon may not have, by the name of MuJoCo's array.
FORCES = {
    "tendon_stiffness": "stiffness", "tendon_stiffnesspoly": "stiffness", "tendon_damping": "damping",
    "tendon_dampingpoly": "damping", "tendon_frictionloss": "frictionloss", "tendon_armature": "armature",
}  # fmt: skip


def fixed_terms(compiled: Compiled, tendon: int) -> dict[str, float] | None:
    """Return the coefficient of each joint in a fixed tendon's length, or None for a spatial tendon."""
    model = compiled.model
    first = int(model.tendon_adr[tendon])
    terms: dict[str, float] = {}
    for wrap in range(first, first + int(model.tendon_num[tendon])):
        if model.wrap_type[wrap] != compiled.code("mjWRAP_JOINT"):
            return None
        joint = compiled.joints[model.wrap_objid[wrap]]
        terms[joint] = terms.get(joint, 0.0) + float(model.wrap_prm[wrap])
    return terms


def refuse_forces(compiled: Compiled) -> None:
    """Refuse tendons that pull by themselves.

    Raises:
        ModelError: A tendon has a spring, a damper, friction or inertia.
    """
    for tendon in range(compiled.model.ntendon):
        for field, word in FORCES.items():
            if nonzero(compiled.model, field, tendon):
                raise compiled.error(
                    "tendon", tendon, f"{word} along a tendon is not read; remove it, or put it on joints"
                )


def limited(compiled: Compiled) -> list[str]:
    """Return the names of the tendons that have limits."""
    count = compiled.model.ntendon
    return [compiled.name("tendon", n) or str(n) for n in range(count) if compiled.model.tendon_limited[n]]
