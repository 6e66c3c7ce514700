"""Header of exported C: what each number means, and the declarations."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ...dynamics.quantities.joint_map import motors_beside
from ...structure.parameters.slots import Slot, values_of
from ...structure.robot import HybridRobot
from ..code.plain_c import WRITTEN, in_lanes, prototype, work_type
from ..code.scalars import REAL
from ..equations.scales import GUARD_CLOSED
from ..program import Program
from .closing.platform_program import posed_modules
from .walking import OTHER_BRANCH

WHAT = {
    "idm": "Inverse dynamic model: motor efforts tau [N, N m] from positions q, rates v and accelerations a.",
    "ddm": "Direct dynamic model: accelerations a from positions q, rates v and motor efforts tau.",
    "kinematics": "Motion of every body in the world, 24 numbers each: axes row by row, origin, velocity, "
    "angular velocity, acceleration (classical), angular acceleration.",
    "close": "Loops closed from what the motors do: one Newton step from a posture `near`, in which the "
    "motors are where they are and the others where they were, and all joints' rates and accelerations; of v "
    "and a the motors' entries are read, a free base's, and those of joints that no motor moves. Rods that "
    "turn idly about their line take the least step, rates and accelerations. Call it again with its q until "
    "the guard is at most 1: three or four times from the last tick's posture.",
    "idm_from_motors": "A control step: the loops closed from the motors' `position`, on the assembly branch "
    "of `last`, the posture of the last tick, which must close the loops; then motor efforts as of `idm`. v "
    "and a as in `close`; a base and joints that no motor moves are where `last` has them. The guard is "
    "..._OTHER_BRANCH if no way leads there: the motors have moved across a singular posture, to another "
    "assembly, out of reach, or too far for one tick.",
    "idm_from_given": "A control step from what is `given`, such as a tool's pose: the loops closed on the "
    "assembly branch of `last`, the posture of the last tick, which must close the loops; freedoms that it "
    "leaves move least from there, by the rule of `hybridyn.assemble`; then motor efforts as of `idm`. "
    "Quaternions and directions have a length of one; a lone angle is meant as `last` has it. The guard is "
    "..._OTHER_BRANCH if no way is sure to lead there: out of reach, near a singular posture, or too far for "
    "one tick.",
    "close_platforms": "Loops closed from where the platforms are: `pose` (x, y, z, qx, qy, qz, qw) of each "
    "platform in the base of its module, `twist` (velocity of its origin, angular velocity) and `twist_dot` "
    "(their time derivatives, classical) in the axes of that base. Other modules follow their motors as in "
    "`close`. Call it again with its q until the guard is at most 1.",
    "map_to_joints": "Output joints from motors: positions through the loops, rates, efforts of equal power, "
    "and the rates' matrix by rows. One Newton step from the posture `near`: call it again with its q until "
    "the guard is at most 1.",
    "map_to_motors": "Motors from output joints, as `map_to_joints` the other way.",
}


#: What the header says of robots that no motor holds.
FREE_BASE = [
    "",
    "   The base is free: the first six numbers of v are its twist in its own axes, velocity first, and",
    "   those of a their derivatives. No motor acts on them. In `idm`, a must be a motion that weight,",
    "   wrenches and motors can cause, as `ddm` computes it, else the guard is above 1. A robot that stands",
    "   needs the ground's wrenches on its feet: export them as arguments (`wrenches`).",
]


def _body_names(robot: HybridRobot) -> list[str]:
    """Return a name for each body: its first link, whose frame is the body's."""
    first = {body: link for link, (body, _, _) in reversed(robot.bodies.place.items())}
    return [first.get(body, "") for body in range(len(robot.bodies.bodies))]


def _places(names: Sequence[str], places: Sequence[slice]) -> list[str]:
    """Return lines that list the index range of each name."""
    return [f"     {at.start}..{at.stop - 1}  {name}" for name, at in zip(names, places, strict=True)]


def _numbered(names: Sequence[str]) -> list[str]:
    """Return lines that list names by their numbers."""
    return [f"     {i}  {name}" for i, name in enumerate(names)]


def comment(lines: Sequence[str]) -> str:
    """Return a C comment; line breaks and comment signs inside names are made harmless."""
    text = "\n".join(" ".join(re.split(r"[\r\n]", line)) for line in lines)
    return f"/* {re.sub(r'/(?=[*])|[*](?=/)', lambda sign: sign.group() + ' ', text)} */"


