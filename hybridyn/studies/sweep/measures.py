"""What a study measures: loads of the motors, columns of the motion, workspaces, functions in Python.

peak_effort, rms_effort, ...      of the motor with the largest one
max m1_left_elbow/position        a statistic (peak, max, min, mean, rms) of a column
cost.py:cost                      a function of (robot, motion) in a file beside the study
"""

from __future__ import annotations

import importlib.util
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...description.names import did_you_mean
from ...description.records import Description, Joint
from ...description.side_cars.toml_file import Keys
from ...dynamics.link_motion import kinematics
from ...errors import HybridynError, ModelError, TrajectoryError
from ...spatial import Array, Index
from ...streams.postures import TreeSamples
from ...structure.robot import HybridRobot
from ...tables.over_time import mean_over, rms_over
from ...tables.signals import TWIST, UNITS
from ...tables.trajectory import TableMotion
from ..sizing import MotorLoad, Sizing, motor_rows
from ..workspace.workspace import Workspace
from .study_file import PYTHON, StudyFile, python_of

#: Columns of a link; those of joints and motors have no component.
_OF_LINK = re.compile(r"(?P<link>.+)/(?P<quantity>pose|velocity|acceleration)/(?P<component>\w+)")
_FORMS = (
    "columns are '<joint>/position|velocity|acceleration', '<motor>/effort|power', '<link>/pose/x|y|z' and "
    "'<link>/velocity|acceleration/x|y|z|wx|wy|wz'"
)


def column_of(robot: HybridRobot, block: TreeSamples, tau: Array, column: str) -> Array:
    """Return a column of the motion, shape (T,).

    Args:
        block: The postures.
        tau: Efforts of the motors, shape (T, motors).
        column: `<joint>/position|velocity|acceleration` of a joint with one freedom, `<motor>/effort|power`,
            or `<link>/pose|velocity|acceleration/...` in the world.

    Raises:
        TrajectoryError: There is no such column.
    """
    if match := _OF_LINK.fullmatch(column):
        return _of_link(robot, block, match["link"], match["quantity"], match["component"])
    owner, _, quantity = column.rpartition("/")
    if quantity in ("effort", "power"):
        if owner not in robot.motors:
            raise _absent("motor", owner, robot.motors)
        effort: Array = tau[:, robot.motors.index(owner)]
        speed = block.v[:, robot.v_slices[robot.joint_index[owner]].start]
        return effort if quantity == "effort" else effort * speed
    quantities = {"position": (block.q, robot.q_slices), "velocity": (block.v, robot.v_slices),
                  "acceleration": (block.a, robot.v_slices)}  # fmt: skip
    if quantity not in quantities:
        raise TrajectoryError(f"'{column}' is not understood; {_FORMS}")
    if owner not in robot.joint_index:
        raise _absent("joint", owner, robot.joints)
    joint = robot.joint_index[owner]
    if not (robot.kinds[joint].additive if quantity == "position" else robot.kinds[joint].single):
        raise TrajectoryError(f"joint '{owner}' is {robot.kinds[joint]}, and has no single {quantity}")
    rows, places = quantities[quantity]
    return rows[:, places[joint].start]


def _of_link(robot: HybridRobot, block: TreeSamples, link: str, quantity: str, component: str) -> Array:
    """Return a coordinate of a link's origin, or a component of its rates, shape (T,), world axes."""
    known = TWIST[:3] if quantity == "pose" else TWIST
    if component not in known:
        raise TrajectoryError(f"'{link}/{quantity}/{component}' is not understood; {_FORMS}")
    motion = kinematics(robot, block.q, block.v, block.a, links=[link])[link]
    rows = {"pose": motion.pose, "velocity": motion.twist, "acceleration": motion.acceleration}[quantity]
    return rows[:, TWIST.index(component)]


def _absent(what: str, name: str, known: tuple[str, ...] | list[str]) -> TrajectoryError:
    return TrajectoryError(f"there is no {what} '{name}'{did_you_mean(name, known)}")


if TYPE_CHECKING:
    from ...compiled.programs.evaluating import DesignTable


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
}

#: Statistics of a column over time; means are time integrals where the table has times.
STATISTICS: dict[str, Callable[[Array, Array | None], float]] = {
    "peak": lambda x, t: float(np.abs(x).max()),
    "max": lambda x, t: float(x.max()),
    "min": lambda x, t: float(x.min()),
    "mean": lambda x, t: float(mean_over(t, x)),
    "rms": lambda x, t: float(rms_over(t, x)),
    "final": lambda x, t: float(x[-1]),
}

#: Measures of a scene besides those of a trajectory: the time that it reached [s], and the number of events.
OF_SCENE = ("time", "events")
#: A measure of a scene: the time of its first event of this name [s]; empty where it does not happen.
EVENT = "event"


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
    if PYTHON not in word and not (statistic in statistics and column):
        more = f", '{'|'.join(STATISTICS)} COLUMN'" if statistics else ""
        more += f", '{EVENT} NAME'" if EVENT in statistics else ""
        hint = did_you_mean(word, known)
        raise source.error(
            keys,
            f"there is no measure '{word}'{hint}; of a {kind}: {', '.join(known)}{more}, 'FILE.py:FUNCTION'",
        )
    if not named:
        raise source.error(keys, f"'{word}' needs a name: measure = {{ name = \"{word}\" }}")


