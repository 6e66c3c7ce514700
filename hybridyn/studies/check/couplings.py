"""Check `<mimic>` joints: driven followers, chains, multipliers of zero, and limits that stop the leader."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

from ...description.records import Coupling
from .finding import Finding
from .subject import Subject

#: A leader's range, mapped to the follower, may exceed the follower's range by this part of it: files are
#: rounded.
RANGE_SLACK = 1e-3


def check_couplings(subject: Subject) -> Iterator[Finding]:
    """Check every coupling that was read from a `<mimic>` element."""
    mimics = {c.name: c for c in subject.description.couplings if c.name == c.terms[0][0]}
    motors = set(subject.description.motors)
    for name, coupling in mimics.items():
        find = partial(_finding, subject, coupling)
        leaders = [(joint, -k / coupling.terms[0][1]) for joint, k in coupling.terms[1:]]
        if name in motors:
            yield find(
                "mimic-motor",
                "is a motor and mimics another joint",
                "one motion then has two motors, or a motor that does not exist",
                "remove it from the motors, or remove <mimic>",
            )
        for leader, ratio in leaders:
            if ratio == 0.0:
                yield find(
                    "mimic-zero",
                    f"mimics '{leader}' with multiplier 0",
                    "it does not move, whatever the leader does",
                    'state the multiplier, or make the joint type="fixed"',
                )
            elif leader in mimics:
                yield find(
                    "mimic-chain",
                    f"mimics '{leader}', which mimics another joint",
                    "hybridyn follows the chain; many programs do not",
                    "make it mimic the first joint, with the product of the multipliers",
                )
            else:
                yield from _limits(subject, coupling, leader, ratio, find)


def _limits(
    subject: Subject, coupling: Coupling, leader: str, ratio: float, find: Callable[..., Finding]
) -> Iterator[Finding]:
    """Compare the leader's range, mapped to the follower, with the follower's own range."""
    first, second = subject.joints[leader], subject.joints[coupling.name]
    ends = [first.lower, first.upper, second.lower, second.upper]
    if not all(map(math.isfinite, ends)) or first.lower >= first.upper or second.lower >= second.upper:
        return
    offset = coupling.offset / coupling.terms[0][1]
    reached = sorted(ratio * end + offset for end in (first.lower, first.upper))
    slack = RANGE_SLACK * (second.upper - second.lower)
    if second.lower - slack <= reached[0] and reached[1] <= second.upper + slack:
        return
    yield find(
        "mimic-limits",
        f"would move from {reached[0]:.4g} to {reached[1]:.4g} with '{leader}', but its limits are "
        f"{second.lower:g} to {second.upper:g}",
        "the leader stops before its own limits, or the follower's are wrong",
        "widen the follower's limits, or check multiplier and offset",
    )


def _finding(subject: Subject, coupling: Coupling, code: str, message: str, why: str, mend: str) -> Finding:
    place = subject.places.of("joint", coupling.name, coupling.line)
    return Finding(code, f"joint '{coupling.name}'", message, why, mend, *place)
