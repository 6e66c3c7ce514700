"""`<equality>` and `<actuator>` of a compiled MJCF model, both of which tendons may lead to several joints.

Connect and weld are closures, joint and tendon are couplings. The effort of a motor is the effort at its
joint, the gear times the force of the actuator. Servo laws are not read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...errors import ModelError
from ..closure_forms import FORMS, closure_of
from ..motors import MEND
from ..names import DROPS, listed, noted, unique
from ..records import Array, Coupling, Curve, MotorStatement, RobotFile
from .compiling import Compiled, pose
from .forces import fixed_terms

#: Closures by MuJoCo's word.
KINDS = {"connect": FORMS["point"], "weld": FORMS["fixed"]}
WHERE = "MJCF <actuator>"
#: MuJoCo's own solref and solimp, relative to which an equality is soft.
STIFFNESS, IMPEDANCE = 0.02, (0.9, 0.95)
#: Random positions at which the moments of an actuator are compared.
POSTURES = 5
#: Difference of moments that is rounding, relative to the largest.
ALIKE = 1e-10


def add_equalities(robot: RobotFile, compiled: Compiled) -> None:
    """Add every active equality to the robot; those that start inactive are noted.

    Raises:
        ModelError: An equality is of another kind, or all are disabled.
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
    taken, soft = {compiled.name("equality", number) for number in range(model.neq)}, list[str]()
    words = {compiled.code(f"mjEQ_{word.upper()}"): word for word in (*KINDS, "joint", "tendon")}
    for number in range(model.neq):
        word = words.get(int(model.eq_type[number]))
        if word is None:
            raise compiled.error(
                "equality", number, "only connect, weld, joint and tendon are read; remove it"
            )
        if not model.eq_active0[number]:
            at, name = compiled.at("equality", number), compiled.name("equality", number) or number
            robot.notes.append(f"{at}: <{word}> '{name}' has active=\"false\": it is not read")
            continue
        name = _add_equality(robot, compiled, number, word, taken)
        if _is_soft(compiled, number):
            soft.append(name)
    robot.notes += noted({
        f"{DROPS} the compliance of equalities {{}} (solref, solimp): they hold as rigid ones": soft
    })  # fmt: skip


def _add_equality(robot: RobotFile, compiled: Compiled, number: int, word: str, taken: set[str]) -> str:
    """Add an equality to the robot, as a closure or a coupling, and return its name.

    Args:
        word: MuJoCo's word for its kind.
        taken: Names of equalities, to which a name that is made is added.
    """
    name, line = compiled.name("equality", number), compiled.line("equality", number)
    if word in KINDS:
        link_a, link_b = (compiled.bodies[body] for body in compiled.tied_bodies[number])
        name = name or unique(f"{word}_{link_a}_{link_b}", taken)
        sides = zip((link_a, link_b), _frames(compiled, number, word), strict=True)
        # Without torque a weld holds points alone.
        form = KINDS["connect" if word == "weld" and not compiled.model.eq_data[number][10] else word]
        robot.closures.append(closure_of(name, word, sides, form=form, line=line))
    else:
        terms, offset, curve = _relation(compiled, number, word)
        name = name or unique(next(iter(terms)), taken)  # as a mimic joint's, that of its follower
        robot.couplings.append(Coupling(name, tuple(terms.items()), offset, line, curve))
    return name


def _is_soft(compiled: Compiled, number: int) -> bool:
    """Return whether an equality is softer than MuJoCo's default.

    `solref` is a time constant [s] and a damping ratio, or stiffness and damping with minus signs: the pull
    back is 1 / (time constant x ratio x impedance)^2, or the stiffness over the impedance squared [1/s^2].
    """
    first, ratio = (float(x) for x in compiled.model.eq_solref[number])
    low, high = (float(x) for x in compiled.model.eq_solimp[number][:2])
    frequency = np.sqrt(-first) if first <= 0 else 1 / (first * max(ratio, np.finfo(float).tiny))
    slack = 1 - 1e-9
    return bool(frequency < slack / STIFFNESS or low < slack * IMPEDANCE[0] or high < slack * IMPEDANCE[1])


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