def unit_of(word: str, description: Description) -> str:
    """Return the unit of a measure, "" where it has none or the robot's description does not tell it."""
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


@dataclass(eq=False)
class Followed:
    """The motion of a design along a trajectory, for functions in Python.

    Attributes:
        time: Times, shape (T,), [s], or None.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        effort: Efforts of the motors, shape (T, motors), [N or N m].
        measures: The other measures of the task by name.
    """

    time: Array | None
    q: Array
    v: Array
    a: Array
    effort: Array
    measures: Mapping[str, float]


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
        elif PYTHON not in word:
            statistic, _, column = word.partition(" ")
            out[name] = STATISTICS[statistic](column_of(robot, whole, tau, column), time)
    followed = Followed(time, whole.q, whole.v, whole.a, tau, dict(out))
    out |= {name: call(functions, word, robot, followed) for name, word in wanted.items() if PYTHON in word}
    return {name: out[name] for name in wanted}


def functions_of(source: StudyFile) -> dict[str, Callable[..., Any]]:
    """Run the Python files of a study, which have all rights of this process, and return their functions.

    Raises:
        ModelError: A file fails, or has no such function.
    """
    words = [word for task in source.study.tasks.values() for word in task.wanted.values() if PYTHON in word]
    out: dict[str, Callable[..., Any]] = {}
    for word in words:
        file, name = python_of(word)
        path = source.beside(file)
        spec = importlib.util.spec_from_file_location(file.removesuffix(".py").replace("/", "_"), path)
        if spec is None or spec.loader is None:
            raise ModelError("there is no such Python file", file=path)
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
            out[word] = getattr(module, name)
        except Exception as error:
            raise ModelError(f"'{name}': {type(error).__name__}: {error}", file=path) from error
    return out


def call(functions: Mapping[str, Callable[..., Any]], word: str, robot: HybridRobot, result: object) -> float:
    """Call a function in Python and return its number.

    Raises:
        ModelError: It fails, or returns no number.
    """
    try:
        return float(functions[word](robot, result))
    except HybridynError:
        raise
    except Exception as error:
        raise ModelError(f"'{word}': {type(error).__name__}: {error}") from error


def measures_of(
    robot: HybridRobot,
    descriptions: Sequence[Description],
    wanted: Mapping[str, str],
    motion: TableMotion,
    table: DesignTable,
    chosen: Index,
) -> list[dict[str, float] | None]:
    """Compute the measures of designs that can make the whole motion.

    A design's measures do not depend on the others.

    Args:
        robot: The robot whose models were compiled.
        descriptions: Description of each chosen design, of which limits are read.
        wanted: The measures by name; none is a function in Python.
        table: Motions and efforts of designs.
        chosen: Numbers of the chosen designs in the table.

    Returns:
        Measures of each chosen design by name; None where a column cannot be computed.
    """
    motors = {name: word for name, word in wanted.items() if word in OF_MOTORS}
    others = {name: word for name, word in wanted.items() if word not in OF_MOTORS}
    out: list[dict[str, float] | None] = [{} for _ in chosen]
    if motors:
        out = [*_loads(robot, descriptions, motors, motion, table, chosen)]
    for i, k in enumerate(chosen.tolist() if others else ()):
        built = replace(robot, description=descriptions[i])
        block = TreeSamples(motion, table.q[k], table.v[k], table.a[k])
        try:
            out[i] = {**(out[i] or {}), **measured(built, others, [(block, table.tau[k])], {})}
        except Exception:  # the general path says what is wrong
            out[i] = None
    return out


def _loads(
    robot: HybridRobot,
    descriptions: Sequence[Description],
    words: Mapping[str, str],
    motion: TableMotion,
    table: DesignTable,
    chosen: Index,
) -> list[dict[str, float]]:
    """Compute measures of motors, which stand side by side, those of a design together."""
    records: dict[int, list[Joint]] = {}
    joints = []
    for description in descriptions:
        if id(description) not in records:
            by_name = {joint.name: joint for joint in description.joints}
            records[id(description)] = [by_name[name] for name in robot.motors]
        joints += records[id(description)]
    sizing = Sizing(robot, joints)
    position, speed = motor_rows(robot, table.q[chosen], table.v[chosen])
    sizing.add(motion.time, motion.first_row, *map(_aside, (position, speed, table.tau[chosen])))
    loads, count = sizing.loads(), len(robot.motors)
    own = [loads[i : i + count] for i in range(0, len(loads), count)]
    return [{name: of_motors(word, each) for name, word in words.items()} for each in own]


def _aside(x: Array) -> Array:
    """Return rows of designs, shape (designs, T, motors), side by side, shape (T, designs x motors)."""
    return x.swapaxes(0, 1).reshape(x.shape[1], -1)
