"""Compile an MJCF text with MuJoCo, and refuse what is not read; errors name the author's file and line."""

from __future__ import annotations

import contextlib
import importlib
import re
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import ModelError, install_advice
from ..names import unique
from ..placement import placement_from, rotation_from_quaternion
from ..records import Array
from ..urdf.xml_node import LARGEST_NUMBER
from .document import RIGID, Document, Place

#: MuJoCo's enumerations by the first part of their words.
ENUMERATIONS = {
    "mjOBJ": "mjtObj", "mjJNT": "mjtJoint", "mjEQ": "mjtEq", "mjTRN": "mjtTrn", "mjWRAP": "mjtWrap",
    "mjGAIN": "mjtGain", "mjBIAS": "mjtBias", "mjDYN": "mjtDyn", "mjDSBL": "mjtDisableBit",
}  # fmt: skip

#: Oldest version of MuJoCo whose MjSpec knows the numbers of its elements, as `mj_version` counts.
OLDEST = 333

_LENGTHS = {
    "body_pos": "pos", "body_quat": "quat", "body_mass": "mass", "body_ipos": "com",
    "body_inertia": "inertia", "jnt_pos": "pos", "jnt_axis": "axis", "jnt_stiffness": "stiffness",
}  # fmt: skip
_NEGATIVE = "damping, armature or frictionloss is negative or not finite"
#: Least number, by the name of MuJoCo's array, and what is said of others and of those that are not finite.
NUMBERS = {
    **{
        field: (-LARGEST_NUMBER, f"its {what} is not finite, or too large")
        for field, what in _LENGTHS.items()
    },
    **{f"dof_{what}": (0.0, _NEGATIVE) for what in ("damping", "armature", "frictionloss")},
}
#: What nothing may have.
REFUSED = {
    "tendon_stiffnesspoly": "stiffness that depends on a tendon's length is not read; keep its first number",
    "tendon_dampingpoly": "damping that depends on a tendon's speed is not read; keep its first number",
    "jnt_springyield": "springyield is not read; remove it",
    "actuator_dampingpoly": "damping that depends on the speed is not read; keep its first number",
}
#: What a joint with several freedoms may not have.
REFUSED_OF_SEVERAL = {
    "jnt_stiffnesspoly": "stiffness that depends on the position of a joint with several freedoms is not "
    "read; keep its first number"
}

_LINE = re.compile(r"\bline (\d+)")
_NAME = re.compile(r"Element name '([^']+)'")


