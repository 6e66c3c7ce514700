"""Read and write `model.toml`, with what URDF cannot state.

A robot's file has at most one (`beside`). It may state all of this:

    motors = ["slide1", "slide2"]
    [home]
    slide1 = 0.1                    # one number, or the joint's Pinocchio coordinates as a list
    [closures]
    closing_tip = "fixed"           # kind of a closure that frames state: fixed, revolute, spherical
    [joints.slide1]
    rotor_inertia = 3e-5            # and gear_ratio, damping, friction
    [effects.spring]                # see `tables`
    stiffness = { slide1 = 40.0 }
    [couplings.differential]        # sum of coefficient x position = offset
    terms = { left = 1.0, right = 1.0, wrist = -2.0 }
    offset = 0.1
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...errors import ModelError
from ...joints.kinds import JointKind
from ..cache_folder import hashed, keep, kept, state_of
from ..closure_forms import FORMS
from ..effect_names import acts_on, is_added, named_by
from ..names import did_you_mean
from ..records import (
    Coupling,
    Curve,
    Description,
    MotorStatement,
    RobotFile,
)
from ..writing import write_text
from .beside import find_model_file, own_model_file
from .toml_file import line_of, parse_toml

#: Largest deviation of a stated unit vector from length one that counts as rounding; beyond, it is an error.
UNIT_SLACK = 1e-4


def read_model_file(text: bytes, file: str) -> dict[str, Any]:
    """Read the text of a model file; a text that was read before is not checked again.

    Returns:
        Its content, as in `tables.ModelFile`; keys without a value are left out.

    Raises:
        ModelError: The text is not TOML, or a key or value is wrong; the message names the line.
    """
    name = hashed(text.decode("latin-1"), sys.version, *map(state_of, (__package__, "pydantic")))
    content: dict[str, Any] | None = kept(name)
    if content is None:
        from .tables import checked  # imports pydantic: 0.1 s

        content = checked(text, file)
        if not content["residuals"] and not any(
            map(is_added, content["effects"])
        ):  # else it depends on other packages
            keep(name, content)
    return content


def _residual_problems(
    stated: Mapping[str, Any], kinds: Mapping[str, str], links: Collection[str]
) -> Iterator[str]:
    """Yield what a closure of a package names that the robot does not have, or does not move."""
    for link in stated["frames"]:
        if link not in links:
            yield f"'{link}' is no link{did_you_mean(link, links)}"
    if len(stated["frames"]) == 1 or not (stated["joints"] or stated["frames"]):
        yield "names no joints and no two links: 'joints', 'frames', or both"
    for joint in stated["joints"]:
        if kinds.get(joint, "fixed") == "fixed":
            yield f"'{joint}' is no movable joint{did_you_mean(joint, kinds)}"
    for joint in stated["zeros"]:
        if joint not in stated["joints"]:
            hint = did_you_mean(joint, stated["joints"])
            yield f"'zeros' names '{joint}', which is none of its joints{hint}"


def apply_model_file(
    robot: RobotFile, model: Mapping[str, Any], text: str, file: str
) -> dict[str, tuple[float, ...]]:
    """Apply a model file to the robot, and return the home posture by joint name.

    Raises:
        ModelError: A joint or closure is unknown, or a home position does not fit its joint.
    """
    if problem := next(_problems(robot, model), None):
        keys, message = problem
        *tables, name = keys[:3]
        message = f"[{'.'.join(tables)}] '{name}': {message}"
        raise ModelError(message, file=file, line=line_of(text, keys), element=keys[-1])
    robot.couplings += _couplings(robot, model, text)
    for number, closure in enumerate(robot.closures):
        if kind := model["closures"].get(closure.name):
            form = FORMS[kind]
            robot.closures[number] = replace(
                closure, kind=kind, translations=form.translations, rotation=form.rotation
            )
    own = dict(model["effects"])
    robot.effects = (*((name, own.pop(name, values)) for name, values in robot.effects), *own.items())
    numbers = model["joints"]
    robot.joints = [
        replace(joint, **numbers[joint.name]) if joint.name in numbers else joint for joint in robot.joints
    ]
    if "motors" in model:
        line = line_of(text, ("motors",))
        robot.motors.append(MotorStatement("model file", "model.toml", tuple(model["motors"]), file, line))
    kinds = {joint.name: joint.kind for joint in robot.joints}
    return {name: _position(kinds[name], value) for name, value in model["home"].items()}


def _couplings(robot: RobotFile, model: Mapping[str, Any], text: str) -> Iterator[Coupling]:
    """Yield the couplings that a model file adds to a robot, then its residuals."""
    for name, coupling in model["couplings"].items():
        line = line_of(text, ("couplings", name))
        bent = coupling.get("curve")
        curve = bent and Curve(tuple(bent["terms"].items()), tuple(bent["coefficients"]), bent["reference"])
        yield Coupling(name, tuple(coupling["terms"].items()), coupling["offset"], line, curve)
    for name, stated in model["residuals"].items():
        from ..residual_closures import residual  # few robots have closures of other packages

        given = stated["closure"], stated["joints"], stated["numbers"], stated["zeros"], stated["frames"]
        line = line_of(text, ("residuals", name))
        yield Coupling(name, (), 0.0, line, residual(*given, robot.joints))


def _problems(robot: RobotFile, model: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield names that the robot does not have, joints that do not move, and numbers that do not fit them."""
    kinds = {joint.name: joint.kind for joint in robot.joints}
    closures = [closure.name for closure in robot.closures]
    for table, what, names in (
        ("home", "joint", kinds), ("joints", "joint", kinds), ("closures", "closure", closures)
    ):  # fmt: skip
        for name in model[table]:
            if name not in names:
                yield (table, name), f"no such {what}{did_you_mean(name, names)}"
            elif names is kinds and kinds[name] == "fixed":
                yield (table, name), "the joint is fixed"
    movable = [name for name, kind in kinds.items() if kind != "fixed"]
    links = [link.name for link in robot.links]
    for effect, table in model["effects"].items():
        what, names = ("link", links) if acts_on(effect) == "link" else ("movable joint", movable)
        for key, name in named_by(effect, table):
            if name not in names:
                hint = did_you_mean(name, names)
                yield ("effects", effect, key, name), f"no such {what} '{name}'{hint}"
    for name, value in model["home"].items():
        try:
            _position(kinds[name], value)
        except ValueError as error:
            yield ("home", name), str(error)
    for name, numbers in model["joints"].items():
        if numbers.get("gear_ratio") == 0:
            yield ("joints", name), "a gear ratio of 0 moves nothing"
    for name, stated in model["residuals"].items():
        yield from ((("residuals", name), problem) for problem in _residual_problems(stated, kinds, links))
    for name, coupling in model["couplings"].items():
        bent = (coupling.get("curve") or {}).get("terms", {})
        for joint, factor in (*coupling["terms"].items(), *bent.items()):
            if kinds.get(joint, "fixed") == "fixed" or not factor:
                hint = "" if joint in kinds else did_you_mean(joint, kinds)
                yield ("couplings", name), f"'{joint}' is no movable joint with a coefficient{hint}"


