"""Options shared by commands: the robot and how to load it, and effects."""

from __future__ import annotations

import dataclasses
import functools
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from .files import complete_robot, robot_file

if TYPE_CHECKING:
    from ...structure.robot import Base, HybridRobot

XACRO_WORD = re.compile(r"([A-Za-z_]\w*):=(.*)", re.DOTALL)


class RobotCommand(click.Command):
    """A command that also accepts xacro arguments as bare words `name:=value`, anywhere in its line."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put `--xacro` before each bare `name:=value`, then parse as usual."""
        words: list[str] = []
        for word in args:
            if XACRO_WORD.fullmatch(word) and words[-1:] != ["--xacro"]:
                words.append("--xacro")
            words.append(word)
        return super().parse_args(ctx, words)


def split_names(ctx: click.Context, param: click.Parameter, value: str | None) -> list[str] | None:
    """Split names at commas."""
    if value is None:
        return None
    names = [name.strip() for name in value.split(",")]
    if not all(names):
        raise click.BadParameter(f"'{value}' has an empty name", ctx, param)
    return names


def _vector(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> tuple[float, float, float] | None:
    """Parse three numbers separated by commas."""
    if value is None:
        return None
    try:
        x, y, z = (float(number) for number in value.split(","))
    except ValueError:
        raise click.BadParameter(f"'{value}' is not three numbers with commas between", ctx, param) from None
    if not all(math.isfinite(number) for number in (x, y, z)):
        raise click.BadParameter(f"'{value}' is not finite", ctx, param)
    return x, y, z


def _xacro_arguments(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """Split each name:=value."""
    matches = {value: XACRO_WORD.fullmatch(value) for value in values}
    for value, match in matches.items():
        if match is None:
            raise click.BadParameter(f"'{value}' is not of the form name:=value", ctx, param)
    return {match[1]: match[2] for match in matches.values() if match}


def _effect_names(ctx: click.Context, param: click.Parameter, value: str) -> tuple[str, ...]:
    """Split the names of effects at commas, and check them before any work is done."""
    if ctx.resilient_parsing:  # shell completion must be quick, so that nothing large is imported
        return ()
    from ...description.names import did_you_mean
    from ...effects.choice import UNITS, WORDS

    names = tuple(split_names(ctx, param, value) or ())
    for name in names:
        if name not in (*UNITS, *WORDS):
            hint = did_you_mean(name, (*WORDS, *UNITS))
            raise click.BadParameter(
                f"there is no effect '{name}'{hint}; see 'hybridyn effects --help'", ctx, param
            )
    return names


def takes_effects(default: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Add `--effects` to a command, which receives `effects`: the names of effects.

    Args:
        default: Names that apply where the user gives none.
    """
    return click.option(
        "--effects",
        metavar="A,B,...",
        callback=_effect_names,
        default=default,
        show_default=True,
        help="The effects that are computed: 'default' (gravity, inertia, leg_inertia, velocity), 'model' "
        "(those and all that the robot's files state), 'none', or names of effects, also together with "
        "these words.",
    )


#: Adds `--xacro` to a command, which receives `xacro_args`: the arguments by name.
takes_xacro_arguments = click.option(
    "--xacro",
    "xacro_args",
    metavar="NAME:=VALUE",
    callback=_xacro_arguments,
    multiple=True,
    help="Argument of a xacro file; NAME:=VALUE without --xacro does the same.",
)
#: Adds `--package-dir` to a command, which receives `package_dirs`.
takes_packages = click.option(
    "--package-dir",
    "package_dirs",
    type=click.Path(exists=True, file_okay=False),
    multiple=True,
    help="Folder with packages for $(find ...) in xacro files, and with files that MJCF, SDF and USD name.",
)


@dataclasses.dataclass(frozen=True)
class RobotChoice:
    """The robot that the user names, and how to load it; a call loads the robot.

    Attributes:
        robot: The robot's file.
        base: As in `hybridyn.load`, like all that follow.
        motors: Names of the driven joints, or None.
        gravity: Acceleration of gravity, [m/s^2].
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders of packages.
        rank_tolerance: Relative singular value, or None.
        closure_tolerance: Largest residual that counts as closed.
        strict: Whether notes are errors.
    """

    robot: str
    base: Base | None = None
    motors: list[str] | None = None
    gravity: tuple[float, float, float] | None = None
    xacro_args: dict[str, str] = dataclasses.field(default_factory=dict)
    package_dirs: tuple[str, ...] = ()
    rank_tolerance: float | None = None
    closure_tolerance: float = 1e-4
    strict: bool = False

    def __call__(self) -> HybridRobot:
        """Load the robot."""
        import hybridyn

        words: dict[str, Any] = {**vars(self), "xacro_args": self.xacro_args or None}
        return hybridyn.load(words.pop("robot"), **words)


_OPTIONS = (
    click.option(
        "--base",
        type=click.Choice(["fixed", "moving", "floating"]),
        help="Motion of the root link: at rest, prescribed by the table, or free.  [default: as the file "
        "states, else fixed]",
    ),
    click.option(
        "--motors",
        metavar="A,B,...",
        callback=split_names,
        help="Driven joints, instead of those in the files.",
    ),
    click.option(
        "--gravity",
        metavar="X,Y,Z",
        callback=_vector,
        help="Acceleration of gravity in the world [m/s^2].  [default: as the file states, else 0,0,-9.81]",
    ),
    takes_xacro_arguments,
    takes_packages,
    click.option(
        "--rank-tolerance",
        type=click.FloatRange(0, 1, min_open=True, max_open=True),
        help="Relative singular value below which closure rows count as dependent.  [default: determined at "
        "generic postures]",
    ),
    click.option(
        "--closure-tolerance",
        type=click.FloatRange(0, 1, min_open=True),
        default=RobotChoice.closure_tolerance,
        show_default=True,
        help="Largest closure residual that counts as closed, relative to a module's size.",
    ),
    click.option(
        "--strict",
        is_flag=True,
        help="Refuse a robot of which something was read past, or whose files seem to lack loops.",
    ),
)


def takes_robot_of(
    argument: Callable[[Callable[..., Any]], Callable[..., Any]],
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds the options of a robot to a command.

    The command receives `load`, a `RobotChoice`: a function that loads the robot.

    Args:
        argument: The argument that names the robot, called `robot`.
    """

    def add(function: Callable[..., Any]) -> Callable[..., Any]:
        """Add the options to the body of a command."""

        @functools.wraps(function)
        def body(**words: Any) -> Any:
            """Collect the robot's options in a `RobotChoice`, and call the function with it."""
            own = {field.name: words.pop(field.name) for field in dataclasses.fields(RobotChoice)}
            return function(load=RobotChoice(**own), **words)

        for option in reversed((argument, *_OPTIONS)):
            body = option(body)
        return body

    return add


#: Adds the argument ROBOT and its options to a command.
takes_robot = takes_robot_of(click.argument("robot", callback=robot_file, shell_complete=complete_robot))
