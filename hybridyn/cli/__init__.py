"""The command line: errors of the library become one line.

`words` has what a user types and reads; the module of a command's name has what the command does, and is
imported when it runs, with what it needs. So help and completion are quick. Results go to standard output,
messages to standard error. Exit status: 0 done, 1 the user's data are wrong, 2 wrong usage, 130 interrupted.
"""

import contextlib
import gc
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from types import FrameType

import click

from .. import __version__
from ..description.names import did_you_mean
from ..errors import HybridynError, shortened
from ..threads import start_none

#: Commands in the order of `--help`.
COMMANDS = (
    "idm", "ddm", "simulate", "cost", "convert", "plot", "view", "info",
    "home", "compare", "workspace", "sweep", "identify", "ros",
)  # fmt: skip

#: What stands in the place of commands that were.
INSTEAD = {
    "robots": "hybridyn --robots",
    "completion": "hybridyn --completion SHELL",
    "size": "hybridyn idm ROBOT TRAJECTORY --loads",
    "effects": "hybridyn idm ROBOT TRAJECTORY --by-effect",
    "map": "hybridyn idm ROBOT TRAJECTORY --map A,B, or hybridyn workspace ROBOT --map A,B --grid N",
    "check": "hybridyn info ROBOT --fail-on error",
    "export": "hybridyn convert ROBOT --c -o FOLDER",
}

#: Options that replace the library's arguments in its advice.
OPTIONS = {
    "motors=[...]": "--motors A,B,...",
    'passive="solved"': "--passive solved",
    'on_singular="least-norm"': "--on-singular least-norm",
    "allow_python=True": "--allow-python",
    "resume=True": "--resume",
    "holds it with package_dirs": "holds it with --package-dir",
    "another origin (at)": "another origin (--at)",
    "limits=False": "--no-limits",
}

#: New objects after which Python searches for cycles; with its own 700, this takes a tenth of a start.
NEW_OBJECTS = 100_000

INTERRUPTED, TERMINATED, READER_GONE = 130, 143, 141  # the status of SIGINT, SIGTERM, SIGPIPE in shells


class Commands(click.Group):
    """The group of commands; each is imported when it is used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command, or None if there is none of this name."""
        from . import words  # `--version` does without

        return getattr(words, cmd_name) if cmd_name in COMMANDS else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find a command by name; the error suggests the nearest one."""
        if args and not args[0].startswith("-") and args[0] not in COMMANDS:
            hint = did_you_mean(args[0], COMMANDS)
            hint = f" (it is '{INSTEAD[args[0]]}' now)" if args[0] in INSTEAD else hint
            ctx.fail(f"there is no command '{args[0]}'{hint}; the commands are {', '.join(COMMANDS)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> object:
        """Run a command; end it quietly when the reader of its output has ended (`| head`)."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # flushing would fail again
            return ctx.exit(READER_GONE)


@click.group(
    cls=Commands,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="'hybridyn COMMAND --help' explains a command.",
)
@click.version_option(__version__, message="%(prog)s %(version)s")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
@click.option(
    "--robots",
    is_flag=False,
    flag_value="text",
    type=click.Choice(["text", "json"]),
    help="List the robots that come with hybridyn, whose names all commands take for files.",
)
@click.option(
    "--completion",
    type=click.Choice(["bash", "zsh", "fish"]),
    help="Print the script with which a shell completes commands, options and robots.",
)
@click.pass_context
def commands(ctx: click.Context, debug: bool, robots: str | None, completion: str | None) -> None:
    """Dynamics of hybrid robots: parallel modules stacked in series, in URDF, MJCF, SDF or USD."""
    if robots:
        from .lists import show_robots

        show_robots(robots)
    elif completion:
        from .lists import show_completion

        show_completion(commands, completion)
    elif ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


def main(arguments: list[str] | None = None) -> int:
    """Run the command line. `arguments`: the words after `hybridyn`; None takes the program's own."""
    start_none()
    typed = sys.argv[1:] if arguments is None else list(arguments)
    debug = "--debug" in typed
    typed = [word for word in typed if word != "--debug"]  # accepted before and after the command
    try:
        with _program_manners():
            status = commands.main(typed, prog_name="hybridyn", standalone_mode=False)
            if arguments is None:
                gc.freeze()  # the program ends: searching for cycles before takes 15 ms
        return status if isinstance(status, int) else 0
    except (click.Abort, KeyboardInterrupt):
        return _fail("interrupted", INTERRUPTED)
    except Exception as error:
        if debug:
            raise
        return _fail(*explained(error))


def explained(error: Exception) -> tuple[str, int]:
    """Return the message and the exit status of an error."""
    if isinstance(error, click.ClickException):
        path = error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else "hybridyn"
        return f"{error.format_message()} (see '{path} --help')", error.exit_code
    if isinstance(error, HybridynError):
        message = str(error)
        for word, option in OPTIONS.items():
            message = message.replace(word, option)
        return message, 1
    if isinstance(error, OSError):
        return f"{error.filename}: {error.strerror}" if error.filename else str(error), 1
    if isinstance(error, MemoryError):
        return "out of memory", 1
    return f"unexpected {type(error).__name__}: {error}; this is a bug: report it with what --debug shows", 1


def _fail(message: str, status: int) -> int:
    """Print a message as one line and return the exit status."""
    line = " ".join(message.split())
    line = "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in shortened(line))
    with contextlib.suppress(BrokenPipeError):
        click.echo(f"error: {line}", err=True)
    return status


@contextlib.contextmanager
def _program_manners() -> Iterator[None]:
    """Print warnings as one line, clean up on SIGTERM as on an error, and collect garbage rarely."""

    def show(message: Warning | str, *_: object, **__: object) -> None:
        """Print a warning as one line on standard error."""
        click.echo(f"warning: {' '.join(str(message).split())}", err=True)

    def terminate(number: int, frame: FrameType | None) -> None:
        """End the program with the exit status of a termination."""
        raise SystemExit(TERMINATED)

    with warnings.catch_warnings(), contextlib.ExitStack() as after:
        after.callback(gc.set_threshold, *gc.get_threshold())
        gc.set_threshold(NEW_OBJECTS)
        warnings.showwarning = show
        with contextlib.suppress(ValueError):  # signals can be handled in the main thread only
            after.callback(signal.signal, signal.SIGTERM, signal.signal(signal.SIGTERM, terminate))
        yield