def _position(kind: JointKind, value: float | list[float]) -> tuple[float, ...]:
    """Check a home position against its joint, and normalise its unit vector.

    Raises:
        ValueError: The number of values is wrong, or the unit vector does not have length one.
    """
    values = value if isinstance(value, list) else [value]
    counts = (1, 2) if kind.endless else (len(kind.zero),)
    if len(values) not in counts:
        wanted = " or ".join(str(count) for count in counts)
        raise ValueError(f"{len(values)} numbers for a {kind} joint, which has {wanted}")
    if len(values) == 1:
        return tuple(values)
    start = kind.shift  # behind it is a unit vector: cosine and sine, or quaternion
    length = math.hypot(*values[start:])
    if abs(length - 1) > UNIT_SLACK:
        raise ValueError(f"its last {len(values) - start} numbers have length {length:g} instead of 1")
    return (*values[:start], *(value / length for value in values[start:]))


#: The table `[home]` of a file, without the comments that stand before the next table.
_HOME = r"(?m)^[ \t]*\[[ \t]*home[ \t]*\].*\n?(?:(?!(?:[ \t]*(?:#.*)?\n)*[ \t]*\[)(?:.+\n?|\n))*"


def model_file(
    description: Description,
    *,
    motors: bool = False,
    home: bool = False,
    couplings: Iterable[Coupling] = (),
    joints: Mapping[str, Mapping[str, float]] | None = None,
    effects: Iterable[str] = (),
) -> str:
    """Return the text of a model file, "" if there is nothing to say.

    Args:
        motors: Whether to write the list of motors.
        home: Whether to write the home posture.
        couplings: Couplings to write.
        joints: By joint, the numbers to write: rotor_inertia, gear_ratio, damping, friction.
        effects: Names of the effects to write, those of `description.effects`.
    """
    parts = [f"motors = {_value(description.motors)}\n"] if motors else []
    parts += [home_table(description.home)] if home and description.home else []
    parts += [_table(f"joints.{key_of(name)}", numbers) for name, numbers in (joints or {}).items()]
    parts += [_table(*_coupling(one)) for one in couplings]
    wanted = set(effects)
    parts += [_table(f"effects.{name}", numbers) for name, numbers in description.effects if name in wanted]
    return "\n".join(parts)


