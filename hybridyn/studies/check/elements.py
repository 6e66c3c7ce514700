"""Check joints: units, limits, home posture, `<mimic>`."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ...description.names import listed
from ...description.records import Joint
from ...streams.departures import position_limits
from ...tables.signals import unit_of
from .finding import Finding
from .subject import Subject

#: A median joint offset above this length suggests a file in millimetres [m].
GIANT = 5.0
#: Whole-numbered angular limits of at least this many turns look like degrees.
TURNS = 2.0


def check_units(subject: Subject) -> Iterator[Finding]:
    """Check that lengths are in metres and angles in radians."""
    yield from _lengths(subject)
    yield from _angles(subject)


def _lengths(subject: Subject) -> Iterator[Finding]:
    offsets = {
        joint.name: float(np.linalg.norm(joint.placement[:3, 3])) for joint in subject.description.joints
    }
    lengths = [length for length in offsets.values() if length > 0]
    for closure in subject.description.closures:
        ends = (closure.frame_a[:3, 3], closure.frame_b[:3, 3])
        lengths += [float(np.linalg.norm(end)) for end in ends if end.any()]
    if not lengths or np.median(lengths) < GIANT:
        return
    longest = max(offsets, key=lambda name: offsets[name])
    yield subject.of_joint(
        "millimetres",
        longest,
        f"half of all offsets between joints are longer than {float(np.median(lengths)):.3g} m; this one is "
        f"{offsets[longest]:.4g} m",
        "if lengths are a thousand times too large, every torque is wrong",
        "if the file is in millimetres, divide every xyz, radius, length and prismatic limit by 1000",
    )


def _angles(subject: Subject) -> Iterator[Finding]:
    for joint in subject.description.joints:
        if not joint.kind.additive or joint.kind.slides:
            continue
        ends = [end for end in (joint.lower, joint.upper) if math.isfinite(end) and end != 0]
        wide = [end for end in ends if abs(end) >= TURNS * 2 * math.pi]
        if wide and all(end == round(end) for end in ends):
            stated = f"{joint.lower:g} to {joint.upper:g}"
            yield subject.of_joint(
                "degrees",
                joint.name,
                f"its limits are {stated}, whole numbers beyond {TURNS:g} turns",
                "URDF angles are in radians, so these limits never stop the joint",
                "multiply them by pi / 180, or make the joint continuous",
            )


def check_limits(subject: Subject) -> Iterator[Finding]:
    """Check the limits of every joint."""
    yield from _crossed(subject)
    followers = {coupling.name for coupling in subject.description.couplings}
    for joint in subject.description.joints:
        if joint.kind.additive:
            yield from _home(subject, joint)
        if joint.name in subject.description.motors and joint.name not in followers:
            yield from _motor(subject, joint)


def _crossed(subject: Subject) -> Iterator[Finding]:
    """Find limits that the reader dropped, since the lower is above the upper."""
    for name, (lower, upper) in subject.description.crossed.items():
        yield subject.of_joint(
            "limits-crossed",
            name,
            f"lower {lower:g}, upper {upper:g} {unit_of(subject.joints[name].kind)}: no position is allowed",
            "hybridyn treats the joint as not limited; other programs may not move it",
            "exchange the two limits, or correct a sign",
        )


def _home(subject: Subject, joint: Joint) -> Iterator[Finding]:
    if subject.robot is not None:
        at = subject.robot.q_slices[subject.robot.joint_index[joint.name]]
        position = float(subject.robot.home[at.start])
    else:
        position = subject.description.home.get(joint.name, (0.0,))[0]
    limits = position_limits(joint)
    if limits is None or limits[0] <= position <= limits[1]:
        return
    named = joint.name in subject.description.home
    yield subject.of_joint(
        "home-outside-limits",
        joint.name,
        f"is at {position:.6g} {unit_of(joint.kind)} at home; its limits are {joint.lower:g} to "
        f"{joint.upper:g}",
        "simulations and workspaces start at a position that the joint cannot reach",
        "correct [home] in model.toml, or the limits"
        if named
        else "state a home position within them: [home] in model.toml",
    )


def _motor(subject: Subject, joint: Joint) -> Iterator[Finding]:
    for what, value, unit in (
        ("effort", joint.effort, unit_of(joint.kind, "effort")),
        ("speed", joint.velocity, unit_of(joint.kind, "speed")),
    ):
        if value <= 0.0:
            yield subject.of_joint(
                "limits-zero",
                joint.name,
                f"is a motor with {what} limit {value:g} {unit}",
                "0 counts as no limit: nothing tells if a motion asks too much of the motor",
                f"state its {what} limit, or omit <limit {'effort' if what == 'effort' else 'velocity'}> "
                "if it is not known",
            )


def check_mimics(subject: Subject) -> Iterator[Finding]:
    """Check that no joint with a motor follows joints that all have motors, by `<mimic>` or the like."""
    driven = {*subject.description.motors}
    for coupling in subject.description.couplings:
        follower, *leaders = (name for name, _ in coupling.terms)
        if coupling.name == follower and driven.issuperset((follower, *leaders)):
            yield subject.of_joint(
                "mimic-motor",
                follower,
                f"is a motor and follows {listed(leaders)}, driven as well",
                "one motion then has two motors, and shares its effort among them",
                "remove it from the motors, or the coupling if its own motor moves it",
            )
