"""Options and arguments that several commands have."""

from importlib import import_module
from typing import Any

import click

from ..common.files import existing_file, several
from ..common.options import known_names


def option(*names: str, **words: Any) -> click.Option:
    """Return an option, from the arguments of `click.option`."""
    return click.Option(names, **words)


def run_module(name: str, /, **words: Any) -> Any:
    """Import the module of a command, and run it with the values of arguments and options."""
    return import_module(f"hybridyn.cli.{name}").run(**words)


def effects_option(default: str | None) -> click.Option:
    """Return `--effects`. `default`: what applies where the user gives none, None where there are several."""
    more = "" if default else ".  [default: default; model for a report]"
    return option(
        "--effects", metavar="A,B,...", default=default, show_default=bool(default),
        callback=known_names("effect", "effects.catalogue", "names"),
        help="Effects: 'default' (gravity, inertia, leg_inertia, velocity), 'model' (all that the files "
        f"state), 'none', or names (docs/effects.md){more}",
    )  # fmt: skip


def jobs_option(default: str) -> click.Option:
    """Return `--jobs`. `default`: the number of processes where the user gives none."""
    return option(
        "-j", "--jobs", type=click.IntRange(1), metavar="N", help=f"Processes.  [default: {default}]"
    )


def far_options(where: str) -> list[click.Parameter]:
    """Return `--executor` and `--dask`. `where`: what the help says before."""
    return [
        option(
            "--executor", metavar="MODULE:FUNCTION",
            help=f"{where}Processes of the executor (concurrent.futures) that FUNCTION() returns.",
        ),
        option("--dask", metavar="ADDRESS", help=f"{where}Workers of the Dask scheduler at ADDRESS."),
    ]  # fmt: skip


def one_or_several(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Check a table, or let a folder or a glob of several pass."""
    return value if several(value) else existing_file(ctx, param, value)


ENGINE = option(
    "--engine", type=click.Choice(["general", "compiled"]),
    help="Models in Python or in C.  [default: C where it pays]",
)  # fmt: skip
PYTHON = option("--allow-python", is_flag=True, help="Let the scene run the Python controller that it names.")
RULE = option(
    "--redundancy", metavar="RULE", default="least motion", show_default=True,
    help="Rule for freedoms that poses leave: also 'middle of ranges', 'away from singular'.",
)  # fmt: skip
QUIET = option("-q", "--quiet", is_flag=True, help="No summary.")
