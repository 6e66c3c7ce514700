"""Find signs that a robot had loops which its file does not state, so that it would be loaded as a tree.

The signs are frames named in pairs, joints of a tree that look passive, and files of loops beside the robot.
None of them proves a loop. The robot is therefore loaded, and every sign is reported: `load` warns, and
`info` lists them.
"""

from __future__ import annotations

import contextlib
import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .motors import EVERY_JOINT
from .names import listed
from .placement import poses_at_zero
from .records import FREEDOMS, Description, Format, Joint
from .weightless import Bodies

#: Frames coincide if they are closer than this fraction of the robot's size: CAD closes loops to 1e-4 of it.
TOGETHER = 1e-3
#: End of a name that distinguishes the two frames of a pair (a number or letter), and what may follow it.
ENDING = r"(.*?)[_.-]?(?:(?<![0-9])([0-9]+)|(?<=[_.-])([A-Za-z]))(?:[_.-](?:frame|link|joint))?"
#: The ends of two names that make a pair.
ENDS = ({"1", "2"}, {"0", "1"}, {"a", "b"})
#: Words of names that suggest a loop.
LOOP_WORDS = {
    "cl", "close", "closed", "closing", "closure", "constraint", "cut", "fermeture", "loop", "weld",
}  # fmt: skip
CLOSED_LOOP = r"(?i)closed_?loop|loop_?closure|closing_?loop|loop_?joint"
BESIDE = r"(?i).*(submechanism|loop_?closure|closed_?loop).*\.ya?ml"
FOLDERS = ("submechanism", "smurf")
#: Most entries of a folder that are examined.
MOST_FILES = 1000
#: How each format states loops.
STATE_THEM: dict[Format, str] = {
    "URDF": "state its loops as <loop>, or the pairs of frames in a side-car robot.yaml (closed_loop)",
    "MJCF": "state its loops as <connect> or <weld> in <equality>",
    "SDF": "state its loops as joints: a link may be the child of several",
    "USD": "state its loops as joints with excludeFromArticulation",
    "Pinocchio": "give its loops as constraint models",
}


class Sign(NamedTuple):
    """A sign of loops that are not stated.

    Attributes:
        message: The observation.
        mend: The correction.
        link: A link that it concerns, or None.
        joint: A joint that it concerns, or None.
    """

    message: str
    mend: str
    link: str | None = None
    joint: str | None = None


def lost_loops(description: Description) -> list[Sign]:
    """Return the signs that a robot had loops which its file does not state."""
    out = [*_paired_frames(description)]
    return out if description.closures else [*out, *_passive_joints(description), *_files_beside(description)]


def _paired_frames(description: Description) -> Iterator[Sign]:
    """Yield signs for pairs of massless frames on two bodies that coincide or are named for a loop."""
    bodies, mend = Bodies(description), STATE_THEM[description.format]
    frames = _free_frames(description)
    pairs = [pair for pair in _pairs(frames) if bodies.of[pair[1]] != bodies.of[pair[2]]]
    coincident = _coincident(description, bodies, pairs)
    reported: set[str] = set()
    for stem, one, other in pairs:
        if {one, other} & reported:
            continue
        if (one, other) in coincident or LOOP_WORDS & _words(stem) or re.search(CLOSED_LOOP, stem):
            reported |= {one, other}
            at = ", and coincide in the zero posture" if (one, other) in coincident else ""
            message = f"massless frames '{one}' and '{other}' look like the two ends of a closed loop{at}"
            yield Sign(f"{message}, but no closure uses them", mend, link=one)
    lone = [joint.child for joint in frames if "closing" in _words(joint.child)]
    if lone := [name for name in lone if name not in reported]:
        message = f"massless frames {listed(lone)} are named for closing a loop, but no closure uses them"
        yield Sign(message, mend, link=lone[0])


def _free_frames(description: Description) -> list[Joint]:
    """Return the fixed joints of massless links that carry nothing, and that no closure uses."""
    taken = {joint.parent for joint in description.joints}
    taken |= {link for closure in description.closures for link in (closure.link_a, closure.link_b)}
    taken |= {link.name for link in description.links if link.mass or link.inertia.any()}
    return [joint for joint in description.joints if joint.kind == "fixed" and joint.child not in taken]


