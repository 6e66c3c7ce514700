"""`hybridyn home`: find closed home postures, and write one to model.toml."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import click

from .common.options import RobotCommand, numbers_by_name
from .common.text import aligned_rows, counted

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot
    from ..studies.home import HomePosture, Homes

#: Distance of a posture that is home itself [m or rad]: rounding of Newton's method.
AT_HOME = 1e-9
#: Joints that name a posture.
NAMED = 2
#: Decimals of a position [m or rad]; those beyond are rounding.
DECIMALS = 14


@click.command("home", cls=RobotCommand, short_help="Find closed home postures; write one to model.toml.")
@click.option(
    "--at",
    metavar="NAME=NUMBER",
    multiple=True,
    callback=numbers_by_name,
    help="Position of a motor [m or rad]; the others stay at home. May be repeated.",
)
@click.option("--all", "everything", is_flag=True, help="List all postures that are found.")
@click.option(
    "--starts", type=click.IntRange(1), default=200, show_default=True, help="Random starts per module."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the starts.")
@click.option(
    "--choose",
    type=click.IntRange(1),
    metavar="NUMBER",
    help="The posture that is shown or written, as --all numbers them.  [default: the nearest to home "
    "within limits]",
)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    help="Write all postures as a table of states at rest, second by second; 'hybridyn view ROBOT FILE' "
    "shows them.",
)
@click.option("--write", is_flag=True, help="Write the posture to the robot's model.toml.")
def command(
    load: Callable[[], HybridRobot],
    at: dict[str, float],
    everything: bool,
    starts: int,
    seed: int,
    choose: int | None,
    output: str | None,
    write: bool,
) -> None:
    """Find postures of ROBOT (URDF, MJCF, SDF, USD) that close its loops with its motors at home.

    The search starts from random postures, so --all may still miss a posture. The command prints the chosen
    posture as the table [home] of model.toml. --write writes it to that file, and changes nothing else there.
    """
    from ..description.side_cars.model_toml import home_table, write_home
    from ..errors import ModelError
    from ..structure.robot import positions
    from ..studies.home import homes

    robot = load()
    found = homes(robot, at, starts=starts, seed=seed)
    if choose is None:
        inside = [number for number, one in enumerate(found.postures, 1) if one.within_limits]
        choose = (inside or [1])[0]
    if choose > len(found.postures):
        raise ModelError(f"there is no posture {choose}: {counted(len(found.postures), 'posture')} found")
    if output:
        _save(robot, found, output)
    for line in _lines(robot, found, everything, choose):
        click.echo(line, err=not everything)
    posture = positions(robot, found.postures[choose - 1].q)
    home = {name: tuple(round(x, DECIMALS) + 0.0 for x in values) for name, values in posture.items()}
    if write:
        click.echo(f"written to {write_home(str(robot.description.source), home)}", err=True)
    elif not everything:
        click.echo(home_table(home), nl=False)


def _save(robot: HybridRobot, found: Homes, target: str) -> None:
    """Write the postures as a table of states at rest, number n at n seconds."""
    import numpy as np

    from ..simulation.table import state_columns, state_rows
    from ..tables.results import open_results

    q = np.array([posture.q for posture in found.postures])
    rest = np.zeros((len(q), robot.nv))
    with open_results(target, state_columns(robot)) as write:
        write(state_rows(robot, np.arange(1.0, len(q) + 1), q, rest, rest))


def _name(robot: HybridRobot, posture: HomePosture) -> str:
    """Name a posture by the joints that are farthest from home."""
    from ..tables.signals import unit_of

    far = [
        f"{joint} {x:.3g} {unit_of(robot.kinds[robot.joint_index[joint]])}"
        for joint, x in list(posture.distances.items())[:NAMED]
    ]
    return "home" if posture.distance < AT_HOME or not far else f"{', '.join(far)} from home"


def _lines(robot: HybridRobot, found: Homes, everything: bool, choose: int) -> Iterator[str]:
    """Yield the postures, one per line."""
    rows = [
        (
            f"{number}",
            _name(robot, posture),
            "within limits" if posture.within_limits else "beyond limits",
            f"closed to {posture.residual:.1e}",
        )
        for number, posture in enumerate(found.postures, 1)
        if everything or number == choose
    ]
    yield from aligned_rows(rows)
    left = (
        "" if found.unseen < 0.01 else f"; one more start finds another with probability {found.unseen:.2g}"
    )
    yield f"{counted(len(found.postures), 'posture')} with the motors there, positions in m and rad{left}"
