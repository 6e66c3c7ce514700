"""Options shared by commands: their values, the robot and how to load it."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

import click

from ...description.names import did_you_mean
from .files import complete_robot, robot_file

if TYPE_CHECKING:  # completion does without them
    from ...structure.robot import Base, HybridRobot

XACRO_WORD = re.compile(r"([A-Za-z_]\w*):=(.*)", re.DOTALL)
#: A number as a word of a command.
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?,?", re.IGNORECASE)
#: Letters of an option's name and value, beyond which a help explains it in the next line.
MOST_LETTERS = 30

#: A number of points for each joint, or first and last position and number of points of each.
Grid = int | tuple[tuple[float, float, int], ...]


def refuse(*cases: tuple[object, str]) -> None:
    """Check options that do not belong together. `cases`: whether they are given, and what is said then.

    Raises:
        click.UsageError: The first of the cases that is there.
    """
    for there, said in cases:
        if there:
            raise click.UsageError(said)


def split_names(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[str, ...] | None:
    """Split names at commas."""
    if value is None:
        return None
    names = tuple(name.strip() for name in value.split(","))
    if not all(names):
        raise click.BadParameter(f"'{value}' has an empty name", ctx, param)
    return names


def numbers_by_name(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, float]:
    """Parse words NAME=NUMBER, separated by commas or repeated."""
    out = {}
    for word in (part for value in values for part in value.split(",")):
        name, _, number = word.rpartition("=")
        try:
            out[name.strip()] = float(number)
        except ValueError:
            name = ""
        if not name:
            raise click.BadParameter(f"'{word}' is not of the form NAME=NUMBER", ctx, param)
    return out


def _numbers(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, ...] | None:
    """Parse numbers separated by commas."""
    try:
        return None if value is None else tuple(float(number) for number in value.split(","))
    except ValueError:
        raise click.BadParameter(f"'{value}' is not numbers with commas between", ctx, param) from None


def _numbers_after(name: str, words: list[str]) -> list[str]:
    """Return the words that are numbers right after an option."""
    at = words.index(name) + 1 if name in words else len(words)
    return list(itertools.takewhile(NUMBER.fullmatch, words[at:]))


def _xacro_arguments(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """Split each name:=value."""
    matches = {value: XACRO_WORD.fullmatch(value) for value in values}
    for value, match in matches.items():
        if match is None:
            raise click.BadParameter(f"'{value}' is not of the form name:=value", ctx, param)
        if joined := re.search(r",\s*[A-Za-z_]\w*:=", match[2]):
            parts = f"{match[1]}:={match[2][: joined.start()]} {match[2][joined.start() + 1 :].lstrip()}"
            raise click.BadParameter(
                f"'{value}' joins arguments by a comma: write them apart, {parts}", ctx, param
            )
    return {match[1]: match[2] for match in matches.values() if match}


def known_names(what: str, module: str, known: str) -> Callable[..., tuple[str, ...]]:
    """Return a callback that splits names at commas, and checks them before any work is done.

    Args:
        what: What they are the names of.
        module: The module of hybridyn that knows them, imported only when the option is given.
        known: What holds them there, a collection, or a function of the given names that returns one.
    """

    def check(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[str, ...]:
        """Split and check the names."""
        if value is None or ctx.resilient_parsing:  # completion must be quick: nothing large is imported
            return ()
        names = split_names(ctx, param, value) or ()
        found = getattr(import_module(f"hybridyn.{module}"), known)
        every = found(names) if callable(found) else found
        for name in names:
            if name not in every:
                hint = f"{did_you_mean(name, every)}; known: {', '.join(every)}"
                raise click.BadParameter(f"there is no {what} '{name}'{hint}", ctx, param)
        return names

    return check


def parse_grid(ctx: click.Context, param: click.Parameter, value: str | None) -> Grid | None:
    """Parse a number of points, or FROM:TO:COUNT for each joint."""
    if value is None:
        return None
    words = [part.split(":") for part in value.split(",")]
    try:
        ranges = tuple((float(a), float(b), int(n)) for a, b, n in words) if ":" in value else int(value)
    except ValueError:
        raise click.BadParameter(
            f"'{value}' is neither a number of points nor FROM:TO:COUNT,... for each joint", ctx, param
        ) from None
    every = [(0.0, 1.0, ranges)] if isinstance(ranges, int) else ranges
    if not all(n >= 1 and math.isfinite(b - a) and (a < b or n == 1) for a, b, n in every):
        raise click.BadParameter(f"'{value}': a range has FROM < TO and at least one point", ctx, param)
    return ranges


class SharedOption(click.Option):
    """An option that many commands have: a help shows it last."""


class Command(click.Command):
    """A command whose help shows the shared options last."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the words of a call; numbers after an option are written with commas between."""
        words = list(args)
        for option in self.params:
            for name in option.opts if "," in (getattr(option, "metavar", None) or "") else ():
                numbers = _numbers_after(name, words)
                if len(numbers) > 1:
                    joined = ",".join(number.rstrip(",") for number in numbers)
                    raise click.BadParameter(
                        f"write numbers with commas between: {name} {joined}", ctx, option
                    )
        return super().parse_args(ctx, args)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the command's own options, then the shared ones."""
        options = [one for one in self.get_params(ctx) if isinstance(one, click.Option)]
        for title, shared in (("Options", False), ("Options of the robot", True)):
            ours = (one.get_help_record(ctx) for one in options if isinstance(one, SharedOption) == shared)
            if records := [*filter(None, ours)]:
                with formatter.section(title):
                    formatter.write_dl(records, col_max=MOST_LETTERS)


