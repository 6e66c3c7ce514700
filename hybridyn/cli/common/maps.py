"""The map between motors and output joints, along a table or over a grid."""

import math
from collections.abc import Callable, Sequence

import click
import numpy as np

from ...assembly.posture import check_joints
from ...description.names import listed
from ...dynamics.quantities.joint_map import JointMap, joint_map, motors_beside
from ...dynamics.quantities.regular_map import regular_map
from ...effects.dc_motors import OnDcMotors
from ...errors import SingularityError
from ...spatial import Array
from ...streams.departures import Departures
from ...streams.one_pass import BlockResults
from ...streams.postures import TreeSamples
from ...structure.robot import HybridRobot
from ...studies import actuators, map_table
from ...tables.layout import Layout
from ...tables.results import open_results
from .options import Grid, refuse
from .text import aligned_rows, counted


def map_rows(
    robot: HybridRobot,
    block: TreeSamples,
    *,
    joints: Sequence[str],
    efforts: Callable[[HybridRobot, TreeSamples], BlockResults] | None,
    dc: OnDcMotors | None = None,
) -> BlockResults:
    """Compute the map at the postures of a block, with rates, accelerations and efforts.

    Args:
        joints: The output joints.
        efforts: Computes the efforts of a block, or None where they are not wanted.
        dc: DC motors, whose currents and voltages are written, too.
    """
    found = joint_map(robot, block.q, joints)
    made = None if efforts is None else efforts(robot, block)
    rows = map_table.map_rows(found, block.v, block.a, None if made is None else made.rows, dc)
    return BlockResults(rows) if made is None else made._replace(rows=rows)


class MapSummary:
    """The condition number of a map, over all postures."""

    def __init__(self, robot: HybridRobot, joints: Sequence[str]) -> None:
        self.robot, self.joints = robot, joints
        self.postures, self.low, self.high = 0, float("inf"), 0.0

    def add(self, done: BlockResults) -> None:
        """Add a block."""
        found = map_table.conditions(self.robot, self.joints, done.rows)
        self.postures += len(done.rows)
        self.low, self.high = min(self.low, found.min()), max(self.high, found.max())

    def show(self, layout: Layout | None, left: Departures | None, quiet: bool) -> None:
        """Print the line on standard error, if this is not `quiet`."""
        if quiet:
            return
        motors = motors_beside(self.robot, self.joints)
        if others := [name for name in self.robot.motors if name not in motors]:
            click.echo(f"not in the map, other motors: {listed(others)}", err=True)
        click.echo(
            f"{self.robot.name}: {', '.join(self.joints)} of {', '.join(motors)}; "
            f"{counted(self.postures, 'posture')}, condition number of the map {self.low:.3g} to "
            f"{self.high:.3g}",
            err=True,
        )


def tell_map(robot: HybridRobot, joints: Sequence[str], grid: Grid, output: str | None) -> None:
    """Write the map over a grid of the joints' positions, and say what was left out.

    Raises:
        HybridynError: The joints do not fit the modules, or no point is reached.
    """
    found, left_out = _map_on_grid(robot, joints, grid)
    rows, summary = map_table.map_rows(found), MapSummary(robot, joints)
    with open_results(output, map_table.map_columns(robot, joints)) as write:
        write(rows)
    summary.add(BlockResults(rows))
    summary.show(None, None, quiet=False)
    _tell_left_out(left_out)


def tell_actuators(robot: HybridRobot, joints: Sequence[str], grid: Grid, output: str) -> None:
    """Write what the motors are at the joints over a grid, and print the few numbers that do for all of it.

    Raises:
        HybridynError: As `tell_map`.
    """
    found, left_out = _map_on_grid(robot, joints, grid)
    columns = actuators.actuator_columns(found)
    with open_results(output, list(columns)) as write:
        write(np.column_stack(list(columns.values())))
    rows = [("joint", "number", "constant", "unit", "error")]
    for one in actuators.constants(columns):
        error = "largest" if math.isnan(one.error) else f"{100 * one.error:.2g} %"
        rows.append((one.joint, one.what, f"{one.value:.4g}", actuators.UNITS.get(one.what, "1"), error))
    click.echo("\n".join(aligned_rows(rows)))
    _tell_left_out(left_out)


def _tell_left_out(left_out: dict[str, int]) -> None:
    """Say which points of a grid have no posture."""
    for what, count in left_out.items():
        if count:
            click.echo(f"left out: {counted(count, 'point')} {what}", err=True)


def _map_on_grid(robot: HybridRobot, joints: Sequence[str], grid: Grid) -> tuple[JointMap, dict[str, int]]:
    """Return the map at the postures of a grid, and how many points have none, by the reason.

    Raises:
        HybridynError: As `tell_map`.
    """
    check_joints(robot, joints)
    every = [q for _, q in map_table.postures_on_grid(robot, _values(robot, joints, grid))]
    reached = [q for q in every if q is not None]
    found, kept = regular_map(robot, np.array(reached), joints)
    if found is None:
        raise SingularityError(
            f"all {counted(len(reached), 'posture')} of the grid that are reached are singular"
        )
    return found, {"out of reach": len(every) - len(reached), "singular": len(reached) - len(kept)}


def _values(robot: HybridRobot, joints: Sequence[str], grid: Grid) -> dict[str, Array]:
    """Return the positions of each joint on the grid."""
    if isinstance(grid, int):
        records = [robot.records[name] for name in joints]
        said = "joint '{}' has no limits in the robot's file: give --grid FROM:TO:COUNT,..."
        refuse(*((math.isinf(one.upper - one.lower), said.format(one.name)) for one in records))
        grid = tuple((joint.lower, joint.upper, grid) for joint in records)
    given, wanted = counted(len(grid), "range"), counted(len(joints), "joint")
    refuse((len(grid) != len(joints), f"--grid has {given} for {wanted}"))
    return {name: np.linspace(*ends) for name, ends in zip(joints, grid, strict=True)}
