"""Refuse numbers of a compiled MJCF model that cannot be read, and forces that hybridyn does not have."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..records import Array
from ..urdf.xml_node import LARGEST_NUMBER
from .compiling import Compiled

#: What has to be finite, by the name of MuJoCo's array.
FINITE = {
    "body_pos": "pos", "body_quat": "quat", "body_mass": "mass", "body_ipos": "com",
    "body_inertia": "inertia", "jnt_pos": "pos", "jnt_axis": "axis", "jnt_stiffness": "stiffness",
}  # fmt: skip
#: What has to be finite and not negative.
POSITIVE = ("dof_damping", "dof_armature", "dof_frictionloss")

_ALONG = "along a tendon is not read; remove it, or put it on joints"
#: What nothing may have.
REFUSED = {
    "body_gravcomp": "gravcomp is not read; remove it, or state it as a wrench",
    "tendon_stiffness": f"stiffness {_ALONG}",
    "tendon_stiffnesspoly": f"stiffness {_ALONG}",
    "tendon_damping": f"damping {_ALONG}",
    "tendon_dampingpoly": f"damping {_ALONG}",
    "tendon_frictionloss": f"frictionloss {_ALONG}",
    "tendon_armature": f"armature {_ALONG}",
    "jnt_stiffnesspoly": "stiffness that depends on the position is not read; keep its first number",
    "jnt_springyield": "springyield is not read; remove it",
    "jnt_actgravcomp": "actuatorgravcomp is not read; remove it",
    "dof_dampingpoly": "damping that depends on the speed is not read; keep its first number",
}
#: What a joint with several freedoms may not have.
REFUSED_OF_SEVERAL = {
    "jnt_stiffness": "a spring of a joint with several freedoms is not read; set stiffness to 0",
    "dof_frictionloss": "frictionloss of a joint with several freedoms is not read; set frictionloss to 0",
}
#: What follows where the joint is free.
FREE_HINT = ", or write <freejoint/>, which takes no defaults"


def refuse_numbers(compiled: Compiled) -> None:
    """Refuse a model with numbers that are not finite, or so large that their square is not.

    Raises:
        ModelError: There is such a number, or damping, armature or friction is negative.
    """
    for field, what in FINITE.items():
        rows = _rows(compiled, field)
        _refuse(compiled, field, ~(np.abs(rows) <= LARGEST_NUMBER), f"its {what} is not finite, or too large")
    for field in POSITIVE:
        rows = _rows(compiled, field)
        wrong = ~((rows >= 0) & (rows < np.inf))
        _refuse(compiled, field, wrong, "damping, armature or frictionloss is negative or not finite")


def refuse_forces(compiled: Compiled) -> None:
    """Refuse forces that are not read.

    Raises:
        ModelError: A body, joint or tendon has such a force, or a program moves a body that equalities hold.
    """
    model = compiled.model
    for field, sentence in REFUSED.items():
        _refuse(compiled, field, _rows(compiled, field) != 0, sentence)
    for word, hint in (("BALL", ""), ("FREE", FREE_HINT)):
        own = model.jnt_type == compiled.code(f"mjJNT_{word}")
        for field, sentence in REFUSED_OF_SEVERAL.items():
            on = own if field.startswith("jnt") else own[model.dof_jntid]
            _refuse(compiled, field, (_rows(compiled, field) != 0) & on[:, None], sentence + hint)
    for body in sorted({body for pair in compiled.tied_bodies.values() for body in pair}):
        if model.body_mocapid[body] >= 0:
            raise compiled.error(
                "body", body, "a program moves a mocap body; remove mocap, or give it joints"
            )


def _rows(compiled: Compiled, field: str) -> Array:
    """Return an array of the model as rows of numbers; none where this version of MuJoCo lacks it."""
    return np.atleast_2d(np.asarray(getattr(compiled.model, field, ()), dtype=float).T).T


def _refuse(compiled: Compiled, field: str, wrong: NDArray[np.bool_], sentence: str) -> None:
    """Refuse the first row of an array that has a wrong entry, with the name of what it is about."""
    for row in np.flatnonzero(wrong.any(axis=1)):
        kind, _, _ = field.partition("_")
        number = int(compiled.model.dof_jntid[row]) if kind == "dof" else int(row)
        raise compiled.error({"jnt": "joint", "dof": "joint"}.get(kind, kind), number, sentence)
