"""Choose the driven joints: from the first source that names them, in a fixed order, else by a rule."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..errors import ModelError
from .names import closest, did_you_mean, listed
from .records import Coupling, Joint, MotorSource, MotorStatement, RobotFile

#: Sources of motor names, the strongest first; names that the caller passes come before all of them.
RANKING: tuple[MotorSource, ...] = (
    "side-car", "model file", "actuator", "transmission", "independent", "interface", "names",
)  # fmt: skip

#: What is told of actuators that are no motors.
MEND = "To drive other joints, name them: motors=[..], --motors, or motors = [..] in model.toml"

#: Couplings are dependent below this singular value, where factors are at most 1, and hold a joint that the
#: motions they leave move by less.
COUPLED = 1e-9
#: Position at which the slopes of bent couplings are taken: any that is no root of theirs [m or rad].
GENERIC = 0.3819660113

#: The rule for a tree whose files name no motor.
EVERY_JOINT = "every joint, because there is no closure and no file names motors"


def choose_motors(robot: RobotFile, motors: Sequence[str] | None) -> tuple[tuple[str, ...], str]:
    """Return the names of the driven joints, and the source or rule that they come from.

    The order of sources is: the caller, the side-car's `name_mot`, the model file's `motors`, MJCF's
    and USD's actuators, URDF transmissions, URDF+ `independent=`, interfaces of ros2_control, names of
    joints. If no source names motors, the candidates are the one-freedom joints that mimic no other. In a
    tree (no closure, no coupling except `<mimic>`) all of them are driven. Otherwise those with a finite
    effort limit above zero are driven; if these are all candidates, the limits do not distinguish motors, and
    no joint is driven.

    Raises:
        ModelError: A name is unknown, is stated twice, or belongs to a joint that cannot be driven.
    """
    if motors is not None:
        statement = MotorStatement("names", "the caller (motors=)", tuple(motors), robot.file)
        return _checked(robot, statement), statement.where
    stated = sorted(robot.motors, key=lambda statement: RANKING.index(statement.source))
    if not stated:
        return _by_rule(robot)
    statement, joints = stated[0], {joint.name for joint in robot.joints}
    undriven = [joint.name for joint in _free_joints(robot) if joint.name not in statement.names]
    lost = [name for name in statement.names if name not in joints and not closest(name, undriven)]
    if lost and statement.source in ("transmission", "interface"):  # of joints that were cut away
        where = statement.where.removeprefix("URDF ")
        at = f"{statement.file}:{statement.line}: " if statement.line else ""
        robot.notes.append(f"{at}{where} names joints that the robot does not have: {listed(lost)}")
        statement = statement._replace(names=tuple(name for name in statement.names if name not in lost))
    return _checked(robot, statement), statement.where


def moved_by(driven: Iterable[str], couplings: Sequence[Coupling]) -> set[str]:
    """Return driven joints, and those that couplings determine from them.

    It makes no difference whether the file states a coupling as `<mimic>` or otherwise.
    """
    moved = {*driven}
    left = sorted({name for coupling in couplings for name, _ in coupling.terms} - moved)
    if not left:
        return moved
    K = np.zeros((len(couplings), len(left)))
    for row, coupling in zip(K, couplings, strict=True):
        rates = coupling.rates(dict.fromkeys((name for name, _ in coupling.terms), GENERIC))
        size = max(map(abs, rates.values()))
        for name, rate in rates.items():
            if name not in moved and size:
                row[left.index(name)] += rate / size
    s, Vt = np.linalg.svd(K)[1:]
    open_motions = np.abs(Vt[int((s > COUPLED).sum()) :]).max(axis=0, initial=0.0)
    return moved | {name for name, most in zip(left, open_motions, strict=True) if most <= COUPLED}


def _by_rule(robot: RobotFile) -> tuple[tuple[str, ...], str]:
    free = _free_joints(robot)
    if not robot.closures and all(_is_mimic(coupling) for coupling in robot.couplings):
        return tuple(joint.name for joint in free), EVERY_JOINT
    strong = [joint.name for joint in free if 0 < joint.effort < np.inf]
    moving = [joint for joint in robot.joints if joint.kind.nv and joint.name not in robot.closing]
    if 0 < len(strong) < len(moving):
        return tuple(strong), "joints with an effort limit above zero, because no file names motors"
    robot.notes.append(
        "no file says which joints of this closed-loop robot are driven: pass motors=[...] or --motors "
        "A,B, or write motors = [...] in model.toml, <transmission> in the URDF, or name_mot in robot.yaml"
    )
    return (), "nothing: no file names motors, and the effort limits do not distinguish them"


def _free_joints(robot: RobotFile) -> list[Joint]:
    """Return the joints with one freedom that mimic no other and let no body move freely."""
    others = {coupling.name for coupling in robot.couplings if _is_mimic(coupling)}
    others |= robot.undriven | robot.closing
    return [joint for joint in robot.joints if joint.kind.single and joint.name not in others]


def _is_mimic(coupling: Coupling) -> bool:
    """Check whether a coupling came from `<mimic>`: it then has the name of the following joint."""
    return coupling.name == coupling.terms[0][0]


def _checked(robot: RobotFile, statement: MotorStatement) -> tuple[str, ...]:
    kinds = {joint.name: joint.kind for joint in robot.joints}
    known = [name for name, kind in kinds.items() if kind.single]
    for index, name in enumerate(statement.names):
        wrong = "is stated twice" if name in statement.names[:index] else ""
        if name not in kinds:
            hint = did_you_mean(name, known) or f"; joints that can be driven: {listed(known)}"
            wrong = f"is not a joint of the robot{hint}"
        elif name not in known:
            wrong = f"is a {kinds[name]} joint; a motor drives one freedom"
        if wrong:
            raise ModelError(
                f"motor '{name}' {wrong} (from {statement.where})",
                file=statement.file, line=statement.line, element=name,
            )  # fmt: skip
    return statement.names
