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

import math
from dataclasses import replace
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, ValidationError

from ...errors import ModelError
from ..closure_forms import FORMS
from ..names import did_you_mean
from ..records import Closure, Coupling, Joint
from ..robot_file import MotorStatement, RobotFile
from .effect_tables import EffectTables, known_keys
from .schema import Schema, first_problem
from .toml_file import line_of, parse_toml

NotNegative = Annotated[FiniteFloat, Field(ge=0)]

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


class JointNumbers(Schema):
    """The numbers that model.toml may state for one joint; see `records.Joint`."""

    rotor_inertia: NotNegative | None = None
    gear_ratio: FiniteFloat | None = None
    damping: NotNegative | None = None
    friction: NotNegative | None = None


class CouplingTable(Schema):
    """A linear relation between joint positions; see `records.Coupling`."""

    terms: Annotated[dict[str, FiniteFloat], Field(min_length=1)]
    offset: FiniteFloat = 0.0


class ModelFile(Schema):
    """The tables of model.toml; a new table is a new field."""

    motors: list[str] | None = None
    home: dict[str, FiniteFloat | list[FiniteFloat]] = Field(default_factory=dict)
    joints: dict[str, JointNumbers] = Field(default_factory=dict)
    couplings: dict[str, CouplingTable] = Field(default_factory=dict)
    closures: dict[str, Literal["fixed", "revolute", "spherical"]] = Field(default_factory=dict)
    effects: EffectTables = Field(default_factory=EffectTables)


def read_model_file(text: bytes, file: str) -> ModelFile:
    """Read the text of a model file.

    Raises:
        ModelError: The text is not TOML, or a key or value is wrong; the message names the line.
    """
    plain, content = parse_toml(text, file)
    try:
        return ModelFile.model_validate(content)
    except ValidationError as error:
        known = [*ModelFile.model_fields]
        if error.errors()[0]["loc"][:1] == ("joints",):
            known = [*JointNumbers.model_fields]
        if error.errors()[0]["loc"][:1] == ("couplings",):
            known = [*CouplingTable.model_fields]
        if error.errors()[0]["loc"][:1] == ("effects",):
            known = known_keys(error.errors()[0]["loc"])
        place, message = first_problem(error, known)
        keys = tuple(str(part) for part in place)
        key = ".".join(keys)
        raise ModelError(f"'{key}': {message}", file=file, line=line_of(plain, keys), element=key) from None


def apply_model_file(
    robot: RobotFile, model: ModelFile, text: str, file: str
) -> dict[str, tuple[float, ...]]:
    """Apply a model file to the robot, and return the home posture by joint name.

    Raises:
        ModelError: A joint or closure is unknown, or a home position does not fit its joint.
    """
    by_name = {joint.name: joint for joint in robot.joints}

    def wrong(table: str, name: str, message: str) -> ModelError:
        line = line_of(text, (table, name))
        return ModelError(f"[{table}] '{name}': {message}", file=file, line=line, element=name)

    for table, names in (("home", model.home), ("joints", model.joints)):
        for name in names:
            if name not in by_name:
                raise wrong(table, name, f"no such joint{did_you_mean(name, by_name)}")
            if by_name[name].kind == "fixed":
                raise wrong(table, name, "the joint is fixed")
    home: dict[str, tuple[float, ...]] = {}
    for name, value in model.home.items():
        try:
            home[name] = home_position(by_name[name], value if isinstance(value, list) else [value])
        except ValueError as error:
            raise wrong("home", name, str(error)) from None
    for name, numbers in model.joints.items():
        if numbers.gear_ratio == 0:
            raise wrong("joints", name, "a gear ratio of 0 moves nothing")
    for name, coupling in model.couplings.items():
        for joint, factor in coupling.terms.items():
            if joint not in by_name or by_name[joint].kind == "fixed" or not factor:
                hint = did_you_mean(joint, by_name) if joint not in by_name else ""
                raise wrong("couplings", name, f"'{joint}' is no movable joint with a coefficient{hint}")
        line = line_of(text, ("couplings", name))
        robot.couplings.append(Coupling(name, tuple(coupling.terms.items()), coupling.offset, line))
    stated = [closure.name for closure in robot.closures]
    for name in model.closures:
        if name not in stated:
            raise wrong("closures", name, f"no such closure{did_you_mean(name, stated)}")
    robot.closures = [_with_kind(closure, model.closures.get(closure.name)) for closure in robot.closures]
    _apply_effects(robot, model, text, file)
    robot.joints = [_with_numbers(joint, model.joints.get(joint.name)) for joint in robot.joints]
    if model.motors is not None:
        line = line_of(text, ("motors",))
        robot.motors.append(MotorStatement("model file", "model.toml", tuple(model.motors), file, line))
    return home


def _apply_effects(robot: RobotFile, model: ModelFile, text: str, file: str) -> None:
    """Set the robot's effects from the model file.

    Raises:
        ModelError: An effect names an unknown joint or link.
    """
    movable = [joint.name for joint in robot.joints if joint.kind != "fixed"]
    links = [link.name for link in robot.links]
    ground = model.effects.ground_contact
    wanted = [(*place, movable, "movable joint") for place in model.effects.joints()]
    wanted += [
        ("ground_contact", "points", link, links, "link") for link in (ground.points if ground else ())
    ]
    for effect, key, name, known, what in wanted:
        if name not in known:
            raise ModelError(
                f"[effects.{effect}] '{key}': no such {what} '{name}'{did_you_mean(name, known)}",
                file=file, line=line_of(text, ("effects", effect, key, name)), element=name,
            )  # fmt: skip
    own = dict(model.effects.stated())
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


def _with_numbers(joint: Joint, numbers: JointNumbers | None) -> Joint:
    stated = numbers.model_dump(exclude_none=True) if numbers else {}
    return replace(joint, **stated) if stated else joint


def _with_kind(closure: Closure, kind: str | None) -> Closure:
    """Return a closure with the kind that model.toml states for its frames."""
    if kind is None:
        return closure
    return replace(closure, kind=kind, translations=FORMS[kind].translations, rotation=FORMS[kind].rotation)
