"""Designs of a sweep that are closed and computed by compiled models, many at once.

One compiled model per trajectory serves all designs of a study: the numbers of the description that differ
between designs are its arguments. The general path computes designs of which the compiled models are not
certain, and finds what is wrong with those that cannot make the motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...compiled.compiling import compile
from ...compiled.programs.designs import DesignsInSlots
from ...compiled.programs.evaluating import DesignEvaluator, DesignTable
from ...description.records import Description
from ...effects import choose
from ...errors import HybridynError, ModelError
from ...spatial import Array
from ...streams.postures import Postures
from ...structure.parameters.slots import Slot, differences, values_of
from ...tables.trajectory import Motion
from .evaluation import Chunk, Designer, Row
from .following import Follower, follow
from .measures import OF_MOTORS, Gauge
from .study_file import PYTHON, StudyFile
from .study_tables import TaskTable

#: Numbers of the motions that are computed at once; bounds the memory of a process.
AT_ONCE = 5_000_000
#: Most designs that are computed at once; bounds the memory of their descriptions.
MOST_AT_ONCE = 512
#: Parts into which the steps between rows are divided for designs that turn far between two rows.
STEPS = 4
#: Designs per run that are compared with robots built for them.
CHECKED = 4
#: Largest difference of a motion or its efforts to those of a robot built for the design, over the largest
#: number of the same kind.
EQUAL = 1e-11


@dataclass(frozen=True)
class Plan:
    """What the processes of one run need for the same compiled models.

    Attributes:
        run: Identity of the run.
        base: Values of the parameters of the design whose robot is compiled, shape (parameters,).
        slots: The numbers of the robot's description that differ between designs.
    """

    run: str
    base: Array
    slots: tuple[Slot, ...]


class _Task(NamedTuple):
    """A trajectory with its compiled model."""

    name: str
    stated: TaskTable
    motion: Motion
    evaluator: DesignEvaluator


class CompiledDesigns:
    """Evaluates designs of a study by compiled models, which are built when an instance is made."""

    def __init__(self, source: StudyFile, plan: Plan) -> None:
        """Build the models, or load them from the cache.

        Args:
            source: The study.
            plan: What is compiled.

        Raises:
            HybridynError: The study or its robot has no compiled models.
        """
        self.source, self.designer = source, Designer(source)
        variants = self.designer.variants
        self.robot = variants.robot(variants.description(self._named(plan.base)))
        self.slots, self._known = plan.slots, set(plan.slots)
        if self.robot.base != "fixed":
            raise ModelError(f"the base is {self.robot.base}")
        self._masses = np.array([slot.field == "mass" for slot in self.slots], dtype=bool)
        self.tasks = [self._task(name, task) for name, task in source.study.tasks.items()]
        robot = self.robot
        width = robot.nq + 2 * robot.nv + len(robot.motors) + len(self._known)
        longest = max(task.motion.size for task in self.tasks)
        self._at_once = min(max(1, AT_ONCE // (width * longest)), MOST_AT_ONCE)

    def _named(self, values: Array) -> dict[str, float]:
        """Return the values of the parameters by name."""
        return dict(zip(self.source.study.parameters, values.tolist(), strict=True))

    def _task(self, name: str, task: TaskTable) -> _Task:
        """Compile the model of a task.

        Raises:
            HybridynError: There is none.
        """
        check_task(name, task)
        blocks = [*self.designer.tracks[name].motions(self.robot)]
        layout, motion = blocks[0]
        if len(blocks) > 1 or layout.full_state or motion.time is None or motion.wrenches:
            raise ModelError(
                f"task '{name}': its table is longer than a block, or has no times, every joint, or wrenches"
            )
        chosen = choose(self.robot, task.effects)
        chosen = chosen.only([effect for effect in chosen.names if effect != "limits"])
        compiled = compile(self.robot, chosen, parameters=self.slots)
        designs = DesignsInSlots(self.robot, compiled.parameters)
        evaluator = DesignEvaluator(designs, compiled.effects, compiled.library.programs["idm"])
        return _Task(name, task, motion, evaluator)

    def rows(self, chunk: Chunk) -> tuple[tuple[Row, ...], int]:
        """Evaluate the designs of a chunk.

        Returns:
            The rows, and the number of those from compiled models.
        """
        rows: list[Row] = []
        compiled = 0
        for start in range(0, len(chunk.values), self._at_once):
            values = chunk.values[start : start + self._at_once]
            measured = self._measured(values)
            compiled += sum(one is not None for one in measured)
            for one, own in zip(measured, values, strict=True):
                i = chunk.start + len(rows)
                row = None if one is None else Row(i, tuple(own.tolist()), "ok", 0, 0, one, "")
                rows.append(row or self.designer(i, own))
        return tuple(rows), compiled

    def _measured(self, values: Array) -> list[tuple[float, ...] | None]:
        """Measure designs; None for those that are left to the general path."""
        out: list[tuple[float, ...] | None] = [None] * len(values)
        descriptions, p = self._described(values)
        places = sorted(descriptions)
        if not places:
            return out
        tables = self.tables(p)
        good = np.logical_and.reduce([table.good for table in tables])
        for k in np.flatnonzero(good).tolist():
            out[places[k]] = self._measures(descriptions[places[k]], tables, k)
        return out

    def _described(self, values: Array) -> tuple[dict[int, Description], Array]:
        """Return the descriptions of the designs that differ in the models' arguments only, and these."""
        found: dict[int, Description] = {}
        numbers = [np.zeros((0, len(self.slots)))]
        for i, own in enumerate(values):
            try:
                description = self.designer.variants.description(self._named(own))
                others = set(differences(self.robot.description, description)) - self._known
            except Exception:  # the general path says what is wrong
                continue
            p = np.array(values_of(description, self.slots))
            possible = np.isfinite(p).all() and (p[self._masses] >= 0).all()
            if possible and not others and _home(description) == _home(self.robot.description):
                found[i] = description
                numbers.append(p[None])
        return found, np.concatenate(numbers)

    def tables(self, p: Array) -> list[DesignTable]:
        """Compute the motions and efforts of designs for each task.

        Args:
            p: Numbers in the slots of each design, shape (designs, slots).
        """
        return [_table(task, p) for task in self.tasks]

    def _measures(
        self, description: Description, tables: Sequence[DesignTable], k: int
    ) -> tuple[float, ...] | None:
        """Return the measures of design k, whose limits are those of its description; None on an error."""
        robot = replace(self.robot, description=description)
        found: dict[str, float] = {}
        try:
            for task, table in zip(self.tasks, tables, strict=True):
                gauge = Gauge(robot, task.stated.wanted, {})
                gauge.add(Postures(task.motion, table.q[k], table.v[k], table.a[k]), table.tau[k])
                found |= {self.source.column(task.name, key): x for key, x in gauge.values().items()}
        except Exception:
            return None
        return tuple(found.get(column, math.nan) for column in self.source.columns)

    def check(self, designs: Iterable[tuple[int, Array]]) -> int:
        """Compare the motions and efforts of a few designs with those of robots built for them.

        Args:
            designs: Numbers and values of designs; those that are left to the general path are skipped.

        Returns:
            The number of designs compared, at most `CHECKED`.

        Raises:
            HybridynError: They differ by more than `EQUAL`.
        """
        checked = 0
        for number, values in designs:
            descriptions, p = self._described(values[None])
            tables = self.tables(p) if descriptions and checked < CHECKED else []
            if not tables or not all(table.good.all() for table in tables):
                continue
            for task, table in zip(self.tasks, tables, strict=True):
                off = self._difference(descriptions[0], task, table)
                if not off <= EQUAL:
                    raise HybridynError(
                        f"{self.source.file}: design {number}, task '{task.name}': compiled models and the "
                        f"general path differ by {off:.1e} of the largest number: sweep without compiled "
                        "models (--no-compile)"
                    )
            checked += 1
        return checked

    def _difference(self, description: Description, task: _Task, table: DesignTable) -> float:
        """Return the largest relative difference of a table with one design to a robot built for it."""
        robot = self.designer.variants.robot(description)
        found: list[tuple[Array, ...]] = []
        how = Follower(task.stated.passive, choose(robot, task.evaluator.effects.names))
        follow(robot, self.designer.tracks[task.name], how, lambda at, tau: found.append((*at[1:], tau)))
        if not found:
            return math.inf
        pairs = zip((x[0] for x in _numbers(table)), found[0], strict=True)
        return max(float(np.abs(x - y).max(initial=0) / np.abs(y).max(initial=1e-300)) for x, y in pairs)