#: `--xacro`; the command receives `xacro_args`: the arguments by name.
XACRO = SharedOption(
    ["--xacro", "xacro_args"],
    metavar="NAME:=VALUE",
    callback=_xacro_arguments,
    multiple=True,
    help="Argument of a xacro file; also without --xacro.",
)
#: `--package-dir`; the command receives `package_dirs`.
PACKAGES = SharedOption(
    ["--package-dir", "package_dirs"],
    type=click.Path(exists=True, file_okay=False),
    metavar="FOLDER",
    multiple=True,
    help="Folder of packages, and of files that robots name.",
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
    motors: tuple[str, ...] | None = None
    gravity: tuple[float, float, float] | None = None
    xacro_args: dict[str, str] = dataclasses.field(default_factory=dict, hash=False)
    package_dirs: tuple[str, ...] = ()
    rank_tolerance: float | None = None
    closure_tolerance: float = 1e-4
    strict: bool = False

    def __call__(self, *, ranks: bool = False) -> HybridRobot:
        """Load the robot. `ranks`: whether what was decided about the ranks of its closures is told."""
        from ...loading import load, ranks_are_said

        before = ranks_are_said.set(ranks)
        words: dict[str, Any] = {**vars(self), "xacro_args": self.xacro_args or None}
        try:
            return load(words.pop("robot"), **words)
        finally:
            ranks_are_said.reset(before)


STRICT = SharedOption(["--strict"], is_flag=True, help="Refuse a robot of which something was read past.")

#: The options with which commands load a robot: the fields of `RobotChoice`.
ROBOT_OPTIONS = (
    SharedOption(
        ["--base"],
        type=click.Choice(["fixed", "moving", "floating"]),
        help="Motion of the root link.  [default: of the file]",
    ),
    SharedOption(
        ["--motors"], metavar="A,B,...", callback=split_names,
        help="Driven joints, instead of those in the files.",
    ),
    SharedOption(
        ["--gravity"], metavar="X,Y,Z", callback=_numbers,
        help="Gravity [m/s^2].  [default: of the file]",
    ),
    XACRO,
    PACKAGES,
    SharedOption(
        ["--rank-tolerance"],
        type=click.FloatRange(0, 1, min_open=True, max_open=True),
        metavar="NUMBER",
        help="Least relative singular value that counts in a rank.",
    ),
    SharedOption(
        ["--closure-tolerance"],
        type=click.FloatRange(0, 1, min_open=True),
        metavar="NUMBER",
        default=RobotChoice.closure_tolerance,
        show_default=True,
        help="Largest residual of closed loops.",
    ),
    STRICT,
)  # fmt: skip


class RobotCommand(Command):
    """A command about a robot: its first argument, and the options with which the robot is loaded.

    It accepts xacro arguments also as bare words `name:=value`, anywhere in its line. Its function receives
    `load`, a `RobotChoice`: a function that loads the robot.
    """

    def __init__(
        self, name: str, *, params: list[click.Parameter], robot: click.Parameter | None = None, **words: Any
    ) -> None:
        """Add the robot and its options.

        Args:
            name: Name of the command.
            params: Its own arguments and options.
            robot: The parameter `robot`, where it is not an argument that names one.
            words: As for `click.Command`.
        """
        robot = robot or click.Argument(["robot"], callback=robot_file, shell_complete=complete_robot)
        super().__init__(name, params=[robot, *params, *ROBOT_OPTIONS], **words)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Put `--xacro` before each bare `name:=value`, then parse as usual."""
        words: list[str] = []
        for word in args:
            if XACRO_WORD.fullmatch(word) and words[-1:] != ["--xacro"]:
                words.append("--xacro")
            words.append(word)
        return super().parse_args(ctx, words)

    def invoke(self, ctx: click.Context) -> Any:
        """Collect the robot's options, and call the function."""
        own = {field.name: ctx.params.pop(field.name) for field in dataclasses.fields(RobotChoice)}
        ctx.params["load"] = RobotChoice(**own)
        return super().invoke(ctx)
