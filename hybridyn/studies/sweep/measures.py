"""What a study measures: loads of the motors, columns of the motion, workspaces, functions in Python.

peak_effort, rms_effort, ...      of the motor with the largest one
max m1_left_elbow/position        a statistic (peak, max, min, mean, rms) of a column
cost.py:cost                      a function of (robot, motion) in a file beside the study
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ...description.names import did_you_mean
from ...description.records import Description
from ...description.side_cars.toml_file import Keys
from ...errors import ModelError
from ...extensions import added_names
from ...spatial import Array
from ...streams.postures import TreeSamples
from ...structure.robot import HybridRobot
from ...tables.over_time import mean_over, rms_over
from ...tables.signals import UNITS
from ..sizing import MotorLoad, Sizing, motor_rows
from ..workspace.workspace import Workspace
from .added_measures import measure_of
from .motion_columns import column_of
from .python_measures import Followed, call
from .study_file import PYTHON, StudyFile


def _below(peak: float, limit: float) -> float:
    """Return the part of a limit that is left, inf without a limit."""
    return 1.0 - abs(peak) / limit if limit < math.inf else math.inf


def _stroke(load: MotorLoad) -> float:
    """Return the smallest distance to a position limit, as a part of the stroke; inf without a stroke."""
    stroke = load.upper_limit - load.lower_limit
    if load.travel is None or not 0 < stroke < math.inf:
        return math.inf
    return min(load.travel[0] - load.lower_limit, load.upper_limit - load.travel[1]) / stroke


#: Measures of a trajectory: how the numbers of the motors are joined, and the number of one motor.
OF_MOTORS: dict[str, tuple[Callable[[list[float]], float], Callable[[MotorLoad], float | None]]] = {
    "peak_effort": (max, lambda load: abs(load.effort.value)),
    "rms_effort": (max, lambda load: load.rms_effort),
    "peak_speed": (max, lambda load: abs(load.speed.value)),
    "rms_speed": (max, lambda load: load.rms_speed),
    "peak_power": (max, lambda load: abs(load.power.value)),
    "braking_power": (max, lambda load: abs(load.braking_power.value)),
    "mean_power": (sum, lambda load: load.mean_power),
    "energy": (sum, lambda load: load.energy_given),
    "effort_margin": (min, lambda load: _below(load.effort.value, load.effort_limit)),
    "speed_margin": (min, lambda load: _below(load.speed.value, load.speed_limit)),
    "stroke_margin": (min, _stroke),
}


def of_motors(word: str, loads: Sequence[MotorLoad]) -> float:
    """Return a measure of the motors; nan where one of them has none."""
    join, of = OF_MOTORS[word]
    numbers = [math.nan if number is None else number for number in map(of, loads)]
    return float(join(numbers)) if numbers else math.nan


#: Measures in the unit of the motors, which do not compare where it differs, by their quantity.
OF_KIND = {f"{what}_{of}": of for of in ("effort", "speed") for what in ("peak", "rms")}

#: Units of measures that do not depend on the robot; margins and conditioning have none.
OF_ROBOT = {
    "peak_power": "W",
    "braking_power": "W",
    "mean_power": "W",
    "energy": "J",
    "reach": "m",
    "time": "s",
}
#: Units of the columns of slides and of other joints, and of links by their components without and with "w".
OF_COLUMN = {**UNITS, "pose": ("m", "")}

#: Measures of a workspace.
OF_WORKSPACE: dict[str, Callable[[Workspace], float]] = {
    "poses": lambda found: float(len(found.index)),
    "size": lambda found: found.size,
    "reach": lambda found: _reach(found),
    "min_conditioning": lambda found: float(found.measures["conditioning"].min()),
    "mean_conditioning": lambda found: float(found.measures["conditioning"].mean()),
    "max_effort_per_force": lambda found: _largest(found, "effort_per_force"),
    "max_effort_per_torque": lambda found: _largest(found, "effort_per_torque"),
}

#: Measures of a scene besides those of a trajectory: the time that it reached [s], and the number of events.
OF_SCENE = ("time", "events")
#: A measure of a scene: the time of its first event of this name [s]; empty where it does not happen.
EVENT = "event"
#: Names of measures.
OWN = (*OF_MOTORS, *OF_WORKSPACE, *OF_SCENE, EVENT)

#: Statistics of a column over time; means are time integrals where the table has times.
STATISTICS: dict[str, Callable[[Array, Array | None], float]] = {
    "peak": lambda x, t: float(np.abs(x).max()),
    "max": lambda x, t: float(x.max()),
    "min": lambda x, t: float(x.min()),
    "mean": lambda x, t: float(mean_over(t, x)),
    "rms": lambda x, t: float(rms_over(t, x)),
    "final": lambda x, t: float(x[-1]),
}


def _largest(found: Workspace, name: str) -> float:
    """Return the largest effort in a workspace; inf if a pose is singular, nan if motors are too few."""
    return float(found.measures[name].max()) if name in found.measures else math.nan


def _reach(found: Workspace) -> float:
    """Return the largest distance of the poses from the base's origin, over the swept translations [m]."""
    columns = [i for i, name in enumerate(found.sweep.names) if name in "xyz"]
    return float(np.linalg.norm(found.coordinates[:, columns], axis=1).max())