def _table(task: _Task, p: Array) -> DesignTable:
    """Compute the motions and efforts of designs for a task; steps that are too long are divided."""
    motion, evaluator = task.motion, task.evaluator
    table = evaluator.table(p, motion.joints, motion.platforms, doubtful=False)
    left = np.array(sorted(table.errors), dtype=int)
    if len(left) and not motion.platforms:
        joints = {name: _divided(levels) for name, levels in motion.joints.items()}
        finer = evaluator.table(p[left], joints, {}, doubtful=False)
        good = finer.good
        for all_rows, rows in zip(_numbers(table), _numbers(finer), strict=True):
            all_rows[left[good]] = rows[good, ::STEPS]
        for design in left[good].tolist():
            del table.errors[design]
    return table


def _divided(levels: Sequence[Array]) -> tuple[Array, ...]:
    """Return position, rate and acceleration with rows at rest between those of a table."""
    rows = len(levels[0])
    position, *rates = (np.zeros((STEPS * (rows - 1) + 1, *level.shape[1:])) for level in levels)
    for part in range(STEPS):
        way = part / STEPS
        position[part::STEPS][: rows - 1] = (1 - way) * levels[0][:-1] + way * levels[0][1:]
    for level, given in zip((position, *rates), levels, strict=True):
        level[::STEPS] = given
    return position, *rates


def _numbers(table: DesignTable) -> tuple[Array, ...]:
    """Return the motion and the efforts of a table."""
    return table.q, table.v, table.a, table.tau


def _home(description: Description) -> tuple[object, ...]:
    """Return the home posture of a description."""
    return description.home, description.base_home


def check_task(name: str, task: TaskTable) -> None:
    """Check that a task can be computed by compiled models.

    Raises:
        ModelError: It cannot.
    """
    if task.trajectory is None or task.passive != "given":
        raise ModelError(f"task '{name}' is a {task.kind}, or has passive = 'solved'")
    for word in task.wanted.values():
        if PYTHON in word or (word not in OF_MOTORS and word.count("/") > 1):
            raise ModelError(f"task '{name}': '{word}' needs the robot of each design")
