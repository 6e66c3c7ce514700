"""`hybridyn export`: write a robot's models as C for other programs."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from .common.options import RobotCommand, split_names, takes_effects, takes_robot

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot


@click.command("export", cls=RobotCommand, short_help="Write the dynamic models as dependency-free C.")
@takes_robot
@click.option(
    "-o",
    "--output",
    metavar="DIR",
    type=click.Path(file_okay=False),
    required=True,
    help="Folder for the files.",
)
@click.option("--name", metavar="NAME", help="Prefix of files and of names in C; the robot's own by default.")
@click.option("--float32", is_flag=True, help="Single precision, for processors without double.")
@click.option(
    "--map",
    "map_joints",
    metavar="A,B,...",
    callback=split_names,
    help="Output joints: also write their map to the motors that move them, as in 'hybridyn map'.",
)
@click.option(
    "--parameters",
    metavar="A,B,...",
    callback=split_names,
    help="Numbers that are arguments of the functions: mass:LINK, position:JOINT, arguments of a xacro file.",
)
@takes_effects("default")
def command(
    load: Callable[[], HybridRobot],
    output: str,
    name: str | None,
    float32: bool,
    map_joints: list[str] | None,
    parameters: list[str] | None,
    effects: tuple[str, ...],
) -> None:
    """Write the inverse and the direct dynamic model of ROBOT (URDF, MJCF, SDF, USD) as C99.

    The files are a header, a source, a test with reference values, a Makefile and a README. There is one
    function per model; the code allocates no memory and uses only <math.h> of the C library. ROBOT may be
    the name of a shipped robot ('hybridyn --robots').
    """
    from ..compiled.needs import needs_casadi

    needs_casadi()
    from ..compiled.export import export

    robot = load()
    dtype = "float32" if float32 else "float64"
    given = {"map_joints": map_joints or (), "parameters": parameters or ()}
    for path in export(robot, output, effects, name=name, dtype=dtype, **given):
        click.echo(str(path), err=True)
