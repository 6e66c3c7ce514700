"""What a study measures: loads of the motors, columns of the motion, workspaces, functions in Python.

peak_effort, rms_effort, ...      of the motor with the largest one
peak_effort[N m]                  the same of the motors with this unit
max m1_left_elbow/position        a statistic (peak, max, min, mean, rms) of a column
cost.py:cost                      a function of (robot, motion) in a file beside the study
"""

from __future__ import annotations

import importlib.util
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...description.names import did_you_mean
from ...description.records import Description, Joint
from ...description.side_cars.toml_file import Keys
from ...dynamics.link_motion import kinematics
from ...errors import HybridynError, ModelError, TrajectoryError
from ...spatial import Array, Index
from ...streams.postures import Postures
from ...structure.robot import HybridRobot
from ...tables.over_time import mean_over, rms_over
from ...tables.signals import TWIST, UNITS
from ...tables.trajectory import Motion
from ..sizing import MotorLoad, Sizing, motor_rows
from ..workspace.workspace import Workspace
from .study_file import PYTHON, StudyFile, python_of

#: Columns of a link; those of joints and motors have no component.
_OF_LINK = re.compile(r"(?P<link>.+)/(?P<quantity>pose|velocity|acceleration)/(?P<component>\w+)")
_FORMS = (
    "columns are '<joint>/position|velocity|acceleration', '<motor>/effort|power', '<link>/pose/x|y|z' and "
    "'<link>/velocity|acceleration/x|y|z|wx|wy|wz'"
)


def column_of(robot: HybridRobot, block: Postures, tau: Array, column: str) -> Array:
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
    kinds = ("revolute", "prismatic") if quantity == "position" else ("revolute", "prismatic", "continuous")
    if robot.kinds[joint] not in kinds:
        raise TrajectoryError(f"joint '{owner}' is {robot.kinds[joint]}, and has no single {quantity}")
    rows, places = quantities[quantity]
    return rows[:, places[joint].start]


def _of_link(robot: HybridRobot, block: Postures, link: str, quantity: str, component: str) -> Array:
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

Loads = list[MotorLoad]


def _largest(of: Callable[[MotorLoad], float]) -> Callable[[Loads], float]:
    return lambda loads: max((abs(of(load)) for load in loads), default=math.nan)


def _margin(of: Callable[[MotorLoad], float]) -> Callable[[Loads], float]:
    return lambda loads: min((of(load) for load in loads), default=math.nan)


def _sum(of: Callable[[MotorLoad], float | None]) -> Callable[[Loads], float]:
    def total(loads: Loads) -> float:
        """Add a number over the motors; NaN where one has none."""
        parts = [of(load) for load in loads]
        return math.nan if None in parts else float(sum(part for part in parts if part is not None))

    return total


def _below(peak: float, limit: float) -> float:
    """Return the part of a limit that is left, inf without a limit."""
    return 1.0 - abs(peak) / limit if limit < math.inf else math.inf


def _stroke(load: MotorLoad) -> float:
    """Return the smallest distance to a position limit, as a part of the stroke; inf without a stroke."""
    stroke = load.upper_limit - load.lower_limit
    if load.travel is None or not 0 < stroke < math.inf:
        return math.inf
    return min(load.travel[0] - load.lower_limit, load.upper_limit - load.travel[1]) / stroke


#: Measures of a trajectory; margins are those of the motor that has the least.
OF_MOTORS: dict[str, Callable[[Loads], float]] = {
    "peak_effort": _largest(lambda load: load.effort.value),
    "rms_effort": _largest(lambda load: load.rms_effort),
    "peak_speed": _largest(lambda load: load.speed.value),
    "rms_speed": _largest(lambda load: load.rms_speed),
    "peak_power": _largest(lambda load: load.power.value),
    "braking_power": _largest(lambda load: load.braking_power.value),
    "mean_power": _sum(lambda load: load.mean_power),
    "energy": _sum(lambda load: load.energy_given),
    "effort_margin": _margin(lambda load: _below(load.effort.value, load.effort_limit)),
    "speed_margin": _margin(lambda load: _below(load.speed.value, load.speed_limit)),
    "stroke_margin": _margin(_stroke),
}

#: Measures whose unit is that of the motor, with the units of slides and of joints that turn.
OF_KIND = {
    f"{what}_{of}": units
    for of, units in ((of, UNITS[of]) for of in ("effort", "speed"))
    for what in ("peak", "rms")
}


def _of_slides(word: str, linear: bool) -> Callable[[Loads], float]:
    """Return a measure of the motors that are slides, or of the others."""
    return lambda loads: OF_MOTORS[word]([load for load in loads if load.linear == linear])


OF_MOTORS |= {
    f"{word}[{unit}]": _of_slides(word, linear)
    for word, units in OF_KIND.items()
    for unit, linear in zip(units, (True, False), strict=True)
}

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
    statistic, _, column = word.partition(" ")
    statistics = {"trajectory": [*STATISTICS], "scene": [*STATISTICS, EVENT], "workspace": []}[kind]
    of_column = statistic in statistics and column
    if word in known and (named or "[" not in word):
        return
    if word not in known and PYTHON not in word and not of_column:
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
    name, _, unit = word.partition("[")
    if name in OF_KIND:
        of_motors = {OF_KIND[name][kinds[motor] != "prismatic"] for motor in description.motors}
        return unit.removesuffix("]") or " or ".join(sorted(of_motors))
    column = word.partition(" ")[2]
    owner, _, quantity = column.rpartition("/")
    turns = kinds.get(owner) != "prismatic"
    if owner not in kinds:
        turns, quantity = quantity.startswith("w"), owner.rpartition("/")[2]
    return OF_COLUMN[quantity][turns] if quantity in OF_COLUMN else OF_ROBOT.get(word, "")


