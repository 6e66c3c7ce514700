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
from .roots import tied_bodies
from .tendons import fixed_terms

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
    words = {compiled.code(f"mjEQ_{word.upper()}"): word for word in ("connect", "weld", "joint", "tendon")}
    ties = tied_bodies(compiled)
    for number in range(model.neq):
        word = words.get(int(model.eq_type[number]))
        if word is None:
            raise compiled.error(
                "equality", number, "only connect, weld, joint and tendon are read; remove it"
            )
        name = compiled.name("equality", number)
        if not model.eq_active0[number]:
            robot.notes.append(f"<{word}> '{name or number}' has active=\"false\": it is not read")
        elif word in KINDS:
            robot.closures.append(_closure(compiled, number, word, ties[number], name, taken))
        else:
            robot.couplings.append(_coupling(compiled, number, word, name, taken))


def _closure(
    compiled: Compiled, number: int, word: str, bodies: tuple[int, int], name: str, taken: set[str]
) -> Closure:
    frame_a, frame_b = _frames(compiled, number, word)
    link_a, link_b = (compiled.bodies[body] for body in bodies)
    name = name or unique(f"{word}_{link_a}_{link_b}", taken)
    taken.add(name)
    form = KINDS[word]
    return Closure(
        name, word, link_a, frame_a, link_b, frame_b, form.translations, form.rotation,
        compiled.line("equality", number),
    )  # fmt: skip


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
    data = np.array(model.eq_data[number])
    level = np.array([1.0, 0, 0, 0])
    if word == "connect":
        return pose(data[:3], level), pose(data[3:6], level)
    return pose(data[3:6], data[6:10]), pose(data[:3], level)


def _coupling(compiled: Compiled, number: int, word: str, name: str, taken: set[str]) -> Coupling:
    """Return y - y0 = a0 + a1 (x - x0) as a sum; y and x are joint positions or lengths of fixed tendons."""
    model = compiled.model
    constant, factor, *higher = (float(a) for a in model.eq_data[number][:5])
    follower, leader = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
    if any(higher) and leader >= 0:
        raise compiled.error(
            "equality", number,
            f"polycoef of order {max(i for i, a in enumerate(higher, 2) if a)}; hybridyn couples linearly: "
            "keep the first two numbers of polycoef",
        )  # fmt: skip
    terms: dict[str, float] = {}
    offset = constant
    for end, weight in ((follower, 1.0), (leader, -factor)):
        if end < 0:
            continue
        parts, reference = _length(compiled, number, word, end)
        offset += weight * reference
        for joint, coefficient in parts.items():
            terms[joint] = terms.get(joint, 0.0) + weight * coefficient
    terms = {joint: coefficient for joint, coefficient in terms.items() if coefficient}
    if not terms:
        raise compiled.error("equality", number, "it couples nothing; remove it")
    name = name or unique(next(iter(terms)), taken)  # as a mimic joint's, that of the joint which follows
    taken.add(name)
    return Coupling(name, tuple(terms.items()), offset, compiled.line("equality", number))


def _length(compiled: Compiled, number: int, word: str, end: int) -> tuple[dict[str, float], float]:
    """Return a joint's position or a tendon's length as a sum over joints, and its value at the reference."""
    model = compiled.model
    if word == "joint":
        return {compiled.joints[end]: 1.0}, float(model.qpos0[model.jnt_qposadr[end]])
    terms = fixed_terms(compiled, end)
    if terms is None:
        raise compiled.error(
            "equality", number,
            f"its tendon '{compiled.name('tendon', end)}' is spatial; hybridyn has no cables: remove it",
        )  # fmt: skip
    return terms, float(model.tendon_length0[end])
