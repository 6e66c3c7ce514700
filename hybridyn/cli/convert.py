"""`hybridyn convert`: write a robot in another format, or its models as C."""

from __future__ import annotations

from typing import Any

import click

from .common.options import RobotChoice, RobotCommand, split_names, takes_effects

#: Exit status of --strict where something was lost.
LOST = 1


@click.command(
    "convert", cls=RobotCommand, short_help="Write a robot as MJCF, SDF, URDF or USD, or its models as C."
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    required=True,
    help="The file; its ending names the format: .urdf, .xml (MJCF), .sdf, .usda. With --c, a folder.",
)
@click.option(
    "--tightness",
    type=click.FloatRange(0, min_open=True),
    metavar="NUMBER",
    default=1e-4,
    show_default=True,
    help="Distance by which closures may open in a simulator that holds them with springs [m].",
)
@click.option("--c", "as_c", is_flag=True, help="Write the dynamic models as C99.")
@click.option("--name", metavar="NAME", help="With --c: prefix of files and names.  [default: the robot's]")
@click.option("--float32", is_flag=True, help="With --c: single precision.")
@click.option(
    "--map",
    "map_joints",
    metavar="A,B,...",
    callback=split_names,
    help="With --c: output joints, whose map to the motors that move them is written, too.",
)
@click.option(
    "--parameters",
    metavar="A,B,...",
    callback=split_names,
    help="With --c: numbers that are arguments of the functions: mass:LINK, position:JOINT, arguments of a "
    "xacro file.",
)
@takes_effects("default")
def command(load: RobotChoice, output: str, tightness: float, as_c: bool, **of_c: Any) -> int:
    """Write ROBOT (URDF, MJCF, SDF, USD) in another format, or its models as C.

    Tree, closures, inertias, limits, motors, effects and home are written as far as the format can express
    them. Each line 'lost: ...' names a property that it cannot express; with --strict, the exit status is
    then 1. A file FILE.model.toml beside the output contains data that only hybridyn reads.

    With --c, the folder gets a header, a source, a test with reference values, a Makefile and a README, with
    one function per model. The code allocates no memory, and needs only <math.h>.
    """
    if as_c:
        _export(load, output, **of_c)
        return 0
    given = [name for name in ("name", "float32", "map_joints", "parameters") if of_c[name]]
    if given or of_c["effects"] != ("default",):
        raise click.UsageError("--name, --float32, --map, --parameters and --effects belong to --c")
    base = load.base
    if base == "moving" or load != RobotChoice(
        load.robot, base, xacro_args=load.xacro_args, package_dirs=load.package_dirs, strict=load.strict
    ):
        raise click.UsageError("--base moving, --motors, --gravity and the tolerances belong to --c")
    from ..conversion.convert import convert

    done = convert(
        load.robot,
        output,
        base=base,
        tightness=tightness,
        xacro_args=load.xacro_args or None,
        package_dirs=load.package_dirs,
        strict=load.strict,
    )
    told = [*(f"lost: {line}" for line in done.losses), *(f"note: {line}" for line in done.notes)]
    click.echo("\n".join([*told, *map(str, done.files)]), err=True)
    return LOST if load.strict and done.losses else 0


def _export(
    load: RobotChoice,
    output: str,
    name: str | None,
    float32: bool,
    map_joints: list[str] | None,
    parameters: list[str] | None,
    effects: tuple[str, ...],
) -> None:
    """Write the robot's models as C."""
    from ..compiled.failures import needs_casadi

    needs_casadi()
    from ..compiled.export import export

    dtype = "float32" if float32 else "float64"
    given = {"map_joints": map_joints or (), "parameters": parameters or ()}
    for path in export(load(), output, effects, name=name, dtype=dtype, **given):
        click.echo(str(path), err=True)
