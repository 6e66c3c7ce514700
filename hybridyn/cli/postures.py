"""From a table's motion to postures of the whole robot, block by block, with rows in the error messages."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from hybridyn.errors import AssemblyError, HybridynError

if TYPE_CHECKING:
    from hybridyn.description.columns import Layout
    from hybridyn.description.records import Array
    from hybridyn.description.trajectory import Motion
    from hybridyn.robot import HybridRobot


class Postures(NamedTuple):
    """A block of samples on the spanning tree.

    Attributes:
        motion: The rows they come from.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
    """

    motion: Motion
    q: Array
    v: Array
    a: Array


def postures(robot: HybridRobot, motions: Iterable[Motion], layout: Layout) -> Iterator[Postures]:
    """Give the robot's postures: read from the table where it names every joint, assembled where not.

    Args:
        robot: The robot.
        motions: Blocks of motion.
        layout: The meaning of the table's columns.

    Yields:
        One block of postures per block of motion. Each block of a trajectory starts from the last posture of
        the one before; rows without time are assembled each from the home posture.

    Raises:
        HybridynError: As `hybridyn.assemble` does; the message names file, row and time.
    """
    from hybridyn.description.trajectory import full_state

    root = robot.description.root if robot.base != "fixed" else None
    joints = {joint.name: joint for joint in robot.description.joints}
    order = [joints[name] for name in robot.joints if name in joints]
    guess = None
    for motion in motions:
        if layout.full_state:
            yield Postures(motion, *full_state(motion, order, root))
            continue
        with rows_named(layout, motion):
            q, v, a = _assembled(robot, motion, guess)
        guess = None if motion.time is None else q[-1]
        yield Postures(motion, q, v, a)


def _assembled(robot: HybridRobot, motion: Motion, guess: Array | None) -> tuple[Array, Array, Array]:
    """Assemble a block: as one motion, or row by row where rows have nothing to do with each other."""
    import numpy as np

    import hybridyn

    if motion.time is not None:
        return hybridyn.assemble(robot, motors=motion.joints, platforms=motion.platforms, guess=guess)
    rows = []
    for index in range(motion.size):
        joints, platforms = _row(motion.joints, index), _row(motion.platforms, index)
        try:
            rows.append(hybridyn.assemble(robot, motors=joints, platforms=platforms))
        except AssemblyError as error:
            error.sample = index
            raise
    q, v, a = (np.concatenate(level) for level in zip(*rows, strict=True))
    return q, v, a


def _row(signals: Mapping[str, tuple[Any, ...]], index: int) -> dict[str, tuple[Any, ...]]:
    """Give one row of joints or platforms, whose levels are arrays or dicts of arrays, still as a batch."""
    row = slice(index, index + 1)
    return {
        name: tuple(
            {c: part[row] for c, part in level.items()} if isinstance(level, dict) else level[row]
            for level in levels
        )
        for name, levels in signals.items()
    }


@contextlib.contextmanager
def rows_named(layout: Layout, motion: Motion) -> Iterator[None]:
    """Put file, row and time before the message of an error that knows its sample, and rows for samples.

    Args:
        layout: The meaning of the table's columns.
        motion: The block of rows that is being worked on.
    """
    try:
        yield
    except HybridynError as error:
        sample = getattr(error, "sample", None)
        if sample is not None:
            time = "" if motion.time is None else f" (t = {motion.time[sample]:.6g} s)"
            message = re.sub(rf" at sample {sample}\b", "", str(error))
            message = re.sub(r"\bsample (\d+)", lambda m: f"row {motion.first_row + int(m[1])}", message)
            if layout.full_state and isinstance(error, AssemblyError):
                message += ", or leave the passive joints out of the table: the posture is then assembled"
            error.args = (f"{layout.file}, row {motion.first_row + sample}{time}: {message}",)
        raise
