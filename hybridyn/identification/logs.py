"""Logs as people record them: which columns are whose, which numbers are missing, and when they were taken.

A rosbag's times are uneven, and topics have clocks of their own: in PlotJuggler's tables a row has the
numbers of the topics that sent one then, and empty cells for the others (`series`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..description.names import did_you_mean, listed
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.opening import open_table
from .series import efforts_of, motion_of, used_rows

#: A motor moves if its travel is above this part of that of the motor of its kind that moves most.
MOVES = 1e-4
#: What the time is called: by hybridyn, and by PlotJuggler.
TIMES = ("time", "__time")
#: What a log tells of a motor.
QUANTITIES = ("position", "velocity", "acceleration", "effort", "current")


@dataclass(frozen=True, eq=False)
class Log:
    """What was recorded of a motion: positions and efforts of the motors.

    Attributes:
        file: Name of the table, or None.
        time: Times, shape (T,), [s]; evenly apart where rates are to be computed.
        position: Positions, shape (T, motors), [m or rad].
        rates: Velocities and accelerations, shape (T, motors) each; None where they are to be computed.
        effort: Efforts [N or N m], or currents, shape (T, motors); zero for a commanded motion.
        at: Times of the efforts, shape of their rows, [s], if they are others than those of the motion.
        currents: Whether the efforts are currents.
        band: Band of the positions [Hz], once they are filtered.
        remarks: What was done to the signals.
    """

    file: str | None
    time: Array
    position: Array
    rates: tuple[Array, Array] | None
    effort: Array
    at: Array | None = None
    currents: bool = False
    band: float | None = None
    remarks: tuple[str, ...] = ()

    @property
    def step(self) -> float:
        """Time between two samples [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations of a processed log, shape (T, motors) each."""
        assert self.rates is not None
        return self.position, *self.rates


def read_log(robot: HybridRobot, table: Any, *, efforts: bool = True) -> Log:
    """Read the motors' columns of a table; all other columns are left alone.

    Args:
        table: A file (CSV or Parquet), a mapping of columns, or a table with named columns: 'time',
            '<motor>/position', and '<motor>/effort' or '<motor>/current'; with '<motor>/velocity' and
            '<motor>/acceleration' nothing is differentiated. PlotJuggler's names are read, too: '__time', and
            '/joint_states/<motor>/position'.
        efforts: Whether efforts are needed.

    Raises:
        TrajectoryError: A column is missing, times do not increase, numbers are missing for long, samples are
            too few or a motor never moves.
    """
    file, every, columns = _columns(robot, table)
    of = {quantity: _of_motors(robot, every, columns, quantity, file) for quantity in QUANTITIES}
    measured = of["current"] if of["effort"] is None else of["effort"]
    wanted = {"time": columns.get("time"), f"{robot.motors[0]}/position": of["position"]}
    wanted |= {f"{robot.motors[0]}/effort": measured} if efforts else {}
    for name, values in wanted.items():
        if values is None:
            raise TrajectoryError(
                f"is missing{did_you_mean(name, every)}: identification needs time, position and effort "
                "(or current) of the motors",
                file=file, column=name,
            )  # fmt: skip
    rates = ("velocity", "acceleration") if of["velocity"] and of["acceleration"] else ()
    moved = [name for quantity in ("position", *rates) for name in of[quantity] or ()]
    rows = used_rows(columns, [*moved, *(measured or ())], file)
    motion = motion_of(rows, len(moved), bool(rates))
    taken = efforts_of(rows, len(moved), motion.time)
    position, *others = np.split(motion.values, 1 + len(rates), axis=1)
    log = Log(
        file, motion.time, position, (others[0], others[1]) if rates else None,
        taken.values if measured else np.zeros_like(position),
        None if taken.time is motion.time else taken.time, of["effort"] is None and measured is not None,
        remarks=(*motion.remarks, *taken.remarks),
    )  # fmt: skip
    _check_travel(robot, log)
    return log


def _columns(robot: HybridRobot, table: Any) -> tuple[str | None, tuple[str, ...], dict[str, Array]]:
    """Return name and header of a table, and its columns of time and motors by hybridyn's names for them."""
    if isinstance(table, Mapping) or hasattr(table, "columns"):
        own = {str(name): name for name in (table if isinstance(table, Mapping) else table.columns)}
        found = names_in(robot, tuple(own), None)
        values = {name: np.asarray(table[own[there]], dtype=float) for name, there in found.items()}
        return None, tuple(own), values
    file, every, found = str(table), list[str](), dict[str, str]()

    def choose(names: tuple[str, ...]) -> Sequence[str]:
        """Choose the columns of time and motors."""
        every.extend(names)
        found.update(names_in(robot, names, file))
        return list(found.values())

    with open_table(table, choose=choose) as opened:
        rows = np.concatenate([np.zeros((0, len(found))), *(block.values for block in opened.blocks)])
    return file, tuple(every), dict(zip(found, rows.T, strict=True))


def names_in(robot: HybridRobot, columns: Sequence[str], file: str | None) -> dict[str, str]:
    """Return the columns of time and motors by hybridyn's names for them.

    Raises:
        TrajectoryError: Several columns could be meant.
    """
    found: dict[str, str] = {}
    if time := next((name for name in TIMES if name in columns), None):
        found["time"] = time
    for name in (f"{motor}/{quantity}" for motor in robot.motors for quantity in QUANTITIES):
        alike = [name] if name in columns else [own for own in columns if own.endswith(f"/{name}")]
        if len(alike) > 1:
            raise TrajectoryError(
                f"is one of {len(alike)} columns that could be '{name}' ({listed(alike)}): drop the others, "
                f"or call the right one '{name}'", file=file, column=alike[0],
            )  # fmt: skip
        if alike:
            found[name] = alike[0]
    return found


def _of_motors(
    robot: HybridRobot,
    every: Sequence[str],
    columns: Mapping[str, Array],
    quantity: str,
    file: str | None,
) -> list[str] | None:
    """Return the columns of all motors, or None if no motor has one.

    Args:
        every: The header, for advice.
    """
    names = [f"{motor}/{quantity}" for motor in robot.motors]
    absent = [name for name in names if name not in columns]
    if len(absent) == len(names):
        return None
    if absent:
        raise TrajectoryError(
            f"is missing{did_you_mean(absent[0], every)}: every motor needs one",
            file=file, column=absent[0],
        )  # fmt: skip
    rows = {len(columns[name]) for name in ("time", *names) if name in columns}
    if len(rows) > 1:
        raise TrajectoryError(
            f"and others have {min(rows)} to {max(rows)} rows: give columns of one length",
            file=file, column=names[0],
        )  # fmt: skip
    return names


def _check_travel(robot: HybridRobot, log: Log) -> None:
    """Check that every motor moves."""
    travel = np.ptp(log.position, axis=0)
    linear = np.array([robot.records[name].kind.slides for name in robot.motors])
    most = np.array([travel[linear == kind].max() for kind in linear])
    still = [name for name, x, y in zip(robot.motors, travel, most, strict=True) if x <= MOVES * y]
    if still:
        raise TrajectoryError(
            f"{listed(still)} never moves: move every motor (hybridyn.excitation computes such a motion)",
            file=log.file, column=f"{still[0]}/position",
        )  # fmt: skip
