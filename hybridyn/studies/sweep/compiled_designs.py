"""Designs of a sweep that are closed and computed by compiled models, many at once.

One compiled model per trajectory serves all designs of one structure: the numbers of the description that
differ between them are its arguments. The general path computes designs of which the compiled models are not
certain, and finds what is wrong with those that cannot make the motion.
"""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...assembly.requests import gather_requests
from ...compiled import DesignEvaluator, DesignTable, design_evaluator
from ...dynamics.state_checks import largest_rates, natural_force
from ...effects import choose
from ...errors import HybridynError, ModelError
from ...spatial import Array, Index
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ...tables.trajectory import TableMotion
from .added_measures import is_function
from .evaluation import Designer, effects_of, ends_of
from .following import follow
from .many_designs import measures_of
from .measures import OF_MOTORS
from .slot_numbers import SlotNumbers, Slotted
from .study_file import TaskTable

#: Numbers of the motions that are computed at once; bounds the memory of a process.
AT_ONCE = 10_000_000
#: Most designs that are computed at once; bounds the memory of their descriptions.
MOST_AT_ONCE = 4096
#: Largest difference of a motion or its efforts to those of a robot built for the design, over the largest
#: number of the same kind or its natural size.
EQUAL = 1e-11
#: Designs times rows of their tables from which compiling a study pays: the general path closes so many rows
#: in some ten seconds, and building what closes a six-legged robot takes as long.
WORTH_COMPILING = 3_000


class Structure(NamedTuple):
    """What compiled models of one structure are built from.

    Attributes:
        base: Values of the parameters of the design whose robot is compiled, shape (parameters,).
        slots: The numbers of the robot's description that differ between designs of the structure.
    """

    base: Array
    slots: tuple[Slot, ...]


