"""`<equality>` of a compiled MJCF model: connect and weld as closures, joint and tendon as couplings."""

from __future__ import annotations

import numpy as np

from ...errors import ModelError
from ..closure_forms import FORMS
from ..names import unique
from ..records import Array, Closure, Coupling
from ..robot_file import RobotFile
from .bodies import pose
from .compiling import Compiled

#: Closures by MuJoCo's word.
KINDS = {"connect": FORMS["point"], "weld": FORMS["fixed"]}


def add_equalities(robot: RobotFile, compiled: Compiled) -> None:
    """Add every active equality to the robot; those that start inactive are noted.

    Raises:
        ModelError: An equality is of another kind, of higher order, or all are disabled.
    """
    model = compiled.model
    if model.neq and model.opt.disableflags & (
        compiled.code("mjDSBL_EQUALITY") | compiled.code("mjDSBL_CONSTRAINT")
    ):
        raise ModelError(
            "<flag> disables the equalities of this robot; remove equality=\"disable\" (or "
            "constraint=\"disable\"), or the equalities themselves",
            file=compiled.file, element="flag",
        )  # fmt: skip
    taken = {compiled.name("equality", number) for number in range(model.neq)}
    words = {compiled.code(f"mjEQ_{word.upper()}"): word for word in (*KINDS, "joint", "tendon")}
    for number in range(model.neq):
        word, name = words.get(int(model.eq_type[number])), compiled.name("equality", number)
        line = compiled.line("equality", number)
        if word is None:
            raise compiled.error(
                "equality", number, "only connect, weld, joint and tendon are read; remove it"
            )
        if not model.eq_active0[number]:
            robot.notes.append(f"<{word}> '{name or number}' has active=\"false\": it is not read")
        elif word in KINDS:
            link_a, link_b = (compiled.bodies[body] for body in compiled.tied_bodies[number])
            name = name or unique(f"{word}_{link_a}_{link_b}", taken)
            frame_a, frame_b = _frames(compiled, number, word)
            form = KINDS[word].translations, KINDS[word].rotation
            robot.closures.append(Closure(name, word, link_a, frame_a, link_b, frame_b, *form, line))
        else:
            terms, offset = _sum(compiled, number, word)
            name = name or unique(next(iter(terms)), taken)  # as a mimic joint's, that of its follower
            robot.couplings.append(Coupling(name, tuple(terms.items()), offset, line))


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


def _frames(compiled: Compiled, number: int, word: str) -> tuple[Array, Array]:
    """Return the frames that coincide, each in its body, shape (4, 4).

    `eq_data` of two bodies: of connect the point in the first and in the second; of weld the point in the
    second (0:3), then the second's place in the first at the reference posture (3:6, 6:10).
    """
    model = compiled.model
    ends = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
    if model.eq_objtype[number] == compiled.code("mjOBJ_SITE"):
        first, second = (pose(model.site_pos[end], model.site_quat[end]) for end in ends)
        return first, second
    data, level = np.array(model.eq_data[number]), np.array([1.0, 0.0, 0.0, 0.0])
    if word == "connect":
        return pose(data[:3], level), pose(data[3:6], level)
    return pose(data[3:6], data[6:10]), pose(data[:3], level)


def _sum(compiled: Compiled, number: int, word: str) -> tuple[dict[str, float], float]:
    """Return y - y0 = a0 + a1 (x - x0) as coefficients of joints and the right-hand side.

    y and x are positions of joints or lengths of fixed tendons, y0 and x0 those at the reference.
    """
    model = compiled.model
    offset, factor, *higher = (float(a) for a in model.eq_data[number][:5])
    follower, leader = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
    if any(higher) and leader >= 0:
        raise compiled.error(
            "equality", number,
            f"polycoef of order {max(i for i, a in enumerate(higher, 2) if a)}; hybridyn couples linearly: "
            "keep the first two numbers of polycoef",
        )  # fmt: skip
    terms: dict[str, float] = {}
    for end, weight in ((follower, 1.0), (leader, -factor)):
        if end < 0:
            continue
        if word == "joint":
            parts: dict[str, float] | None = {compiled.joints[end]: 1.0}
            reference = float(model.qpos0[model.jnt_qposadr[end]])
        else:
            parts, reference = fixed_terms(compiled, end), float(model.tendon_length0[end])
        if parts is None:
            raise compiled.error(
                "equality", number,
                f"its tendon '{compiled.name('tendon', end)}' is spatial; hybridyn has no cables: remove it",
            )  # fmt: skip
        offset += weight * reference
        for joint, coefficient in parts.items():
            terms[joint] = terms.get(joint, 0.0) + weight * coefficient
    terms = {joint: coefficient for joint, coefficient in terms.items() if coefficient}
    if not terms:
        raise compiled.error("equality", number, "it couples nothing; remove it")
    return terms, offset