@dataclass(frozen=True)
class Compiled:
    """A compiled model, and the places of its elements in the files.

    Attributes:
        mujoco: The module.
        spec: MuJoCo's MjSpec.
        model: MuJoCo's MjModel.
        file: Path of the robot's file.
        places: Place of each line of the text that was compiled.
    """

    mujoco: Any
    spec: Any
    model: Any
    file: str
    places: list[Place]

    @cached_property
    def bodies(self) -> list[str]:
        """Name of each body, "world" first."""
        return self._names("body", [f"body{number}" for number in range(self.model.nbody)])

    @cached_property
    def joints(self) -> list[str]:
        """Name of each joint; one without a name is named after its body."""
        return self._names("joint", [f"{self.bodies[body]}_joint" for body in self.model.jnt_bodyid])

    @cached_property
    def tied_bodies(self) -> dict[int, tuple[int, int]]:
        """Numbers of the two bodies of every connect and weld, by its number."""
        model, out = self.model, {}
        bodies = {self.code("mjOBJ_BODY"): range(model.nbody), self.code("mjOBJ_SITE"): model.site_bodyid}
        for number in range(model.neq):
            if model.eq_type[number] in (self.code("mjEQ_CONNECT"), self.code("mjEQ_WELD")):
                of = bodies[int(model.eq_objtype[number])]
                out[number] = int(of[model.eq_obj1id[number]]), int(of[model.eq_obj2id[number]])
        return out

    def name(self, kind: str, number: int) -> str:
        """Return the name of an element as the file gives it, "" for none.

        Args:
            kind: "body", "joint", "geom", "site", "equality", "tendon", "actuator" or "key".
            number: Its number in the compiled model.
        """
        of_kind = self.code(f"mjOBJ_{kind.upper()}")
        return self.mujoco.mj_id2name(self.model, of_kind, number) or ""

    def code(self, word: str) -> int:
        """Return the value of one of MuJoCo's enumerators, -1 if this version has none of the name.

        Args:
            word: Name of the enumerator, such as "mjJNT_HINGE".
        """
        group, _, _ = word.partition("_")
        value = getattr(getattr(self.mujoco, ENUMERATIONS[group]), word, None)
        return -1 if value is None else int(value)

    def rows(self, field: str) -> Array:
        """Return an array of the model as rows of numbers; none where this version of MuJoCo lacks it."""
        return np.atleast_2d(np.asarray(getattr(self.model, field, ()), dtype=float).T).T

    def line(self, kind: str, number: int) -> int | None:
        """Return the line of an element in the robot's own file, or None if it is in an included file.

        Args:
            kind: "body", "joint", "geom", "equality", "tendon" or "actuator".
            number: Its number in the compiled model.
        """
        file, line = self._place(kind, number)
        return line if file == self.file else None

    def at(self, kind: str, number: int) -> str:
        """Return the place of an element as notes begin with it: `robot.xml:12`."""
        file, line = self._place(kind, number)
        return f"{file}:{line}" if line else file

    def error(self, kind: str, number: int, message: str) -> ModelError:
        """Return (not raise) the error that names an element, its file and its line."""
        name = self.label(kind, number)
        file, line = self._place(kind, number)
        label = f"{kind} '{name}'" if name else f"{kind} {number}"
        return ModelError(f"{label}: {message}", file=file, line=line, element=name or kind)

    def label(self, kind: str, number: int) -> str:
        """Return the name of an element, also one that is made for it; "" for none."""
        made = {"body": self.bodies, "joint": self.joints}
        return made[kind][number] if kind in made else self.name(kind, number)

    def _place(self, kind: str, number: int) -> Place:
        return _place_in(self._info.get((kind, number), ""), self.places) or (self.file, None)

    def _names(self, kind: str, made: list[str]) -> list[str]:
        """Return the names of elements; one without a name takes the one that is made for it."""
        given = [self.name(kind, number) for number in range(len(made))]
        taken = {*given}
        return [name or unique(other, taken) for name, other in zip(given, made, strict=True)]

    @cached_property
    def _info(self) -> dict[tuple[str, int], str]:
        """MuJoCo's note of the line of each element in the compiled text."""
        groups = {
            "body": self.spec.bodies, "joint": self.spec.joints, "equality": self.spec.equalities,
            "tendon": self.spec.tendons, "actuator": self.spec.actuators, "key": self.spec.keys,
            "geom": self.spec.geoms,
        }  # fmt: skip
        return {(kind, item.id): str(item.info) for kind, items in groups.items() for item in items}


def pose(position: Array, quaternion: Array) -> Array:
    """Return the placement of a position and one of MuJoCo's quaternions (w, x, y, z), shape (4, 4)."""
    w, x, y, z = (float(number) for number in quaternion)
    return placement_from(rotation_from_quaternion(x, y, z, w), np.array(position, dtype=float))


def compile_text(document: Document, meshes: dict[str, bytes]) -> Compiled:
    """Compile an MJCF text and the models that it attaches.

    The text of each file begins in a line that none before it has, so that a line names one element.

    Raises:
        ModelError: MuJoCo is not installed, or refuses the text; or the model has no body, a number that is
            not finite, or a force that hybridyn does not have.
    """
    file = document.root.file
    mujoco = _module(file)
    texts: dict[str, bytes] = {}
    places: list[Place] = []
    for one in document.every():
        text, lines = one.text()
        texts[one.key] = b"\n" * len(places) + text.encode()
        places += lines
    main = texts.pop("").decode()
    try:
        with contextlib.ExitStack() as silent:
            _silence(mujoco, silent)
            spec = mujoco.MjSpec.from_string(main, include=texts, assets=meshes)
            spec.compiler.fusestatic = False
            spec.compiler.LRopt.mode = mujoco.mjtLRMode.mjLRMODE_NONE  # it would simulate muscles
            model = spec.compile()
    except (ValueError, TypeError, mujoco.FatalError) as error:
        raise _refusal(str(error), file, places) from None
    compiled = Compiled(mujoco, spec, model, file, places)
    _refuse_numbers(compiled)
    if getattr(model, "nflex", 0):
        raise document.root.error(f"MuJoCo makes {model.nflex} deformable bodies of it; {RIGID}")
    if model.nbody == 1:
        raise document.root.error("no <body> stands in <worldbody>; a robot has at least one")
    _refuse_forces(compiled)
    return compiled


