"""`hybridyn compare`: what other engines make of a robot."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from .common.options import RobotChoice, RobotCommand, known_names

if TYPE_CHECKING:
    from ..studies.compare.compare import Comparison

#: Exit status where an engine fails what --fail-on asks for.
FAILED = 1


def _engines() -> Iterable[str]:
    """Return the names of the engines."""
    from ..studies.compare.methods import ENGINES

    return ENGINES


@click.command(
    "compare", cls=RobotCommand, short_help="Compare how other engines simulate a robot and its loops."
)
@click.option(
    "--with",
    "engines",
    metavar="ENGINE,...",
    default="pinocchio,mujoco",
    show_default=True,
    callback=known_names("engine", _engines),
    help="Engines to compare; those that are not installed are listed and skipped.",
)
@click.option(
    "--samples", type=click.IntRange(1, 1000), default=5, show_default=True, help="Number of closed states."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the states.")
@click.option(
    "--tolerance",
    type=click.FloatRange(0, 1, min_open=True),
    default=1e-6,
    show_default=True,
    help="Largest relative difference of an engine that counts as equal.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON on standard output.")
@click.option(
    "--fail-on",
    type=click.Choice(["ignored", "different", "never"]),
    default="ignored",
    show_default=True,
    help="Exit with status 1 if an engine ignores a closure, or also if it differs by more than --tolerance.",
)
def command(
    load: RobotChoice,
    engines: tuple[str, ...],
    samples: int,
    seed: int,
    tolerance: float,
    as_json: bool,
    fail_on: str,
) -> int:
    """Compare ROBOT in other engines with hybridyn, at closed states near home.

    Each engine gets the robot twice: read by its own reader from the file, and built from hybridyn's model.
    The table shows the number of degrees of freedom; which closures the engine enforces, softens or ignores;
    and the differences of accelerations and efforts from hybridyn's. Only rigid bodies are compared:
    friction, springs, rotors, limits and contacts are switched off. 'hybridyn cost --with' compares times.

    Exit status: 0 no engine fails --fail-on; 1 an engine does, or the data are wrong; 2 wrong usage.
    """
    from ..studies.compare.compare import compare
    from ..studies.compare.report import as_text

    found = compare(
        load(),
        engines,
        samples=samples,
        seed=seed,
        tolerance=tolerance,
        xacro_args=load.xacro_args or None,
        package_dirs=load.package_dirs,
    )
    click.echo(json.dumps(_facts(found), indent=2) if as_json else as_text(found))
    failed = {"ignored": bool(found.ignored), "different": bool(found.ignored or found.different)}
    return FAILED if failed.get(fail_on) else 0


def _facts(found: Comparison) -> object:
    """Return the comparison as values of JSON; infinite numbers become None."""

    def plain(value: object) -> object:
        """Replace tuples by lists and numbers that are not finite by None, at any depth."""
        if isinstance(value, dict):
            return {key: plain(one) for key, one in value.items()}
        if isinstance(value, list | tuple):
            return [plain(one) for one in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return plain(asdict(found) | {"ignored": found.ignored, "different": found.different})
