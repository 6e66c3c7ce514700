"""Compute postures of the whole robot from a table's motion; errors name the row."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..assembly import assemble as general
from ..errors import AT_SAMPLE, AssemblyError, HybridynError, SingularityError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.layout import Layout
from ..tables.trajectory import TableMotion
from .departures import question

HISTORY = (
    "The motion of joints without a motor depends on what came before: give the position and velocity of "
    "every joint, or let 'hybridyn simulate' compute them"
)
INSTEAD = ", or leave the passive joints out of the table: the posture is then assembled"

#: Assembles rows like `hybridyn.assemble`, but for the robot: `CompiledRobot.assemble`.
Assemble = Callable[..., tuple[Array, Array, Array]]


class TreeSamples(NamedTuple):
    """Samples on the spanning tree.

    Attributes:
        motion: The rows of the samples.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
    """

    motion: TableMotion
    q: Array
    v: Array
    a: Array

    @staticmethod
    def joined(parts: Sequence[TreeSamples]) -> TreeSamples:
        """Return the samples of consecutive parts of a table."""
        motions, *levels = zip(*parts, strict=True)
        return TreeSamples(motions[0].joined(motions), *map(np.concatenate, levels))


def postures(
    robot: HybridRobot,
    motion: TableMotion,
    layout: Layout,
    guess: Array | None,
    assemble: Assemble | None = None,
) -> TreeSamples:
    """Compute the robot's postures: read them where the table names every joint, else assemble them.

    Args:
        motion: Some rows of the table.
        layout: The meaning of the table's columns.
        guess: Posture near the first row, shape (nq,); None means the home posture. Rows without time are
            each assembled from the home posture.
        assemble: Assembles the rows; None for the general path.

    Raises:
        HybridynError: As in `hybridyn.assemble`; the message names file, row and time.
    """
    if not layout.full_state:
        with rows_named(layout, motion):
            try:
                return TreeSamples(motion, *_assembled(robot, motion, layout, guess, assemble))
            except (AssemblyError, SingularityError) as error:
                error.advice += question(robot, motion)
                raise
    from ..tables.tree_coordinates import full_state  # most tables name motors or links

    root = robot.description.root if robot.base != "fixed" else None
    order = [robot.records[name] for name in robot.joints if name in robot.records]
    return TreeSamples(motion, *full_state(motion, order, root))


def _assembled(
    robot: HybridRobot, motion: TableMotion, layout: Layout, guess: Array | None, assemble: Assemble | None
) -> tuple[Array, Array, Array]:
    """Assemble rows: with time as one motion, without as independent samples.

    Rates of a spline may contradict one another; its positions do not.
    """
    assemble = assemble or functools.partial(general.assemble, robot)
    fitted = any(signal.missing for signal in layout.signals)
    if motion.time is not None:
        check_unwrapped(robot, motion.time, motion.joints)
        return assemble(motors=motion.joints, platforms=motion.platforms, guess=guess, nearest=fitted)
    rows = []
    for index in range(motion.size):
        row = motion.part(index, index + 1)
        try:
            rows.append(assemble(motors=row.joints, platforms=row.platforms, nearest=fitted))
        except AssemblyError as error:
            error.sample = index
            raise
    q, v, a = (np.concatenate(level) for level in zip(*rows, strict=True))
    return q, v, a


def check_unwrapped(robot: HybridRobot, time: Array, joints: Mapping[str, tuple[Array, ...]]) -> None:
    """Check that positions of endless gears do not jump by whole turns against their velocities.

    Args:
        time: Times, shape (T,), [s].
        joints: Joint name to position, velocity and acceleration, shape (T,) each.

    Raises:
        AssemblyError: One jumps; the message names joint and sample.
    """
    for name in sorted(robot.description.endless_gears & joints.keys()):
        position, rate = joints[name][:2]
        step, turned = np.diff(position), np.diff(time) * (rate[1:] + rate[:-1]) / 2
        jumps = np.flatnonzero((np.abs(step) > np.pi) & (np.round((step - turned) / (2 * np.pi)) != 0))
        if len(jumps):
            i = int(jumps[0])
            raise AssemblyError(
                f"joint '{name}' goes by {step[i]:.3g} rad{AT_SAMPLE}, its velocity by "
                f"{turned[i]:.3g}: it is in a gear, so its position counts whole turns. Give positions that "
                "do (numpy.unwrap), or rows less than half a turn apart",
                sample=i + 1,
            )


@contextlib.contextmanager
def rows_named(layout: Layout, motion: TableMotion) -> Iterator[None]:
    """Give errors that have a sample the file, row and time of it as their place."""
    try:
        yield
    except HybridynError as error:
        underdetermined = isinstance(error, AssemblyError) and bool(error.open_freedoms)
        if isinstance(error, AssemblyError) and error.undriven:
            error.advice += f". {HISTORY}"
        if error.sample is not None:
            time = "" if motion.time is None else f" (t = {motion.time[error.sample]:.6g} s)"
            if layout.full_state and isinstance(error, AssemblyError):
                error.advice += INSTEAD
            error.within(f"{layout.file}, row {motion.first_row + error.sample}{time}", row_named=True)
        elif error.advice or underdetermined:
            error.within(str(layout.file))
        raise