def _relation(compiled: Compiled, number: int, word: str) -> tuple[dict[str, float], float, Curve | None]:
    """Return y - y0 = a0 + a1 (x - x0) + ... + a4 (x - x0)^4: coefficients of joints, right-hand side, curve.

    y and x are positions of joints or lengths of fixed tendons, y0 and x0 those at the reference.
    """
    offset, factor, *higher = (float(a) for a in compiled.model.eq_data[number][:5])
    follower, leader = int(compiled.model.eq_obj1id[number]), int(compiled.model.eq_obj2id[number])
    terms: dict[str, float] = {}
    curve = None
    for end, weight in ((follower, 1.0), (leader, -factor)):
        if end < 0:
            continue
        parts, reference = _coupled(compiled, number, word, end)
        offset += weight * reference
        for joint, coefficient in parts.items():
            terms[joint] = terms.get(joint, 0.0) + weight * coefficient
        if end == leader and any(higher):
            least = max(i for i, a in enumerate(higher, 1) if a)
            curve = Curve(tuple(parts.items()), tuple(-a for a in higher[:least]), reference)
    terms = {joint: coefficient for joint, coefficient in terms.items() if coefficient}
    if not terms:
        raise compiled.error("equality", number, "it couples nothing; remove it")
    return terms, offset, curve


def _coupled(compiled: Compiled, number: int, word: str, end: int) -> tuple[dict[str, float], float]:
    """Return an end of an equality as coefficients of joints, and its value at the reference."""
    model = compiled.model
    if word == "joint":
        return {compiled.joints[end]: 1.0}, float(model.qpos0[model.jnt_qposadr[end]])
    parts = fixed_terms(compiled, end)
    if parts is None:
        raise compiled.error(
            "equality", number,
            f"its tendon '{compiled.name('tendon', end)}' is spatial; hybridyn has no cables: remove it",
        )  # fmt: skip
    return parts, float(model.tendon_length0[end])


def add_actuators(robot: RobotFile, compiled: Compiled) -> None:
    """Add the list of motors, and what actuators add to their joints, to the robot.

    Actuators that no motor expresses are left out, and noted.

    Raises:
        ModelError: Such an actuator has armature or damping.
    """
    added: dict[str, Array] = {}  # by joint: limit of its effort, inertia, damping
    servos: dict[int, str] = {}  # by number: name of the actuator, or of its joint
    reasons: dict[int, str] = {}  # by number: why it is no motor
    for actuator in range(len(compiled.model.actuator_trntype)):
        driven = _driven_joint(robot.couplings, compiled, actuator)
        if isinstance(driven, str):
            if any(_own(compiled, actuator)):
                message = f"it {driven}, so that its armature and damping are not read; set them to 0"
                raise compiled.error("actuator", actuator, message)
            reasons[actuator] = driven
            continue
        joint, gear = driven
        own, plain = _numbers(compiled, actuator, gear)
        added[joint] = added.get(joint, np.zeros(3)) + own
        if not plain:
            servos[actuator] = compiled.name("actuator", actuator) or joint
    _note_actuators(robot, compiled, servos, reasons)
    if added or reasons:
        robot.motors.append(MotorStatement("actuator", WHERE, tuple(added), robot.file))
    for number, one in enumerate(robot.joints):
        limit, inertia, damping = (float(x) for x in added.get(one.name, (np.inf, 0.0, 0.0)))
        robot.joints[number] = replace(
            one, effort=min(one.effort, limit), rotor_inertia=one.rotor_inertia + inertia,
            damping=one.damping + damping,
        )  # fmt: skip


def _note_actuators(
    robot: RobotFile, compiled: Compiled, servos: Mapping[int, str], reasons: Mapping[int, str]
) -> None:
    """Note the laws of actuators, and leave out those that are no motors.

    Args:
        servos: Names of the actuators with a law of their own, by number.
        reasons: Why actuators are no motors, by number.
    """
    if servos:
        at, names = compiled.at("actuator", min(servos)), listed(dict.fromkeys(servos.values()))
        robot.notes.append(
            f"{at}: actuators {names} have a servo, a muscle or dynamics of their own, which are not read: "
            "motor efforts are inputs of the models"
        )
    if reasons:
        named = {compiled.name("actuator", number) or str(number): why for number, why in reasons.items()}
        stated = "; ".join(f"'{name}' {why}" for name, why in named.items())
        at = compiled.at("actuator", min(reasons))
        robot.notes.append(f"{at}: actuators that are no motors here: {stated}. {MEND}")
        robot.left_out = tuple(named)