def _silence(mujoco: Any, until: contextlib.ExitStack) -> None:
    """Suppress MuJoCo's warnings for a while, which it also writes to a file in the working directory."""
    until.enter_context(warnings.catch_warnings(action="ignore"))
    if settings := getattr(mujoco, "MjLogConfig", None):
        until.callback(settings.get().set)
        quiet = settings.get()
        quiet.logto_console = quiet.logto_file = False
        quiet.set()


def _module(file: str) -> Any:
    """Import MuJoCo."""
    try:
        mujoco = importlib.import_module("mujoco")
    except ImportError:
        raise ModelError(
            f"this is MJCF, for which hybridyn needs the package mujoco; {install_advice('mjcf')}", file=file
        ) from None
    if mujoco.mj_version() < OLDEST:
        raise ModelError(
            f"MuJoCo {mujoco.__version__} is too old for MJCF; {install_advice('mjcf')}", file=file
        )
    return mujoco


def _refusal(text: str, file: str, places: list[Place]) -> ModelError:
    """Return MuJoCo's refusal in one line, with the line of the author's file."""
    first = text.strip().split("\n", 1)[0].removeprefix("XML ").removeprefix("Error: ")
    file, line = _place_in(text, places) or (file, None)
    name = _NAME.search(text)
    label, element = (f"element '{name[1]}': ", name[1]) if name else ("", None)
    if "unrecognized element" in first and "'composite'" in text:
        first += " <composite>, which MuJoCo 4 does not have any more; take MuJoCo 3, or write the bodies"
    if "mass and inertia of moving bodies" in first:
        first += "; give the body a geom with mass, or <inertial> with mass and diaginertia"
    return ModelError(f"{label}MuJoCo: {first}", file=file, line=line, element=element)


def _place_in(text: str, places: list[Place]) -> Place | None:
    """Return the place of the line that one of MuJoCo's messages names."""
    lines = [int(number) for number in _LINE.findall(text)]
    return places[lines[-1] - 1] if lines and 0 < lines[-1] <= len(places) else None


def _refuse_numbers(compiled: Compiled) -> None:
    """Refuse a model with numbers that are not finite, or so large that their square is not.

    Raises:
        ModelError: There is such a number, or damping, armature or friction is negative.
    """
    for field, (least, sentence) in NUMBERS.items():
        rows = compiled.rows(field)
        _refuse(compiled, field, ~((rows >= least) & (rows <= LARGEST_NUMBER)), sentence)


def _refuse_forces(compiled: Compiled) -> None:
    """Refuse forces that are not read.

    Raises:
        ModelError: A body, joint or tendon has such a force, or a program moves a body that equalities hold.
    """
    model = compiled.model
    for field, sentence in REFUSED.items():
        _refuse(compiled, field, compiled.rows(field) != 0, sentence)
    several = np.isin(model.jnt_type, [compiled.code("mjJNT_BALL"), compiled.code("mjJNT_FREE")])
    for field, sentence in REFUSED_OF_SEVERAL.items():
        if len(rows := compiled.rows(field)):
            _refuse(compiled, field, (rows != 0) & several[:, None], sentence)
    for body in sorted({body for pair in compiled.tied_bodies.values() for body in pair}):
        if model.body_mocapid[body] >= 0:
            raise compiled.error(
                "body", body, "a program moves a mocap body; remove mocap, or give it joints"
            )


def _refuse(compiled: Compiled, field: str, wrong: NDArray[np.bool_], sentence: str) -> None:
    """Refuse the first row of an array that has a wrong entry, with the name of what it is about."""
    for row in np.flatnonzero(wrong.any(axis=1)):
        kind, _, _ = field.partition("_")
        number = int(compiled.model.dof_jntid[row]) if kind == "dof" else int(row)
        raise compiled.error({"jnt": "joint", "dof": "joint"}.get(kind, kind), number, sentence)