def _coupling(coupling: Coupling) -> tuple[str, dict[str, Any]]:
    """Return name and content of the table of a coupling; joints of its curve alone stand there."""
    curve = coupling.curve
    if curve is not None and not isinstance(curve, Curve):
        joints = [joint for joint, _ in curve.terms[: curve.stated]]
        zeros = dict(zip(joints, curve.zeros, strict=False))  # others are in the placements of joints
        about = {
            "closure": curve.closure, "joints": joints, "frames": [*curve.frames],
            "numbers": dict(curve.numbers), "zeros": zeros if any(zeros.values()) else {},
        }  # fmt: skip
        return f"residuals.{key_of(coupling.name)}", {key: value for key, value in about.items() if value}
    terms = {joint: factor for joint, factor in coupling.terms if factor}
    out: dict[str, Any] = {"terms": terms, "offset": coupling.offset}
    if curve is not None:
        out["curve"] = {
            "terms": dict(curve.terms), "coefficients": [*curve.coefficients], "reference": curve.reference
        }  # fmt: skip
    return f"couplings.{key_of(coupling.name)}", out


def home_table(home: Mapping[str, tuple[float, ...]]) -> str:
    """Return a home posture as the table `[home]`.

    Args:
        home: Position of each joint: one number, or Pinocchio's coordinates.
    """
    return _table("home", _plain(home))


def write_home(robot_file: str, home: Mapping[str, tuple[float, ...]]) -> Path:
    """Write a home posture into the model file of a robot; keep all other content of the file.

    Returns:
        The model file; one beside the robot's file, if there was none.

    Raises:
        ModelError: The file states home in a way that cannot be replaced.
        OSError: The file cannot be written.
    """
    path = find_model_file(robot_file) or own_model_file(robot_file)
    before = path.read_bytes().decode("utf-8") if path.exists() else ""
    after = _with_table(before, home_table(home))
    old = parse_toml(before.encode(), str(path))[1]
    try:
        new = parse_toml(after.encode(), str(path))[1]
    except ModelError:
        new = {}
    if new != {**old, "home": _plain(home)}:
        raise ModelError(
            "states home in a way that cannot be replaced; remove it there, or write [home] by hand",
            file=str(path), element="home",
        )  # fmt: skip
    write_text(path, after)
    return path


def key_of(name: str, *, bare: bool = True) -> str:
    """Return a name as a key or a string of TOML.

    Args:
        bare: Whether it may stand without quotes, as a key may.
    """
    if bare and re.fullmatch(r"[A-Za-z0-9_-]+", name):
        return name
    quoted = name.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in quoted) + '"'


def _with_table(text: str, table: str) -> str:
    """Replace the table `[home]` of a text, or append it; comments before the next table stay."""
    if not re.search(_HOME, text):
        return text + ("" if not text else "\n" if text.endswith("\n") else "\n\n") + table
    return re.sub(_HOME, lambda _: f"{table}\n", text, count=1).rstrip("\n") + "\n"


def _plain(home: Mapping[str, tuple[float, ...]]) -> dict[str, Any]:
    """Return a home posture as TOML states it: one number, or a list."""
    return {name: x[0] if len(x) == 1 else list(x) for name, x in home.items()}


def _table(name: str, values: Mapping[str, Any]) -> str:
    return "\n".join(
        [f"[{name}]", *(f"{key_of(key)} = {_value(value)}" for key, value in values.items()), ""]
    )


def _value(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, str):
        return key_of(value, bare=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key_of(key)} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return str(value)
    return repr(float(value))