def _driven_joint(
    couplings: Sequence[Coupling], compiled: Compiled, actuator: int
) -> tuple[str, float] | str:
    """Return the joint that an actuator drives and the gear between them, or why there is none.

    A tendon over joints that couplings tie to one is a gear on that joint: the power is the same.
    """
    model = compiled.model
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator][0])
    if kind == compiled.code("mjTRN_TENDON"):
        terms = fixed_terms(compiled, target)
        if terms is None:
            return "pulls a spatial tendon"
    elif kind not in (compiled.code("mjTRN_JOINT"), compiled.code("mjTRN_JOINTINPARENT")):
        return _steady(compiled, actuator) or "drives no joint in the same way at all positions"
    elif model.jnt_type[target] not in (compiled.code("mjJNT_HINGE"), compiled.code("mjJNT_SLIDE")):
        return f"drives joint '{compiled.joints[target]}', which has several freedoms"
    else:
        terms = {compiled.joints[target]: 1.0}
    followers = {coupling.terms[0][0] for coupling in couplings}
    joint = next((name for name in terms if name not in followers), next(iter(terms)))
    rates = _rates_along(couplings, joint)
    if not set(terms) <= set(rates):
        return "pulls a tendon of joints that move apart"
    gear = float(model.actuator_gear[_output(compiled, actuator)][0])
    return joint, gear * sum(coefficient * rates[name] for name, coefficient in terms.items())


def _steady(compiled: Compiled, actuator: int) -> tuple[str, float] | None:
    """Return the joint on which an actuator on sites or a crank always acts alike, and the gear; else None.

    MuJoCo's own moments say so, at random positions. Such is a wrench of a site about the one hinge that
    carries it.
    """
    mujoco, model = compiled.mujoco, compiled.model
    draw, data, row = np.random.default_rng(0), mujoco.MjData(model), _output(compiled, actuator)
    moments = np.zeros((POSTURES, model.nv))
    for moment in moments:
        mujoco.mj_integratePos(model, data.qpos, draw.normal(size=model.nv), 1.0)
        mujoco.mj_fwdPosition(model, data)
        at = slice(data.moment_rowadr[row], data.moment_rowadr[row] + data.moment_rownnz[row])
        moment[data.moment_colind.ravel()[at]] = data.actuator_moment.ravel()[at]
    size = np.abs(moments).max(initial=0.0)
    dofs = np.flatnonzero(np.abs(moments).max(axis=0, initial=0.0) > ALIKE * size)
    if len(dofs) != 1 or np.ptp(moments[:, dofs[0]]) > ALIKE * size:
        return None
    joint = int(model.dof_jntid[dofs[0]])
    if model.jnt_type[joint] not in (compiled.code("mjJNT_HINGE"), compiled.code("mjJNT_SLIDE")):
        return None
    return compiled.joints[joint], float(moments[0, dofs[0]])


def _output(compiled: Compiled, actuator: int) -> int:
    """Return where the outputs of an actuator are, which MuJoCo 4 counts by themselves."""
    return int(getattr(compiled.model, "actuator_outadr", range(actuator + 1))[actuator])


def _rates_along(couplings: Sequence[Coupling], joint: str) -> dict[str, float]:
    """Return the rate of each joint that linear couplings of two tie to one, where that has the rate 1."""
    linear = [coupling for coupling in couplings if not coupling.curve]
    rates, waiting = {joint: 1.0}, [coupling for coupling in linear if len(coupling.terms) == 2]
    while tied := [c for c in waiting if len({name for name, _ in c.terms} & set(rates)) == 1]:
        for coupling in tied:
            (a, of_a), (b, of_b) = sorted(coupling.terms, key=lambda term: term[0] not in rates)
            rates[b] = -of_a / of_b * rates[a]
            waiting.remove(coupling)
    return rates


def _numbers(compiled: Compiled, actuator: int, gear: float) -> tuple[Array, bool]:
    """Return what an actuator adds to its joint, and whether its force is no more than gain x control.

    Returns:
        The largest effort [N or N m], infinite where none is stated, inertia and damping, shape (3,).
    """
    model, force = compiled.model, np.inf
    kinds = (model.actuator_gaintype, model.actuator_biastype, model.actuator_dyntype)
    plain = not any(kind[actuator] for kind in kinds)  # fixed gain, no bias, no dynamics
    if model.actuator_forcelimited[actuator]:
        force = float(np.abs(model.actuator_forcerange[actuator]).max())
    control = getattr(model, "actuator_ctrladr", range(actuator + 1))[actuator]  # of each one in MuJoCo 4
    if plain and model.actuator_ctrllimited[control]:
        gain = abs(float(model.actuator_gainprm[actuator][0]))
        force = min(force, gain * float(np.abs(model.actuator_ctrlrange[control]).max()))
    stated = [number * gear**2 for number in _own(compiled, actuator)]
    return np.array([abs(gear) * force if gear else 0.0, *stated]), plain


def _own(compiled: Compiled, actuator: int) -> list[float]:
    """Return armature and damping of an actuator; some versions of MuJoCo have neither."""
    none = np.zeros(actuator + 1)
    fields = ("actuator_armature", "actuator_damping")
    return [float(getattr(compiled.model, field, none)[actuator]) for field in fields]