def _pairs(frames: list[Joint]) -> list[tuple[str, ...]]:
    """Return frames whose names, or whose joints' names, differ in their ends: the stem, and two links."""
    alike: dict[str, dict[str, dict[str, None]]] = {}
    for joint in frames:
        for name in (joint.child, joint.name):
            if match := re.fullmatch(ENDING, name):
                ends = alike.setdefault(match[1], {})
                ends.setdefault((match[2] or match[3]).lower(), {})[joint.child] = None
    return [
        (stem, *(link for end in sorted(ends) for link in ends[end]))
        for stem, ends in alike.items()
        if set(ends) in ENDS and all(len(links) == 1 for links in ends.values())
    ]


def _coincident(
    description: Description, bodies: Bodies, pairs: list[tuple[str, ...]]
) -> set[tuple[str, str]]:
    """Return the pairs that coincide in the zero posture, but not at the joint between their bodies."""
    if not pairs:
        return set()
    at = {description.root: np.zeros(3)}
    at |= {link: pose[:3, 3] for link, pose in poses_at_zero(description.joints).items()}
    near = TOGETHER * float(np.linalg.norm(np.ptp(np.array([*at.values()]), axis=0)))
    joined = {(joint.child, bodies.of[joint.parent]) for joint in description.joints}

    def together(one: str, other: str) -> bool:
        """Return whether the origins of two links coincide."""
        return bool(np.linalg.norm(at[one] - at[other]) <= near)

    return {
        (one, other)
        for _, one, other in pairs
        if together(one, other)
        and not any(
            ends in joined and together(one, ends[0])
            for ends in itertools.permutations((bodies.of[one], bodies.of[other]))
        )
    }


def _words(name: str) -> set[str]:
    """Return the words of a name in lower case, without numbers."""
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)}


def _passive_joints(description: Description) -> Iterator[Sign]:
    """Yield signs for joints of a tree that its file treats as passive: only a loop would move them."""
    followers = {coupling.name for coupling in description.couplings}
    free = [j for j in description.joints if FREEDOMS[j.kind] == 1 and j.name not in followers]
    mend = (
        f"name the motors (motors = [...] in model.toml); if it has loops, {STATE_THEM[description.format]}"
    )
    if description.motors_from == EVERY_JOINT:
        weak = [j for j in free if j.effort == 0.0]
        strong = [j for j in free if 0.0 < j.effort < np.inf]
        if weak and strong:
            yield Sign(
                f"{len(weak)} of its {len(free)} joints state effort 0, as passive joints of loops do "
                f"({listed(j.name for j in weak)}), yet each counts as a motor: no closure is stated",
                mend,
                joint=weak[0].name,
            )
        elif not strong and _is_suspicious(description, free, weak):
            yield Sign(
                f"none of its {len(free)} joints states an effort above 0, so every one counts as a motor, "
                "and no closure is stated",
                mend,
                joint=free[0].name,
            )
    elif "<transmission>" in description.motors_from:
        passive = [j.name for j in free if j.name not in description.motors]
        if passive:
            yield Sign(
                f"<transmission> drives {len(description.motors)} joints and leaves these passive: "
                f"{listed(passive)}; they move freely, because no closure is stated",
                f"if they are driven too, {mend}",
                joint=passive[0],
            )


def _is_suspicious(description: Description, free: list[Joint], weak: list[Joint]) -> bool:
    """Check whether joints without effort are passive joints, rather than joints without stated limits.

    They are if each of several joints states effort 0, or if the tree branches: a loop that was cut open
    leaves two chains.
    """
    movable = [joint for joint in description.joints if joint.kind != "fixed"]
    bodies = Bodies(description)
    ends = {joint.child for joint in movable} - {bodies.of[joint.parent] for joint in movable}
    return len(weak) == len(free) > 1 or len(ends) > 1


def _files_beside(description: Description) -> Iterator[Sign]:
    """Yield a sign for files of loops in the robot's folder, or in a folder that Phobos writes."""
    if description.source is None:
        return
    folder = Path(description.source).absolute().parent
    beside = [place for above in (folder, folder.parent) for place in _entries(above)]
    folders = [p for p in beside if p.name.lower().startswith(FOLDERS) and p.is_dir()]
    found = [
        file for place in (folder, *folders) for file in _entries(place) if re.fullmatch(BESIDE, file.name)
    ]
    if found:
        names = listed(dict.fromkeys(file.name for file in found))
        yield Sign(
            f"{names} beside it may state its loops, but is not read; the file itself states none",
            f"{STATE_THEM[description.format]}; move the file away if it belongs to another robot",
        )


def _entries(folder: Path) -> list[Path]:
    """Return the entries of a folder, sorted; none if the folder cannot be read."""
    with contextlib.suppress(OSError):
        return sorted(itertools.islice(folder.iterdir(), MOST_FILES))
    return []