def check_units(robot: HybridRobot, words: Iterable[str]) -> None:
    """Check that a largest effort or speed is one of motors with the same unit.

    Raises:
        ModelError: The motors have different units, or none has the unit of a measure.
    """
    slides = {unit == "N" for unit in robot.effort_units}
    for word in words:
        name, _, unit = word.partition("[")
        if name in OF_KIND and not unit and len(slides) > 1:
            of_slides, others = (f"'{name}[{unit}]'" for unit in OF_KIND[name])
            raise ModelError(
                f"measure '{word}': the motors are slides and joints that turn, whose {name} do not compare; "
                f"write {of_slides}, {others} or 'peak MOTOR/effort'",
                element=word,
            )
        if name in OF_KIND and unit and (unit == f"{OF_KIND[name][0]}]") not in slides:
            raise ModelError(f"measure '{word}': no motor has this unit", element=word)


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


@dataclass(eq=False)
class Gauge:
    """Collects what the measures of a trajectory need, block by block.

    Attributes:
        wanted: The measures by name.
        functions: The functions in Python by measure.
    """

    robot: HybridRobot
    wanted: Mapping[str, str]
    functions: Mapping[str, Callable[..., Any]]
    _sizing: Sizing | None = field(init=False)
    _columns: dict[str, list[Array]] = field(init=False)
    _times: list[Array] = field(default_factory=list)
    _blocks: list[tuple[Postures, Array]] = field(default_factory=list)

    def __post_init__(self) -> None:
        check_units(self.robot, self.wanted.values())
        of_motors = any(word in OF_MOTORS for word in self.wanted.values())
        self._sizing = Sizing(self.robot) if of_motors else None
        columns = [word for word in self.wanted.values() if PYTHON not in word and word not in OF_MOTORS]
        asked = [word.partition(" ")[2] for word in columns]
        self._columns = {column: [] for column in asked if column}

    def add(self, block: Postures, tau: Array) -> None:
        """Add the postures of a block and their efforts, shape (T, motors)."""
        motion = block.motion
        if self._sizing is not None:
            position, speed = motor_rows(self.robot, block.q, block.v)
            self._sizing.add(motion.time, motion.first_row, position, speed, tau)
        for column, parts in self._columns.items():
            parts.append(column_of(self.robot, block, tau, column))
        if motion.time is not None:
            self._times.append(motion.time)
        if any(PYTHON in word for word in self.wanted.values()):
            self._blocks.append((block, tau))

    def values(self) -> dict[str, float]:
        """Compute the measures.

        Raises:
            ModelError: A function in Python fails.
        """
        loads = [] if self._sizing is None else self._sizing.loads()
        time = np.concatenate(self._times) if self._times else None
        out: dict[str, float] = {}
        for name, word in self.wanted.items():
            if word in OF_MOTORS:
                out[name] = OF_MOTORS[word](loads)
            elif PYTHON not in word:
                statistic, _, column = word.partition(" ")
                out[name] = STATISTICS[statistic](np.concatenate(self._columns[column]), time)
        if self._blocks:
            motion = self._whole(time, out)
            out |= {name: call(self.functions, word, self.robot, motion) for name, word in self._python()}
        return {name: out[name] for name in self.wanted}

    def _python(self) -> list[tuple[str, str]]:
        return [(name, word) for name, word in self.wanted.items() if PYTHON in word]

    def _whole(self, time: Array | None, measures: Mapping[str, float]) -> Followed:
        _, q, v, a = Postures.joined([block for block, _ in self._blocks])
        return Followed(time, q, v, a, np.concatenate([tau for _, tau in self._blocks]), dict(measures))


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
    motion: Motion,
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
    of_motors = {name: word for name, word in wanted.items() if word in OF_MOTORS}
    others = {name: word for name, word in wanted.items() if word not in OF_MOTORS}
    out: list[dict[str, float] | None] = [{} for _ in chosen]
    if of_motors:
        out = [*_loads(robot, descriptions, of_motors, motion, table, chosen)]
    for i, k in enumerate(chosen.tolist() if others else ()):
        gauge = Gauge(replace(robot, description=descriptions[i]), others, {})
        try:
            gauge.add(Postures(motion, table.q[k], table.v[k], table.a[k]), table.tau[k])
            out[i] = {**(out[i] or {}), **gauge.values()}
        except Exception:  # the general path says what is wrong
            out[i] = None
    return out


def _loads(
    robot: HybridRobot,
    descriptions: Sequence[Description],
    words: Mapping[str, str],
    motion: Motion,
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
    return [{name: OF_MOTORS[word](each) for name, word in words.items()} for each in own]


def _aside(x: Array) -> Array:
    """Return rows of designs, shape (designs, T, motors), side by side, shape (T, designs x motors)."""
    return x.swapaxes(0, 1).reshape(x.shape[1], -1)
