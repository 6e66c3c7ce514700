"""`hybridyn convert`: write a robot in another format, or its models as C."""

from collections.abc import Sequence
from typing import Any

import click

from ..assembly.redundancy import LEAST
from ..compiled import needs_casadi
from ..conversion.convert import convert
from ..conversion.request import TIGHTNESS
from .common.options import RobotChoice, refuse

#: Exit status of --strict where something was lost.
LOST = 1


def run(
    load: RobotChoice, output: str, tightness: float, as_c: bool, as_ros: bool, redundancy: str | None,
    **of_c: Any,
) -> int:  # fmt: skip
    """Write a robot in another format, its models as C, or its tree for ROS."""
    only_c = any(of_c[name] for name in ("name", "float32", "parameters", "wrenches", "given", "acados"))
    only_c |= of_c["effects"] != ("default",)
    refuse(
        (as_c and as_ros, "--c and --ros exclude each other"),
        (
            as_ros and only_c,
            "--name, --float32, --parameters, --wrenches, --given, --acados and --effects belong to --c",
        ),
        (
            (as_c or as_ros) and tightness != TIGHTNESS,
            "--tightness belongs to robot files: neither C nor files for ROS hold closures by springs",
        ),
        (
            redundancy not in (None, LEAST),
            f"--redundancy: exported C knows '{LEAST}' alone. Give it the motors' positions that another "
            "rule has: 'hybridyn idm --redundancy' and hybridyn.assemble compute them",
        ),
    )
    if as_ros:
        return _for_ros(load, output, of_c["map_joints"])
    if as_c:
        _export(load, output, **of_c)
        return 0
    base = None if load.base == "moving" else load.base
    read = RobotChoice(
        load.robot, base, xacro_args=load.xacro_args, package_dirs=load.package_dirs, strict=load.strict
    )
    refuse(
        (
            only_c or of_c["map_joints"],
            "--name, --float32, --map, --parameters, --wrenches, --given, --acados and --effects belong to "
            "--c",
        ),
        (
            load != read,
            "--base moving, --motors, --gravity and the tolerances belong to --c",
        ),
    )
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


def _for_ros(load: RobotChoice, output: str, outputs: Sequence[str] | None) -> int:
    """Write what shows a robot in RViz."""
    from ..ros.bringup import write_bringup

    files, losses = write_bringup(
        load(), load.robot, output, outputs=outputs or (), xacro_args=load.xacro_args,
        package_dirs=load.package_dirs,
    )  # fmt: skip
    click.echo("\n".join([*(f"lost: {line}" for line in losses), *map(str, files)]), err=True)
    return LOST if load.strict and losses else 0


def _export(
    load: RobotChoice,
    output: str,
    name: str | None,
    float32: bool,
    map_joints: Sequence[str] | None,
    parameters: Sequence[str] | None,
    wrenches: Sequence[str] | None,
    given: Sequence[str] | None,
    acados: bool,
    effects: tuple[str, ...],
) -> None:
    """Write the robot's models as C."""
    needs_casadi()
    from ..compiled import export

    dtype = "float32" if float32 else "float64"
    chosen = {
        "map_joints": map_joints or (),
        "parameters": parameters or (),
        "wrenches": wrenches or (),
        "given": given or (),
    }
    for path in export(load(), output, effects, name=name, dtype=dtype, acados=acados, **chosen):
        click.echo(str(path), err=True)
