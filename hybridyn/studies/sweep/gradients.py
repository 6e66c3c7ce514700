"""Measures of a design with their gradients over the parameters of a study, for an optimiser of one's own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...assembly.requests import gather_requests
from ...compiled import needs_casadi
from ...description.records import Description
from ...errors import HybridynError, ModelError
from ...gradients.design_gradients import DesignGradients
from ...gradients.gradient import MeasureGradients
from ...gradients.kept import Kept, kept_by_requests
from ...gradients.slot_changes import changes_of
from ...spatial import Array
from ...streams.postures import TreeSamples
from ...structure.parameters.ends import check_ends
from ...structure.parameters.entries import Numbers
from ...structure.parameters.shares import check_shares
from ...structure.parameters.slots import Slot, differences, values_of
from ...structure.robot import HybridRobot
from ...tables.layout import Layout
from ...tables.trajectory import TableMotion
from .evaluation import Designer, DesignRow, Motions, effects_of, ends_of, said, status_of
from .measure_bars import limits_of, slopes_of
from .study_file import MARGINS, StudyFile, TaskTable

#: Largest difference of efforts of the gradients' model to those of the general path, of the largest effort.
SAME_EFFORTS = 1e-8


#: Why tasks have no gradients, by their kinds.
NONE = {
    "workspace": "measures of a workspace jump where poses of its lattice come and go",
    "scene": "the motion of a scene is simulated, and jumps where its events move",
}


class DesignGradient(NamedTuple):
    """A design with the gradients of its measures.

    Attributes:
        row: Its status, its measures and the first error, as a sweep writes them.
        gradient: Derivatives of the measures over the study's parameters, shape (measures, parameters); NaN
            where a measure is.
        closing: Smallest singular value of the loops' rows along all trajectories, without units: where it is
            zero, the assembly ceases to exist. NaN unless the status is "ok".
        closing_gradient: Its derivative, shape (parameters,).
        conditioning: Least part that the smallest singular value is of the largest, likewise; one is best.
        conditioning_gradient: Its derivative, shape (parameters,).
    """

    row: DesignRow
    gradient: Array
    closing: float
    closing_gradient: Array
    conditioning: float
    conditioning_gradient: Array


class _Models(NamedTuple):
    """The models of designs that differ in slots alone from a robot, by task."""

    robot: HybridRobot
    slots: tuple[Slot, ...]
    of_tasks: dict[str, DesignGradients]


class StudyGradients:
    """Evaluates single designs of a study with the gradients of their measures.

    Measures are those of trajectories: of motors, and of columns of joints, motors and links. A peak has the
    gradient of its own sample. The models are those of the first design that loads; designs of another
    structure have their own.

    Attributes:
        source: The study.
        base: Values of the design whose models are kept, or None.
    """

    def __init__(self, source: StudyFile) -> None:
        """Prepare the evaluation.

        Raises:
            ModelError: A task is a workspace or a scene.
            CompileError: CasADi is not installed.
        """
        needs_casadi()
        self.source, self._designer = source, Designer(source)
        self.base: Array | None = None
        self._kept: _Models | None = None
        for name in MARGINS:
            if name in (*source.columns, *source.study.parameters):
                raise ModelError(f"'{name}' is a column of gradients: choose another name", file=source.file)
        for name, task in source.study.tasks.items():
            if task.trajectory is None:
                raise ModelError(
                    f"{source.file}: task '{name}' has a {task.kind}: there are gradients of trajectories "
                    f"only: {NONE[task.kind]}", element=name,
                )  # fmt: skip

    def __call__(self, values: Array, design: int = 0) -> DesignGradient:
        """Evaluate a design.

        Args:
            values: Values of the study's parameters, shape (parameters,).
            design: Its number, for the row.

        Raises:
            ModelError: A measure has no gradient, or a parameter opens loops.
        """
        found, error = self._evaluated(np.asarray(values, dtype=float), design)
        if isinstance(error, ModelError):
            raise error
        return found

    def row(self, design: int, values: Array) -> DesignRow:
        """Evaluate a design, and return its row with the gradients; what has none makes it a failed one."""
        found, _ = self._evaluated(values, design)
        gradients = [*found.gradient.ravel(), found.closing, *found.closing_gradient]
        gradients += [found.conditioning, *found.conditioning_gradient]
        return replace(found.row, gradients=tuple(map(float, gradients)))

    def prepare(self, base: Array) -> None:
        """Keep the models of a design, which loads.

        Raises:
            HybridynError: It does not load.
        """
        robot = self._designer.variants(self._designer.variants.named(base))
        self._models(robot, base)

    def _evaluated(self, values: Array, design: int) -> tuple[DesignGradient, HybridynError | None]:
        """Return a design with its gradients, and why it has none."""
        row, robot, motions = self._designer.evaluated(design, values)
        gradient = np.full((len(self.source.columns), len(values)), math.nan)
        nothing = DesignGradient(row, gradient, math.nan, gradient[0], math.nan, gradient[0])
        if robot is None or (row.status != "ok" and self._kept is not None):
            return nothing, None
        try:
            models = self._models(robot, values)
            return (nothing if row.status != "ok" else self._along(row, robot, motions, models)), None
        except HybridynError as error:  # near singular postures, or of a model
            return nothing._replace(row=replace(row, status=status_of(error), message=said(error))), error

    def _along(
        self,
        row: DesignRow,
        robot: HybridRobot,
        motions: Mapping[str, Motions],
        models: tuple[_Models, Array, Array],
    ) -> DesignGradient:
        """Return a design with its gradients, from its motions by task."""
        values, names = row.values, self.source.columns
        gradient = np.full((len(names), len(values)), math.nan)
        closing, part = ((math.inf, np.zeros(len(values))) for _ in MARGINS)
        for name, task in self.source.study.tasks.items():
            found = self._task(robot, models, (name, task), motions[name])
            gradient[[names.index(self.source.column(name, key)) for key in task.wanted]] = found.over
            if found.closing < closing[0]:
                closing = found.closing, found.closing_over
            if found.conditioning < part[0]:
                part = found.conditioning, found.conditioning_over
        gradient[np.isnan(np.array(row.measures, dtype=float))] = math.nan
        return DesignGradient(row, gradient, *closing, *part)

    def _models(self, robot: HybridRobot, values: Array) -> tuple[_Models, Array, Array]:
        """Return the models of a structure, the numbers in its slots, and derivatives over values.

        These are of the numbers in slots, then of the motors' limits.
        """
        variants, known, base = self._designer.variants, self._kept, robot.description
        ends = ends_of(robot, self.source.study.tasks.values())
        same = known if known is not None and _same(known, base, ends) else None
        differ = {*same.slots} if same is not None else set[Slot]()
        slots = None

        def numbers(rows: Array) -> Numbers:
            """Return the numbers in slots, then limits of motors; find further slots that differ."""
            width = len(slots or ()) + 4 * len(robot.motors)
            out, errors = np.full((len(rows), width), math.nan), dict[int, ModelError]()
            for i, row in enumerate(rows):
                try:
                    described = variants.description(variants.named(row))
                    differ.update(differences(base, described))
                    check_shares(robot, described)
                    check_ends(robot, described, ends)
                except ModelError as error:
                    errors[i] = error
                else:
                    joints = {one.name: one for one in described.joints}
                    limits = limits_of(joints[name] for name in robot.motors)
                    out[i] = [*values_of(described, slots or ()), *limits.ravel()]
            return out, errors

        while slots is None or {*slots} != differ:
            slots = tuple(sorted(differ))
            along = changes_of(numbers, values, self._ranges)
        models = same if same is not None and slots == same.slots else _Models(robot, slots, {})
        if known is None:
            self._kept, self.base = models, values
        return models, np.array(values_of(base, slots)), along

    @cached_property
    def _ranges(self) -> Array:
        """The bounds of the study's parameters, infinite where there are none, shape (parameters, 2)."""
        stated = self.source.study.parameters.values()
        return np.array([one.range or (-math.inf, math.inf) for one in stated])

    def _task(
        self,
        robot: HybridRobot,
        models: tuple[_Models, Array, Array],
        named: tuple[str, TaskTable],
        blocks: Motions,
    ) -> MeasureGradients:
        """Return the gradients of a task's measures, and of the singular value of its loops."""
        (name, task), (kept, p, along) = named, models
        layout, motions = self._designer.tracks[name].motions(robot)
        whole, tau = TreeSamples.joined([x for x, _ in blocks]), np.concatenate([x for _, x in blocks])
        slopes = [slopes_of(robot, word, whole, tau) for word in task.wanted.values()]
        if name not in kept.of_tasks:
            kept.of_tasks[name] = DesignGradients(
                kept.robot, kept.slots, keep=_stays(kept.robot, layout, motions[0], task),
                effects=effects_of(kept.robot, task), wrenches=(*motions[0].wrenches,),
            )  # fmt: skip
        found = kept.of_tasks[name].of_measures(
            (whole.q, whole.v, whole.a), p, along[: len(p)], [one.bars for one in slopes],
            whole.motion.wrenches, task.passive,
        )  # fmt: skip
        self._check(name, found, tau)
        limits = np.array([one.limits.ravel() for one in slopes]) @ along[len(p) :]
        return found._replace(over=found.over + limits)

    def _check(self, name: str, found: MeasureGradients, tau: Array) -> None:
        """Check the gradients of a task.

        Raises:
            ModelError: Their model has other efforts than tau, or a parameter opens loops.
        """
        off = float(np.abs(found.efforts - tau).max(initial=0.0))
        if off > SAME_EFFORTS * max(float(np.abs(tau).max(initial=0.0)), 1.0):
            raise ModelError(
                f"{self.source.file}: task '{name}': efforts of the gradients' model differ from those "
                f"of the general path by {off:.1e}: an effect follows something else than the motion",
                element=name,
            )
        for row, parameter in zip(found.over.T, self.source.study.parameters, strict=True):
            if np.isnan(row).any():
                raise ModelError(
                    f"{self.source.file}: parameter '{parameter}' opens loops: no design near this one can "
                    "be assembled; let other numbers follow it",
                    element=parameter,
                )


def _stays(robot: HybridRobot, layout: Layout, motion: TableMotion, task: TaskTable) -> Kept:
    """Return what a table prescribes: all joints, or those and poses from which loops are closed."""
    if layout.full_state:
        return Kept(np.arange(robot.nv), ())
    requests = gather_requests(robot, motion.joints, motion.platforms, redundancy=task.redundancy)
    return kept_by_requests(robot, requests)


def _same(known: _Models, base: Description, ends: Sequence[tuple[str, str]]) -> bool:
    """Return whether a design has a structure, and differs from it in slots alone, not in `ends` of stops."""
    try:
        check_shares(known.robot, base)
        check_ends(known.robot, base, ends)
        return {*differences(known.robot.description, base)} <= {*known.slots}
    except ModelError:
        return False