def check_word(source: StudyFile, keys: Keys, word: str, kind: str, *, named: bool) -> None:
    """Check the form of a measure.

    Args:
        keys: Place of the measure in the file.
        kind: Kind of its task.
        named: Whether it has a name of its own.

    Raises:
        ModelError: There is no such measure, or it needs a name.
    """
    known = {
        "trajectory": [*OF_MOTORS], "scene": [*OF_MOTORS, *OF_SCENE], "workspace": [*OF_WORKSPACE],
    }[kind]  # fmt: skip
    statistics = {"trajectory": [*STATISTICS], "scene": [*STATISTICS, EVENT], "workspace": []}[kind]
    statistic, _, column = word.partition(" ")
    if word in known:
        return
    if (one := measure_of(word)) is not None:
        if kind not in one.tasks:
            raise source.error(keys, f"'{word}' of {one.package} measures no {kind}")
        return
    if PYTHON not in word and not (statistic in statistics and column):
        more = f", '{'|'.join(STATISTICS)} COLUMN'" if statistics else ""
        more += f", '{EVENT} NAME'" if EVENT in statistics else ""
        known += [x for x in added_names("measures") if (one := measure_of(x)) and kind in one.tasks]
        hint = did_you_mean(word, known)
        raise source.error(
            keys,
            f"there is no measure '{word}'{hint}; of a {kind}: {', '.join(known)}{more}, 'FILE.py:FUNCTION'",
        )
    if not named:
        raise source.error(keys, f"'{word}' needs a name: measure = {{ name = \"{word}\" }}")


def unit_of(word: str, description: Description) -> str:
    """Return the unit of a measure, "" where it has none or the robot's description does not tell it."""
    if (one := measure_of(word)) is not None:
        return one.unit
    kinds = {joint.name: joint.kind for joint in description.joints}
    if word in OF_KIND:
        of_motors = {UNITS[OF_KIND[word]][not kinds[motor].slides] for motor in description.motors}
        return " or ".join(sorted(of_motors))
    owner, _, quantity = word.partition(" ")[2].rpartition("/")
    turns = owner in kinds and not kinds[owner].slides
    if owner not in kinds:
        turns, quantity = quantity.startswith("w"), owner.rpartition("/")[2]
    return OF_COLUMN[quantity][turns] if quantity in OF_COLUMN else OF_ROBOT.get(word, "")


def check_units(robot: HybridRobot, words: Iterable[str]) -> None:
    """Check that a largest effort or speed is one of motors with the same unit.

    Raises:
        ModelError: The motors have different units.
    """
    wrong = [word for word in words if word in OF_KIND and len(set(robot.effort_units)) > 1]
    for word in wrong:
        statistic, _, quantity = word.partition("_")
        raise ModelError(
            f"measure '{word}': the motors are slides and joints that turn, whose {quantity}s do not "
            f"compare; write '{statistic} MOTOR/effort' or '{statistic} MOTOR/velocity' for each of them",
            element=word,
        )


def measured(
    robot: HybridRobot,
    wanted: Mapping[str, str],
    blocks: Sequence[tuple[TreeSamples, Array]],
    functions: Mapping[str, Callable[..., Any]],
) -> dict[str, float]:
    """Measure a motion.

    Args:
        wanted: The measures by name.
        blocks: Consecutive parts of the motion, with the efforts of the motors, shape (T, motors).
        functions: The functions in Python by measure.

    Raises:
        ModelError: Efforts or speeds of different units are compared, or a function in Python fails.
        TrajectoryError: There is no such column.
    """
    check_units(robot, wanted.values())
    whole, tau = (
        TreeSamples.joined([block for block, _ in blocks]),
        np.concatenate([tau for _, tau in blocks]),
    )
    time, loads, out = whole.motion.time, list[MotorLoad](), dict[str, float]()
    if any(word in OF_MOTORS for word in wanted.values()):
        sizing = Sizing(robot)
        sizing.add(time, whole.motion.first_row, *motor_rows(robot, whole.q, whole.v), tau)
        loads = sizing.loads()
    for name, word in wanted.items():
        if word in OF_MOTORS:
            out[name] = of_motors(word, loads)
        elif word not in functions:
            statistic, _, column = word.partition(" ")
            out[name] = STATISTICS[statistic](column_of(robot, whole, tau, column), time)
    followed = Followed(time, whole.q, whole.v, whole.a, tau, dict(out))
    out |= {
        name: call(functions, word, robot, followed) for name, word in wanted.items() if word in functions
    }
    return {name: out[name] for name in wanted}
