"""One finding: its place, the error, why it matters, and how to mend it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "note"]
#: The worst first. An error leads to wrong numbers or to none, a warning probably does, a note informs.
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")

#: Every code with its severity and its title. Codes do not change, so that a CI job can name them.
CODES: dict[str, tuple[Severity, str]] = {
    # the file
    "unreadable": ("error", "the file cannot be read as a robot"),
    "dropped": ("warning", "a force, an inertia or a constraint that the file states is not read"),
    "reader": ("note", "the reader ignored something in the file, or interpreted it in a particular way"),
    # masses
    "negative-inertia": ("error", "a principal moment of inertia is negative"),
    "triangle-inequality": ("warning", "a principal moment is larger than the sum of the other two"),
    "inertia-without-mass": ("warning", "a link has inertia but no mass"),
    "missing-inertial": ("warning", "a moving link has no mass"),
    "massless-motion": ("warning", "a motion has no inertia"),
    "com-outside": ("warning", "a centre of mass is far outside its link's shape"),
    "inertia-too-large": ("warning", "an inertia is too large for a mass inside the link's shape"),
    "inertia-too-small": ("note", "an inertia is far smaller than that of the link's shape"),
    "too-dense": ("warning", "a link is denser than any material"),
    "no-mass": ("warning", "no body of a module has mass"),
    "massless-robot": ("error", "no link has mass"),
    # units
    "millimetres": ("warning", "lengths look like millimetres"),
    "mesh-scale": ("warning", "a mesh is far larger than its robot"),
    "degrees": ("warning", "limits look like degrees"),
    # shapes
    "broken-shape": ("warning", "a shape cannot be read"),
    "missing-mesh": ("warning", "a mesh file is missing"),
    "broken-mesh": ("warning", "a mesh file cannot be read"),
    "unread-meshes": ("note", "mesh files were not read, because trimesh is not installed"),
    # limits
    "limits-crossed": ("error", "a lower limit is above the upper one"),
    "limits-zero": ("warning", "a motor's effort or speed limit is zero, which counts as none"),
    "home-outside-limits": ("warning", "the home posture is outside the limits"),
    # mimic
    "mimic-motor": ("warning", "a joint with a motor mimics joints with motors"),
    # loops
    "lost-loops": ("warning", "the robot seems to have loops that its file does not state"),
    "loops-close-nowhere": ("error", "no posture closes a module's loops"),
    "rank-in-doubt": ("error", "the mobility is uncertain because the file is rounded"),
    "no-robot": ("error", "no robot can be built from the file"),
    "open-at-home": ("warning", "loops are open at the home posture"),
    "axis-across": ("warning", "a hinge can never turn: its axis is across those of its loop"),
    "same-loop": ("warning", "two closures state the same loop"),
    "locked": ("error", "closures leave a module no degree of freedom"),
    "rounded": ("note", "some closure rows depend on others, but only up to the file's rounding"),
    # motors
    "no-motors": ("warning", "the robot has no motor"),
    "motor-cannot-move": ("error", "closures prevent a motor from moving"),
    "motors-missing": ("warning", "no motor drives some motion of a module"),
    "motors-opposed": ("error", "two motors drive the same motion, and no motor drives another motion"),
    "architectural": ("error", "there is a motion that the motors cannot drive, at every posture"),
    # singularities at home
    "singular-closures": ("warning", "the home posture is a constraint singularity"),
    "singular-parallel": ("warning", "the home posture is a parallel (type 2) singularity"),
}


@dataclass(frozen=True)
class Finding:
    """One error, warning or note about a robot's files.

    Attributes:
        code: Stable code, a key of `CODES`.
        element: The element concerned: "link 'arm'", "module 'm1'"; empty for the whole file.
        message: What is wrong, with the numbers.
        why: Why it matters.
        mend: How to mend it.
        file: The file, or None.
        line: Line in the file (of the expanded text for xacro), or None.
    """

    code: str
    element: str
    message: str
    why: str
    mend: str
    file: str | None = None
    line: int | None = None

    @property
    def severity(self) -> Severity:
        """Severity of the finding."""
        return CODES[self.code][0]

    @property
    def place(self) -> str:
        """File and line as compilers print them; empty if unknown."""
        if self.file is None:
            return ""
        return f"{self.file}:{self.line}" if self.line else self.file
