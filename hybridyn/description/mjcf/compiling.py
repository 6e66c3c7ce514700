"""Compile an MJCF text with MuJoCo; errors name the author's file and line."""

from __future__ import annotations

import contextlib
import importlib
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ...errors import ModelError, install_advice
from ..names import unique
from .document import Document, Place

#: Corrections of frequent errors, by a part of MuJoCo's message.
CORRECTIONS = {
    "mass and inertia of moving bodies": "give every moving body an <inertial> or a geom with mass"
}

#: MuJoCo's enumerations by the first part of their words.
ENUMERATIONS = {
    "mjOBJ": "mjtObj", "mjJNT": "mjtJoint", "mjEQ": "mjtEq", "mjTRN": "mjtTrn", "mjWRAP": "mjtWrap",
    "mjGAIN": "mjtGain", "mjBIAS": "mjtBias", "mjDYN": "mjtDyn", "mjDSBL": "mjtDisableBit",
}  # fmt: skip

#: Oldest version of MuJoCo whose MjSpec knows the numbers of its elements, as `mj_version` counts.
OLDEST = 333

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
        kinds, sites = (self.code("mjEQ_CONNECT"), self.code("mjEQ_WELD")), self.code("mjOBJ_SITE")
        for number in range(model.neq):
            if model.eq_type[number] in kinds:
                ends = model.eq_obj1id[number], model.eq_obj2id[number]
                of_sites = model.eq_objtype[number] == sites
                first, second = (int(model.site_bodyid[end] if of_sites else end) for end in ends)
                out[number] = first, second
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

    def line(self, kind: str, number: int) -> int | None:
        """Return the line of an element in the robot's own file, or None if it is in an included file.

        Args:
            kind: "body", "joint", "equality", "tendon" or "actuator".
            number: Its number in the compiled model.
        """
        place = self._place(kind, number)
        return place.line if place.file == self.file else None

    def error(self, kind: str, number: int, message: str) -> ModelError:
        """Return (not raise) the error that names an element, its file and its line."""
        name = self.name(kind, number)
        if kind in ("body", "joint"):
            name = (self.bodies if kind == "body" else self.joints)[number]
        place = self._place(kind, number)
        label = f"{kind} '{name}'" if name else f"{kind} {number}"
        return ModelError(f"{label}: {message}", file=place.file, line=place.line, element=name or kind)

    def _place(self, kind: str, number: int) -> Place:
        return _place_in(self._info.get((kind, number), ""), self.places) or Place(self.file, None)

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
        }  # fmt: skip
        return {(kind, item.id): str(item.info) for kind, items in groups.items() for item in items}


def compile_text(document: Document, meshes: dict[str, bytes]) -> Compiled:
    """Compile an MJCF text and the models that it attaches.

    The text of each file begins in a line that none before it has, so that a line names one element.

    Raises:
        ModelError: MuJoCo is not installed, or refuses the text.
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
    refusals = (ValueError, TypeError, mujoco.FatalError)
    try:
        with _silent(mujoco):
            spec = mujoco.MjSpec.from_string(main, include=texts, assets=meshes)
            spec.compiler.fusestatic = False
            spec.compiler.LRopt.mode = mujoco.mjtLRMode.mjLRMODE_NONE  # it would simulate muscles
            model = spec.compile()
    except refusals as error:
        raise _refusal(str(error), file, places) from None
    return Compiled(mujoco, spec, model, file, places)


@contextlib.contextmanager
def _silent(mujoco: Any) -> Iterator[None]:
    """Suppress MuJoCo's warnings, which it also writes to a file in the working directory."""
    settings = getattr(mujoco, "MjLogConfig", None)
    if settings is not None:
        before, quiet = settings.get(), settings.get()
        quiet.logto_console = quiet.logto_file = False
        quiet.set()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        if settings is not None:
            before.set()


def _module(file: str) -> Any:
    """Import MuJoCo."""
    try:
        mujoco = importlib.import_module("mujoco")
    except ImportError:
        advice = install_advice("mjcf")
        raise ModelError(
            f"this is MJCF, for which hybridyn needs the package mujoco; {advice}", file=file
        ) from None
    if mujoco.mj_version() < OLDEST:
        raise ModelError(
            f"MuJoCo {mujoco.__version__} is too old for MJCF; {install_advice('mjcf')}", file=file
        )
    return mujoco


def _refusal(text: str, file: str, places: list[Place]) -> ModelError:
    """Return MuJoCo's refusal in one line, with the line of the author's file."""
    first = text.strip().split("\n", 1)[0].removeprefix("XML ").removeprefix("Error: ")
    place = _place_in(text, places) or Place(file, None)
    name = _NAME.search(text)
    correction = next((f"; {advice}" for words, advice in CORRECTIONS.items() if words in first), "")
    label = f"element '{name[1]}': " if name else ""
    element = name[1] if name else None
    return ModelError(
        f"{label}MuJoCo: {first}{correction}", file=place.file, line=place.line, element=element
    )


def _place_in(text: str, places: list[Place]) -> Place | None:
    """Return the place of the line that one of MuJoCo's messages names."""
    lines = [int(number) for number in _LINE.findall(text)]
    return places[lines[-1] - 1] if lines and 0 < lines[-1] <= len(places) else None