@dataclass(frozen=True)
class DesignPlan:
    """What the processes of one run need for the same compiled models.

    Attributes:
        run: Identity of the run.
        structures: The structures that have compiled models, in the order in which they are tried.
        designs: Number of designs of the study.
        check: Number of those that are compared with robots built for them.
    """

    run: str
    structures: tuple[Structure, ...]
    designs: int
    check: int

    def checks(self, start: int, stop: int) -> list[int]:
        """Return the designs to compare from `start` to before `stop`, spread evenly over the study."""
        first, last = (-(-number * self.check // self.designs) for number in (start, stop))
        return [k * self.designs // self.check for k in range(first, last)]


class _Task(NamedTuple):
    """A trajectory with its compiled model."""

    name: str
    stated: TaskTable
    motion: TableMotion
    models: DesignEvaluator

    @property
    def in_cache(self) -> bool:
        """Whether the libraries of the models are in the cache."""
        given = self.models.designs.robot, self.motion.joints, self.motion.platforms
        return self.models.in_cache(gather_requests(*given, redundancy=self.stated.redundancy))


class CompiledDesigns:
    """Evaluates designs of one structure by compiled models, which are built or loaded at the first use."""

    def __init__(self, designer: Designer, structure: Structure, designs: int) -> None:
        """Prepare the models.

        Args:
            designer: Evaluates the other designs.
            structure: The structure.
            designs: Number of designs of the study.

        Raises:
            HybridynError: The study or its robot has no compiled models.
        """
        self.source, self.designer, self.structure = designer.source, designer, structure
        self.count = designs
        variants = designer.variants
        self.robot = variants.robot(variants.description(variants.named(structure.base)))
        if self.robot.base != "fixed":
            raise ModelError(f"the base is {self.robot.base}")
        ends = ends_of(self.robot, self.source.study.tasks.values())
        self.numbers = SlotNumbers(variants, self.robot, structure.slots, ends)
        self.tasks = [self._task(name, task) for name, task in self.source.study.tasks.items()]
        robot = self.robot
        width = robot.nq + 2 * robot.nv + len(robot.motors) + len(structure.slots)
        longest = max(task.motion.size for task in self.tasks)
        #: Number of designs that are computed at once.
        self.at_once = min(max(1, AT_ONCE // (width * longest)), MOST_AT_ONCE)

    def _task(self, name: str, task: TaskTable) -> _Task:
        check_task(name, task)
        layout, blocks = self.designer.tracks[name].motions(self.robot)
        motion = blocks[0]
        if len(blocks) > 1 or layout.full_state or motion.time is None or motion.wrenches:
            raise ModelError(
                f"task '{name}': its table is longer than a block, or has no times, every joint, or wrenches"
            )
        chosen = effects_of(self.robot, task)
        return _Task(name, task, motion, design_evaluator(self.robot, chosen, self.structure.slots))

    @property
    def pays(self) -> bool:
        """Whether the models take less time than the general path, or are in the cache."""
        rows = self.count * sum(task.motion.size for task in self.tasks)
        return rows >= WORTH_COMPILING or all(task.in_cache for task in self.tasks)

    def measured(
        self, numbers: Index, values: Array, wanted: Container[int]
    ) -> tuple[list[tuple[float, ...] | None], list[float]]:
        """Measure designs; None for those of another structure or of which the models are not certain.

        Args:
            numbers: Numbers of the designs in the study, shape (designs,).
            values: Values of the parameters, shape (designs, parameters).
            wanted: Numbers of designs to compare with robots built for them.

        Returns:
            The measures, and the largest difference of each design that was compared.

        Raises:
            HybridynError: A design differs by more than `EQUAL`.
        """
        out: list[tuple[float, ...] | None] = [None] * len(values)
        slotted = self.numbers(values)
        if not slotted.possible.any():
            return out, []
        tables = self.tables(slotted.p)
        good = _certain(tables)
        places = np.flatnonzero(slotted.possible)[good].tolist()
        for place, one in zip(places, self._measures(slotted, tables, good), strict=True):
            out[place] = one
        seen = [
            self._compared(int(numbers[place]), values[place], tables, k)
            for k, place in zip(good.tolist(), places, strict=True)
            if int(numbers[place]) in wanted and out[place] is not None
        ]
        return out, seen

    def certain_of_any(self, values: Array) -> bool:
        """Return whether the models are certain of any of these designs, shape (designs, parameters)."""
        slotted = self.numbers(values)
        return bool(slotted.possible.any() and len(_certain(self.tables(slotted.p))))

    def tables(self, p: Array) -> list[DesignTable]:
        """Compute the motions and efforts of designs for each task.

        Args:
            p: Numbers in the slots of each design, shape (designs, slots).
        """
        return [
            task.models.table(
                p, task.motion.joints, task.motion.platforms, task.stated.redundancy, doubtful=False
            )
            for task in self.tasks
        ]

    def _measures(
        self, slotted: Slotted, tables: Sequence[DesignTable], chosen: Index
    ) -> list[tuple[float, ...] | None]:
        """Return the measures of chosen designs, whose limits are those of their descriptions."""
        descriptions = [slotted.descriptions[k] for k in chosen.tolist()]
        found: list[dict[str, float] | None] = [{} for _ in descriptions]
        for task, table in zip(self.tasks, tables, strict=True):
            own = measures_of(self.robot, descriptions, task.stated.wanted, task.motion, table, chosen)
            for i, one in enumerate(own):
                before = found[i]
                named = {self.source.column(task.name, key): x for key, x in (one or {}).items()}
                found[i] = None if one is None or before is None else before | named
        columns = self.source.columns
        return [None if x is None else tuple(x.get(name, math.nan) for name in columns) for x in found]

    def _compared(self, number: int, values: Array, tables: Sequence[DesignTable], k: int) -> float:
        """Return the largest relative difference, at most `EQUAL`, of design k to the robot built for it."""
        variants, largest = self.designer.variants, 0.0
        robot = variants(variants.named(values))
        for task, table in zip(self.tasks, tables, strict=True):
            off = self._from_built(robot, task, [x[k] for x in _numbers(table)])
            if not off <= EQUAL:
                raise HybridynError(
                    f"{self.source.file}: design {number}, task '{task.name}': compiled models and the "
                    f"general path differ by {off:.1e} of the largest number: sweep without compiled "
                    "models (--engine general)"
                )
            largest = max(largest, off)
        return largest

    def _from_built(self, robot: HybridRobot, task: _Task, ours: Sequence[Array]) -> float:
        """Return the largest relative difference of a motion and its efforts to those of a robot."""
        effects, stated = choose(robot, task.models.designs.effects.names), task.stated
        try:
            ((at, tau),) = follow(
                robot, self.designer.tracks[task.name], stated.passive, effects, stated.redundancy
            )
        except HybridynError:
            return math.inf
        return _difference(robot, ours, (*at[1:], tau))


def _difference(robot: HybridRobot, ours: Sequence[Array], theirs: Sequence[Array]) -> float:
    """Return the largest difference of q, v, a and efforts, relative to the largest number of each kind.

    Where all numbers of a kind are rounding, as the efforts of a flat robot at rest, the reference is their
    natural size: that of the coordinates' units, of accelerations at these rates, of the robot's weight.
    """
    _, v, a, _ = theirs
    smallest, speed = float(robot.unit.min()), float(largest_rates(robot, v, v)[0].max())
    effort = float(natural_force(robot, v, a).max()) / float(robot.unit.max())
    natural = [max(size, 1e-300) for size in (smallest, 0.0, smallest * speed**2, effort)]
    kinds = zip(ours, theirs, natural, strict=True)
    off = [float(np.abs(x - y).max(initial=0)) / float(np.abs(y).max(initial=size)) for x, y, size in kinds]
    return float(np.max(off))  # nan, if one is


def _certain(tables: Sequence[DesignTable]) -> Index:
    """Return the places of designs whose motions and efforts are certain in each table."""
    return np.flatnonzero(np.logical_and.reduce([table.good for table in tables]))


def _numbers(table: DesignTable) -> tuple[Array, ...]:
    """Return the motion and the efforts of a table."""
    return table.q, table.v, table.a, table.tau


def check_task(name: str, task: TaskTable) -> None:
    """Check that a task can be computed by compiled models.

    Raises:
        ModelError: It cannot.
    """
    if task.trajectory is None or task.passive != "given":
        raise ModelError(f"task '{name}' is a {task.kind}, or has passive = 'solved'")
    for word in task.wanted.values():
        if is_function(word) or (word not in OF_MOTORS and word.count("/") > 1):
            raise ModelError(f"task '{name}': '{word}' needs the robot of each design")
