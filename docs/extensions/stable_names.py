"""Write docs/stable-names.txt: every name that users may rely on, one a line, by kind.

Run `python docs/extensions/stable_names.py` after a name was added or changed on purpose; a test compares.
The page docs/stable-names.md says what is promised.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import re
import tempfile
import typing
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import click
from pydantic import BaseModel

import hybridyn
import hybridyn.effects
from hybridyn.cli import COMMANDS, commands, main
from hybridyn.description.side_cars.tables import ModelFile
from hybridyn.learning.robot import LearningRobot
from hybridyn.scenes.scene_file import Scene
from hybridyn.simulation.result import SimulationResult
from hybridyn.studies.check.finding import Finding
from hybridyn.studies.sweep.study_file import Study
from hybridyn.studies.sweep.sweep import Swept
from hybridyn.tables import signals
from hybridyn.warp_batch.batch import Batch

FILE = Path(__file__).parents[1] / "stable-names.txt"
#: A motion of the shipped five-bar by which commands write their tables.
MOTION = "time,m1_left_drive/position,m1_right_drive/position\n" + "".join(
    f"{t},0.0{t},0.0{t}\n" for t in range(8)
)
#: Numbers of its motors.
DC_MOTORS = "[effects.dc_motors]\n" + "".join(
    f"{key} = {{ m1_left_drive = 1.0, m1_right_drive = 1.0 }}\n" for key in ("torque_constant", "resistance")
)
#: Objects that functions return, whose classes have no public name.
RETURNED = {
    "hybridyn.check()[]": Finding,
    "hybridyn.jax()": LearningRobot,
    "hybridyn.simulate()": SimulationResult,
    "hybridyn.sweep()": Swept,
    "hybridyn.torch()": LearningRobot,
    "hybridyn.warp()": Batch,
}
#: A scene of it.
SCENE = "duration = 0.01\n[robot]\nfile = 'five_bar'\n[output]\nrate = 100.0\n"


def stable_names() -> str:
    """Return the text of the list."""
    effects = [key for key in _keys(ModelFile) if key.startswith("effects.")]
    parts = {
        "Python": _of_python(),
        "Commands and options": _of_commands(),
        "Columns that are read": _read_columns(),
        "Columns that are written": _written_columns(),
        "Keys of model.toml": _keys(ModelFile),
        "Keys of scenes, beside effects of model.toml": _unlike(_keys(Scene), effects),
        "Keys of studies": _keys(Study),
    }
    return "\n".join(
        line for title, lines in parts.items() for line in (title, *(f"  {one}" for one in lines), "")
    )


def _of_python() -> Iterator[str]:
    """Yield the functions, classes and constants, with arguments and members; of effects what makes them."""
    for name in sorted(hybridyn.__all__):
        value = getattr(hybridyn, name)
        yield f"hybridyn.{name}" + (
            _arguments(value) if inspect.isfunction(value) or value is hybridyn.Event else ""
        )
        yield from _members(f"hybridyn.{name}", value) if inspect.isclass(value) else ()
    for place, of in RETURNED.items():
        yield from _members(place, of)
    for name in sorted(hybridyn.effects.__all__):
        value = getattr(hybridyn.effects, name)
        yield f"hybridyn.effects.{name}" + (_arguments(value) if callable(value) else "")


def _members(place: str, of: type) -> Iterator[str]:
    """Yield what objects of a class have: the attributes that its docstring lists, properties, methods."""
    bases = [base for base in of.__mro__ if base.__module__.startswith("hybridyn")]
    listed = {name for base in bases for name in _attributes(base)}
    parts = {name for base in bases for name, value in vars(base).items() if _is_public(name, value)}
    for name in sorted(listed | parts):
        value = inspect.getattr_static(of, name, None)
        value = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        yield f"{place}.{name}" + (_arguments(value) if inspect.isfunction(value) else "")


def _is_public(name: str, value: object) -> bool:
    """Return whether a member is a documented one."""
    return (
        not name.startswith("_")
        and bool(getattr(value, "__doc__", ""))
        and not isinstance(value, str | tuple)
    )


def _attributes(of: type) -> list[str]:
    """Return the names in the part "Attributes" of a docstring."""
    _, _, part = inspect.cleandoc(of.__doc__ or "").partition("Attributes:\n")
    names = re.findall(r"^    ([\w, ]+):", part.split("\n\n")[0], re.MULTILINE)
    return [name.strip() for line in names for name in line.split(",")]


def _arguments(call: Callable[..., Any]) -> str:
    """Return the names of arguments; those that may be left out are marked by `=`."""
    words: list[str] = []
    for one in inspect.signature(call).parameters.values():
        if one.kind is one.KEYWORD_ONLY and not any(word.startswith("*") for word in words):
            words.append("*")
        mark = {one.VAR_POSITIONAL: "*", one.VAR_KEYWORD: "**"}.get(one.kind, "")
        if one.name != "self":
            words.append(f"{mark}{one.name}" + ("=" if one.default is not one.empty else ""))
    return f"({', '.join(words)})"


def _of_commands() -> Iterator[str]:
    """Yield commands with their arguments and options, and the words that options take."""
    context = click.Context(commands)
    yield from (f"hybridyn {one}" for one in _options(commands))
    for name in COMMANDS:
        command = commands.get_command(context, name)
        assert command is not None
        arguments = [one.make_metavar(context) for one in command.params if isinstance(one, click.Argument)]
        yield " ".join(["hybridyn", name, *arguments])
        yield from (f"hybridyn {name} {one}" for one in _options(command))


def _options(command: click.Command) -> list[str]:
    """Return the options of a command, sorted."""
    options = [one for one in command.params if isinstance(one, click.Option) and not one.hidden]
    words = [", ".join(sorted((*one.opts, *one.secondary_opts), key=len)) for one in options]
    taken = ["|".join(one.type.choices) if isinstance(one.type, click.Choice) else "" for one in options]
    return sorted(f"{word} {choices}".rstrip() for word, choices in zip(words, taken, strict=True))


def _read_columns() -> list[str]:
    """Return the columns of tables that commands read; `<link>` stands for `<link>@<other>`, too."""
    pose = (*signals.POSE, *signals.VECTOR, *signals.ANGLES, *signals.FURTHER)
    rates = (*signals.TWIST, *signals.ANGLES, *signals.FURTHER[:-3])
    quantities = ("position", *signals.RATES)
    return [
        "time",
        *(f"<joint>/{quantity}" for quantity in quantities),
        *(f"<link>/pose/{part}" for part in pose),
        *(f"<link>/{quantity}/{part}" for quantity in signals.RATES for part in rates),
        *(f"<link>/wrench/{part}" for part in signals.WRENCH),
        "<motor>/effort",
        "<motor>/current",
    ]


def _written_columns() -> list[str]:
    """Return the columns of the tables that commands write, from tables that they write of a five-bar."""
    said = io.StringIO()
    with (
        tempfile.TemporaryDirectory() as place,
        contextlib.redirect_stderr(said), contextlib.redirect_stdout(said),
    ):  # fmt: skip
        folder = Path(place)
        (folder / "motion.csv").write_text(MOTION)
        (folder / "scene.toml").write_text(SCENE)
        files = {name: str(folder / f"{name}.csv") for name in ("efforts", "inner", "loads", "run", "room")}
        robot = hybridyn.load("five_bar")
        hybridyn.convert(robot, folder / "five_bar.urdf")
        (folder / "five_bar.model.toml").write_text(DC_MOTORS)
        motion = [str(folder / "five_bar.urdf"), str(folder / "motion.csv"), "--effects", "model"]
        calls = [
            ["idm", *motion, "-o", files["efforts"], "--reactions", files["inner"]],
            ["idm", *motion, "--loads", "-o", files["loads"]],
            ["simulate", str(folder / "scene.toml"), "-o", files["run"]],
            ["workspace", "five_bar", "--step", "x=1,z=1", "-o", files["room"]],
        ]
        for words in calls:
            assert main(words) == 0, words
        headers = [Path(file).read_text().split("\n", 1)[0].split(",") for file in files.values()]
    return sorted({_without_names(column, robot) for header in headers for column in header})


def _without_names(column: str, robot: hybridyn.HybridRobot) -> str:
    """Return a column with `<motor>`, `<joint>`, `<closure>`, `<link>` in the place of names."""
    description = robot.description
    motors = robot.motors if column.endswith(("/effort", "/current", "/voltage")) else ()
    links, closures = ([one.name for one in of] for of in (description.links, description.closures))
    kinds = {"motor": motors, "joint": robot.joints, "link": links, "closure": closures}
    for what, names in kinds.items():
        for name in sorted(names, key=len, reverse=True):
            column = re.sub(rf"(?<![\w<]){re.escape(name)}(?![\w>])", f"<{what}>", column)
    return column


def _unlike(lines: Iterable[str], others: Iterable[str]) -> list[str]:
    """Return lines, each once, without those of a list that has them, too."""
    return [*dict.fromkeys(line for line in lines if line not in {*others})]


def _keys(schema: type[BaseModel], before: str = "") -> Iterator[str]:
    """Yield the keys of a file, tables in tables; `*` stands for a name of the user's own."""
    for name, field in schema.model_fields.items():
        place = f"{before}{name}"
        yield place
        for key, table in _tables(field.annotation):
            yield from _keys(table, f"{place}{key}.")


def _tables(of: Any) -> Iterator[tuple[str, type[BaseModel]]]:
    """Yield the tables in a type, and what stands between key and table."""
    if inspect.isclass(of) and issubclass(of, BaseModel):
        yield "", of
    key = ".*" if typing.get_origin(of) is dict else ""
    for part in typing.get_args(of):
        yield from ((key + more, table) for more, table in _tables(part))


if __name__ == "__main__":
    FILE.write_text(stable_names())