def header_text(
    robot: HybridRobot,
    programs: list[Program],
    name: str,
    dtype: str,
    joints: Sequence[str] = (),
    parameters: Sequence[Slot] = (),
    wrenches: Sequence[str] = (),
    given: Sequence[str] = (),
) -> str:
    """Return the header.

    Args:
        name: Prefix of the files and of all C identifiers.
        dtype: "float64" or "float32".
        joints: Output joints of the programs of the map.
        parameters: Numbers of the description that are arguments.
        wrenches: Links on which wrenches are arguments.
        given: Lines that list what is given to the control step from poses.
    """
    about = _about(robot, dtype, joints, parameters, wrenches, given)
    guard, lanes = f"{name.upper()}_H", in_lanes(programs)
    lines = [comment(about), f"#ifndef {guard}\n#define {guard}", '#ifdef __cplusplus\nextern "C" {\n#endif']
    lines.append(f"#define {name.upper()}_OTHER_BRANCH (({REAL[dtype]}){OTHER_BRANCH!r})")
    for program in programs:
        lines.append(work_type(program, name, dtype, lanes=lanes))
        lines.append(f"/* {WHAT[program.name]} */\n{prototype(program, name, dtype)};")
    return "\n\n".join([*lines, "#ifdef __cplusplus\n}\n#endif", "#endif"]) + "\n"


def _about(
    robot: HybridRobot,
    dtype: str,
    joints: Sequence[str],
    parameters: Sequence[Slot],
    wrenches: Sequence[str],
    given: Sequence[str],
) -> list[str]:
    """Return the lines that say what the functions' inputs and outputs are; arguments as of the header."""
    values = zip(parameters, values_of(robot.description, parameters), strict=True)
    arguments = _numbered([f"{slot} ({value!r})" for slot, value in values])
    bodies = [f"     {24 * i}..{24 * i + 23}  {link}" for i, link in enumerate(_body_names(robot))]
    return [
        f"Dynamics of the robot '{robot.description.name}', base {robot.base}. {WRITTEN}.",
        "   SI units; positions and rates in the order and the coordinates of Pinocchio:",
        "   q", *_places(robot.joints, robot.q_slices),
        "   v, a", *_places(robot.joints, robot.v_slices),
        "   tau", *_numbered(robot.motors),
        "   bodies", *bodies,
        *(["   parameters (the robot's own numbers)", *arguments] if arguments else []),
        *(["   wrenches on links: force, moment about the link's origin, its axes"] if wrenches else []),
        *(f"     {6 * i}..{6 * i + 5}  {link}" for i, link in enumerate(wrenches)),
        *(["   pose, twist, twist_dot", *_posed(robot)] if posed_modules(robot) else []),
        *(_sides(robot, joints) if joints else []),
        *given,
        *(FREE_BASE if robot.base == "floating" else []),
        "",
        "   Each function gives a guard: use the results where `guard <= 1`, and nowhere else. Above 1,",
        "   positions, rates or accelerations do not close the loops (to "
        f"{GUARD_CLOSED[dtype]:g} of their size),",
        "   or the robot is near a posture where the pivots of the elimination vanish. NaN: a number that",
        "   is not finite came in or out. `work` is memory of yours; nothing in it is kept between calls,",
        "   and nothing else is written: calls may run at the same time, each with its own.",
    ]  # fmt: skip


def _posed(robot: HybridRobot) -> list[str]:
    """Return lines that list the platforms of the function `close_platforms` with their bases."""
    names = _body_names(robot)
    out = []
    for i, k in enumerate(posed_modules(robot)):
        module = robot.modules[k]
        m = module.mechanism
        joint = module.joints[int(m.cut.bodies[m.spec.platforms[0] + 1]) - 1]
        platform, base = names[robot.body_of_joint[joint]], names[robot.bodies.place[module.base][0]]
        out.append(f"     {7 * i}..{7 * i + 6}, {6 * i}..{6 * i + 5}  {platform} in {base}")
    return out


def _sides(robot: HybridRobot, joints: Sequence[str]) -> list[str]:
    """Return lines that list both sides of the map."""
    sides = {"joint": joints, "motor": motors_beside(robot, joints)}
    heads = [f"   {side}_position, {side}_rate, {side}_effort" for side in sides]
    return [x for head, names in zip(heads, sides.values(), strict=True) for x in (head, *_numbered(names))]
