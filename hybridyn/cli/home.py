"""`hybridyn home`: find closed home postures, and write one to model.toml."""

from collections.abc import Iterator

import click

from ..description.side_cars.model_toml import home_table, write_home
from ..errors import ModelError
from ..structure.robot import HybridRobot, positions
from ..studies.home import HomePosture, Homes, homes
from ..tables.signals import unit_of
from .common.options import RobotChoice
from .common.text import aligned_rows, counted

#: Distance of a posture that is home itself [m or rad]: rounding of Newton's method.
AT_HOME = 1e-9
#: Joints that name a posture.
NAMED = 2
#: Decimals of a position [m or rad]; those beyond are rounding.
DECIMALS = 14


def run(
    load: RobotChoice,
    at: dict[str, float],
    everything: bool,
    starts: int,
    seed: int,
    choose: int | None,
    write: bool,
) -> None:
    """Find the home postures of a robot, and print or write one."""
    robot = load()
    found = homes(robot, at, starts=starts, seed=seed)
    if choose is None:
        inside = [number for number, one in enumerate(found.postures, 1) if one.within_limits]
        choose = (inside or [1])[0]
    if choose > len(found.postures):
        raise ModelError(f"there is no posture {choose}: {counted(len(found.postures), 'posture')} found")
    for line in _lines(robot, found, everything, choose):
        click.echo(line, err=not everything)
    posture = positions(robot, found.postures[choose - 1].q)
    home = {name: tuple(round(x, DECIMALS) + 0.0 for x in values) for name, values in posture.items()}
    if write:
        click.echo(f"written to {write_home(str(robot.description.source), home)}", err=True)
    elif not everything:
        click.echo(home_table(home), nl=False)


def _name(robot: HybridRobot, posture: HomePosture) -> str:
    """Name a posture by the joints that are farthest from home."""
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
