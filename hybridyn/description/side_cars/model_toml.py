"""Read `model.toml`, with data that URDF cannot state: home posture, motors, rotors, friction, effects.

For `X.urdf`, `X.urdf.xacro` or `X.xml`, the file is `X.model.toml` beside it, else `../models/X/model.toml`
(`../../models/group/X/model.toml` for `urdf/group/X.urdf`).

    motors = ["slide1", "slide2"]
    [home]
    slide1 = 0.1                    # one number, or the joint's Pinocchio coordinates as a list
    [closures]
    closing_tip = "fixed"           # kind of a closure that frames state: fixed, revolute, spherical
    [joints.slide1]
    rotor_inertia = 3e-5            # and gear_ratio, damping, friction
    [effects.spring]                # see `effect_tables`
    stiffness = { slide1 = 40.0 }
    [couplings.differential]        # sum of coefficient x position = offset
    terms = { left = 1.0, right = 1.0, wrist = -2.0 }
    offset = 0.1
"""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import ModelError
from ..cache_folder import hashed
from ..closure_forms import FORMS
from ..kept_texts import keep, kept, state_of
from ..names import did_you_mean
from ..records import Closure, Coupling, Joint
from ..robot_file import MotorStatement, RobotFile
from .toml_file import line_of

#: Allowed lengths of a home position, by kind of joint.
COORDINATES = {
    "revolute": (1,),
    "prismatic": (1,),
    "continuous": (1, 2),
    "spherical": (4,),
    "planar": (4,),
    "floating": (7,),
}

#: Index at which the unit vector (cosine and sine, or quaternion) of a position starts; it ends with it.
UNIT_PART = {("continuous", 2): 0, ("spherical", 4): 0, ("planar", 4): 2, ("floating", 7): 3}

#: Largest deviation of a stated unit vector from length one that counts as rounding; beyond, it is an error.
UNIT_SLACK = 1e-4


def read_model_file(text: bytes, file: str) -> dict[str, Any]:
    """Read the text of a model file; a text that was read before is not checked again.

    Returns:
        Its content, as in `model_tables.ModelFile`; keys without a value are left out.

    Raises:
        ModelError: The text is not TOML, or a key or value is wrong; the message names the line.
    """
    found = importlib.util.find_spec("pydantic")
    codes = [Path(__file__).parent, Path(found.origin).parent if found and found.origin else ""]
    name = hashed(text.decode("latin-1"), sys.version, *map(state_of, codes))
    content: dict[str, Any] | None = kept(name)
    if content is None:
        from .model_tables import checked  # imports pydantic: 0.1 s

        content = checked(text, file)
        keep(name, content)
    return content


def apply_model_file(
    robot: RobotFile, model: Mapping[str, Any], text: str, file: str
) -> dict[str, tuple[float, ...]]:
    """Apply a model file to the robot, and return the home posture by joint name.

    Raises:
        ModelError: A joint or closure is unknown, or a home position does not fit its joint.
    """
    by_name = {joint.name: joint for joint in robot.joints}

    def wrong(table: str, name: str, message: str) -> ModelError:
        """Return the error of a key, with its line."""
        line = line_of(text, (table, name))
        return ModelError(f"[{table}] '{name}': {message}", file=file, line=line, element=name)

    for table, names in (("home", model["home"]), ("joints", model["joints"])):
        for name in names:
            if name not in by_name:
                raise wrong(table, name, f"no such joint{did_you_mean(name, by_name)}")
            if by_name[name].kind == "fixed":
                raise wrong(table, name, "the joint is fixed")
    home: dict[str, tuple[float, ...]] = {}
    for name, value in model["home"].items():
        try:
            home[name] = home_position(by_name[name], value if isinstance(value, list) else [value])
        except ValueError as error:
            raise wrong("home", name, str(error)) from None
    for name, numbers in model["joints"].items():
        if numbers.get("gear_ratio") == 0:
            raise wrong("joints", name, "a gear ratio of 0 moves nothing")
    for name, coupling in model["couplings"].items():
        for joint, factor in coupling["terms"].items():
            if joint not in by_name or by_name[joint].kind == "fixed" or not factor:
                hint = did_you_mean(joint, by_name) if joint not in by_name else ""
                raise wrong("couplings", name, f"'{joint}' is no movable joint with a coefficient{hint}")
        line = line_of(text, ("couplings", name))
        robot.couplings.append(Coupling(name, tuple(coupling["terms"].items()), coupling["offset"], line))
    stated = [closure.name for closure in robot.closures]
    for name in model["closures"]:
        if name not in stated:
            raise wrong("closures", name, f"no such closure{did_you_mean(name, stated)}")
    robot.closures = [_with_kind(closure, model["closures"].get(closure.name)) for closure in robot.closures]
    _apply_effects(robot, model, text, file)
    robot.joints = [replace(joint, **model["joints"].get(joint.name, {})) for joint in robot.joints]
    if "motors" in model:
        line = line_of(text, ("motors",))
        robot.motors.append(MotorStatement("model file", "model.toml", tuple(model["motors"]), file, line))
    return home


def _apply_effects(robot: RobotFile, model: Mapping[str, Any], text: str, file: str) -> None:
    """Set the robot's effects from the model file."""
    movable = [joint.name for joint in robot.joints if joint.kind != "fixed"]
    links = [link.name for link in robot.links]
    own = dict(model["effects"])
    wanted = [
        (effect, key, joint, movable, "movable joint")
        for effect, table in own.items()
        for key, numbers in table.items()
        if isinstance(numbers, dict) and effect != "ground_contact"
        for joint in numbers
    ]
    points = own.get("ground_contact", {}).get("points", ())
    wanted += [("ground_contact", "points", link, links, "link") for link in points]
    for effect, key, name, known, what in wanted:
        if name not in known:
            raise ModelError(
                f"[effects.{effect}] '{key}': no such {what} '{name}'{did_you_mean(name, known)}",
                file=file, line=line_of(text, ("effects", effect, key, name)), element=name,
            )  # fmt: skip
    robot.effects = (*((name, own.pop(name, values)) for name, values in robot.effects), *own.items())


def home_position(joint: Joint, values: list[float]) -> tuple[float, ...]:
    """Check a home position against its joint, and normalise its unit vector.

    Raises:
        ValueError: The number of values is wrong, or the unit vector does not have length one.
    """
    counts = COORDINATES[joint.kind]
    if len(values) not in counts:
        wanted = " or ".join(str(count) for count in counts)
        raise ValueError(f"{len(values)} numbers for a {joint.kind} joint, which has {wanted}")
    start = UNIT_PART.get((joint.kind, len(values)))
    if start is None:
        return tuple(values)
    length = math.hypot(*values[start:])
    if abs(length - 1) > UNIT_SLACK:
        raise ValueError(f"its last {len(values) - start} numbers have length {length:g} instead of 1")
    return (*values[:start], *(value / length for value in values[start:]))


def _with_kind(closure: Closure, kind: str | None) -> Closure:
    """Return a closure with the kind that model.toml states for its frames."""
    if kind is None:
        return closure
    return replace(closure, kind=kind, translations=FORMS[kind].translations, rotation=FORMS[kind].rotation)
