"""What writers share: what they receive and return, what is lost, and numbers and elements as text.

Numbers, rotations and inertias read back as the same, or to rounding.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..description.closure_forms import PERPENDICULAR, ROWS, words_of_rows
from ..description.names import listed
from ..description.placement import angle_of
from ..description.records import Array, Closure, Coupling, Description, Joint
from ..description.shape_files import Shape
from ..joints.kinds import JointKind

#: Distance by which closures may open in a simulator that holds them with springs [m], where left out.
TIGHTNESS = 1e-4
#: Gravity of a robot whose file states none [m/s^2].
USUAL_GRAVITY = (0.0, 0.0, -9.81)
#: Limits of a joint; a speed or effort of zero is none.
LIMITS = ("lower", "upper", "speed_limit", "effort_limit")
#: Friction and rotor of a joint.
FORCES = ("damping", "friction", "rotor_inertia", "gear_ratio")
#: What becomes of a floating joint where a body that no joint holds is one.
FREED = "floating joints have the name of their link and _free, and start at the world"
#: A joint without limits, friction and rotor.
PLAIN = Joint("", JointKind.FIXED, "", "", np.eye(4), np.zeros(3))


@dataclass(frozen=True)
class ConversionRequest:
    """A robot to be written.

    Attributes:
        description: The robot.
        target: The file to be written; a writer does not write it, but may refer to other files from it.
        shapes: The visual shapes of its links; a mesh is named by its address, or by its path from the folder
            of the file to be written.
        tightness: Distance by which closures may open in a simulator that holds them with springs [m].
    """

    description: Description
    target: Path
    shapes: tuple[Shape, ...] = ()
    tightness: float = TIGHTNESS


@dataclass(frozen=True)
class Written:
    """What a writer returns.

    Attributes:
        text: The content of the file.
        notes: Remarks for the user that are no losses.
        beside: Content of the files beside it that hybridyn also reads, by their ending: ".model.toml" after
            the file's name, ".yaml" in place of its ending.
        losses: What the format cannot say, one line each, with the names of joints, links and closures. What
            hybridyn reads back from the files beside is not lost. `convert.write` adds them.
    """

    text: str
    notes: tuple[str, ...] = ()
    beside: Mapping[str, str] = field(default_factory=dict)
    losses: tuple[str, ...] = ()


class Losses:
    """Reasons in the order in which they occur, each with all names that it concerns."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, reason: str, name: str = "") -> None:
        """Add a loss.

        Args:
            reason: What is lost and what is written in its place, in words that fit several names.
            name: Name of the joint, link or closure; "" if it concerns the whole robot.
        """
        self._names.setdefault(reason, {})[name] = None

    def lines(self) -> tuple[str, ...]:
        """Return one line for each reason: "speed limits of joints: 'elbow', 'wrist'"."""
        named = {reason: [name for name in names if name] for reason, names in self._names.items()}
        return tuple(f"{reason}: {listed(names)}" if names else reason for reason, names in named.items())


def home_of(d: Description, joint: Joint) -> tuple[float, ...]:
    """Return the home position of a joint: angles as one number, other coordinates as Pinocchio's.

    Args:
        joint: One of its joints, not fixed.
    """
    at = d.home.get(joint.name) or joint.kind.zero
    n = joint.kind.shift
    return at if joint.kind.ball or not at[n:] else (*at[:n], angle_of(at[n:]))


def add_of_several(
    joint: Joint, losses: Losses, limits: Sequence[str] = LIMITS, forces: Sequence[str] = FORCES
) -> None:
    """List limits and forces of a joint with several freedoms that are lost.

    Args:
        limits: Attributes of the joint, some of `LIMITS`.
        forces: Attributes of the joint, some of `FORCES`.
    """
    for what, words in (("limits", limits), ("friction and rotors", forces)):
        stated = any(getattr(joint, word) != getattr(PLAIN, word) for word in words)
        if joint.kind.nv > 1 and stated:
            losses.add(f"{what} of joints with several freedoms", joint.name)


def followers_of(
    couplings: Iterable[Coupling], losses: Losses
) -> tuple[dict[str, tuple[str, float, float]], list[Coupling]]:
    """Return couplings as `<mimic>`: one of two joints, which follows no other yet, follows the other one.

    Args:
        couplings: The couplings.
        losses: Receives their names: a `<mimic>` has that of its joint.

    Returns:
        Leader, factor and offset of each follower; and the couplings that are left.
    """
    found: dict[str, tuple[str, float, float]] = {}
    left = []
    for coupling in couplings:
        ends = (
            (coupling.terms, coupling.terms[::-1]) if len(coupling.terms) == 2 and not coupling.curve else ()
        )
        for (follower, own), (leader, other) in ends:
            if follower not in found:
                found[follower] = leader, -other / own, coupling.offset / own
                if coupling.name != follower:
                    losses.add("names of couplings, which are read back with those of joints", coupling.name)
                break
        else:
            left.append(coupling)
    return found, left


def rows_of(closure: Closure, losses: Losses) -> tuple[str, Array]:
    """Return the rows of a closure as words, and its own axes in those that the words are about.

    The words are about the axes of the closure's author, in which hybridyn reports wrenches.

    Args:
        losses: Receives a closure of which the words cannot be about the author's axes.

    Returns:
        The words, and a rotation, shape (3, 3): that of `Closure.turn`, or the identity.
    """
    order = closure.turn.argmax(axis=0)
    turn: Array = np.eye(3)[:, order]
    if closure.rotation == "perpendicular" or not np.array_equal(closure.turn, turn):
        if not np.array_equal(closure.turn, np.eye(3)):
            losses.add("axes in which hybridyn reports the wrenches of closures", closure.name)
        order, turn = np.arange(3), np.eye(3)
    own = {kind + "xyz"[i]: kind + "xyz"[axis] for kind in "tr" for i, axis in enumerate(order)}
    words = {own.get(word, word) for word in words_of_rows(closure.translations, closure.rotation)}
    return " ".join(word for word in (*ROWS, PERPENDICULAR) if word in words), turn
