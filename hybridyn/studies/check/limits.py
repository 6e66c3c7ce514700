"""Limits that contradict themselves, motors without them, and a home posture outside them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ...description.records import Joint
from .finding import Finding
from .subject import Subject

#: A home position may lie outside a limit by this part of its range: files are rounded.
HOME_SLACK = 1e-6
ONE_FREEDOM = ("revolute", "prismatic")


def check_limits(subject: Subject) -> Iterator[Finding]:
    """Judge the limits of every joint."""
    yield from _crossed(subject)
    motors = set(subject.description.motors)
    followers = {coupling.name for coupling in subject.description.couplings}
    for joint in subject.description.joints:
        if joint.kind in ONE_FREEDOM:
            yield from _range(subject, joint, joint.name in motors)
        if joint.name in motors and joint.name not in followers:
            yield from _motor(subject, joint)


def _crossed(subject: Subject) -> Iterator[Finding]:
    """Look at the limits as they are written: the reader drops those that contradict each other."""
    for node in subject.root.children("joint"):
        limit, name = node.child("limit"), node.text("name")
        if limit is None or name not in subject.joints or subject.joints[name].kind not in ONE_FREEDOM:
            continue
        lower = limit.number("lower", -math.inf, infinite=True)
        upper = limit.number("upper", math.inf, infinite=True)
        if lower > upper:
            yield subject.of_joint(
                "limits-crossed",
                name,
                f"lower {lower:g}, upper {upper:g} {_unit(subject.joints[name])}: no position is allowed",
                "hybridyn takes it as not limited; other programs will not move it",
                "exchange the two, or correct a sign",
            )


def _unit(joint: Joint) -> str:
    return "m" if joint.kind == "prismatic" else "rad"


def _range(subject: Subject, joint: Joint, driven: bool) -> Iterator[Finding]:
    stated = f"lower {joint.lower:g}, upper {joint.upper:g} {_unit(joint)}"
    if joint.lower == joint.upper:
        yield subject.of_joint(
            "limits-empty",
            joint.name,
            f"{stated}: the range is empty, so it is taken as not stated",
            "a workspace or a controller that keeps to limits would never move it"
            if driven
            else "exporters write 0 and 0 for passive joints; hybridyn does not stop them there",
            "write the true range, or leave lower and upper out",
        )
    else:
        yield from _home(subject, joint)


def _home(subject: Subject, joint: Joint) -> Iterator[Finding]:
    if subject.robot is not None:
        at = subject.robot.q_slices[subject.robot.joint_index[joint.name]]
        position = float(subject.robot.home[at.start])
    else:
        position = subject.description.home.get(joint.name, (0.0,))[0]
    width = joint.upper - joint.lower
    slack = HOME_SLACK * (width if math.isfinite(width) else 1.0)
    if joint.lower - slack <= position <= joint.upper + slack:
        return
    named = joint.name in subject.description.home
    yield subject.of_joint(
        "home-outside-limits",
        joint.name,
        f"stands at {position:.6g} {_unit(joint)} at home, its limits are {joint.lower:g} to {joint.upper:g}",
        "simulations and workspaces start where the joint cannot be",
        "correct [home] in model.toml, or the limits"
        if named
        else "state a home position within them: [home] in model.toml",
    )


def _motor(subject: Subject, joint: Joint) -> Iterator[Finding]:
    for what, value, unit in (
        ("effort", joint.effort, "N" if joint.kind == "prismatic" else "N m"),
        ("speed", joint.velocity, "m/s" if joint.kind == "prismatic" else "rad/s"),
    ):
        if value <= 0.0:
            yield subject.of_joint(
                "limits-zero",
                joint.name,
                f"is a motor with {what} limit {value:g} {unit}",
                "read as a limit it may never move; redundant motors share by their effort limits",
                f"write its {what} limit, or leave <limit {'effort' if what == 'effort' else 'velocity'}> "
                "out if it is not known",
            )
    endless = not np.isfinite([joint.lower, joint.upper]).all()
    if joint.kind == "prismatic" and endless:
        yield subject.of_joint(
            "limits-missing",
            joint.name,
            "is a slide that is driven, without lower and upper limit",
            "a workspace or a simulation will drive it through its end",
            "write <limit lower= upper=> in metres",
        )
