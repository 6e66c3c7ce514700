"""`hybridyn convert`: write a robot in another format."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from .common.files import complete_robot, robot_file
from .common.options import RobotCommand, takes_packages, takes_xacro_arguments

if TYPE_CHECKING:
    from ..description.records import StatedBase

#: Exit status of --strict where something was lost.
LOST = 1


@click.command(
    "convert", cls=RobotCommand, short_help="Write a robot in another format: MJCF, SDF, URDF, USD."
)
@click.argument("robot", callback=robot_file, shell_complete=complete_robot)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    required=True,
    help="The file to write; its ending names the format: .urdf, .xml (MJCF), .sdf, .usda.",
)
@click.option(
    "--base",
    type=click.Choice(["fixed", "floating"]),
    help="Motion of the root link: at rest, or free.  [default: as the file states, else fixed]",
)
@click.option(
    "--strict",
    is_flag=True,
    help="Refuse a robot of which something was read past; exit with status 1 if something is lost.",
)
@click.option(
    "--tightness",
    type=click.FloatRange(0, min_open=True),
    default=1e-4,
    show_default=True,
    help="Distance by which closures may open in a simulator that holds them with springs [m].",
)
@takes_xacro_arguments
@takes_packages
def command(
    robot: str,
    output: str,
    base: StatedBase | None,
    strict: bool,
    tightness: float,
    xacro_args: dict[str, str],
    package_dirs: tuple[str, ...],
) -> int:
    """Write ROBOT (URDF, MJCF, SDF, USD) in another format.

    Tree, closures, inertias, limits, motors, effects and home are written as far as the format can express
    them. Each line 'lost: ...' names a property that it cannot express. A file FILE.model.toml beside the
    output contains data that only hybridyn reads. ROBOT may be the name of a shipped robot ('hybridyn
    robots').
    """
    from ..conversion.convert import convert

    done = convert(
        robot,
        output,
        base=base,
        tightness=tightness,
        xacro_args=xacro_args or None,
        package_dirs=package_dirs,
        strict=strict,
    )
    for line in done.losses:
        click.echo(f"lost: {line}", err=True)
    for line in done.notes:
        click.echo(f"note: {line}", err=True)
    for file in done.files:
        click.echo(str(file), err=True)
    return LOST if strict and done.losses else 0
