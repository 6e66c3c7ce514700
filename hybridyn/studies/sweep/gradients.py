"""Measures of a design with their gradients over the parameters of a study, for an optimiser of one's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...assembly.requests import gather_requests
from ...description.records import Description
from ...errors import HybridynError, ModelError
from ...gradients.design_gradients import DesignGradients
from ...gradients.gradient import MeasureGradients
from ...gradients.kept import kept_by_requests
from ...gradients.slot_changes import changes_of
from ...spatial import Array
from ...streams.postures import TreeSamples
from ...structure.parameters.entries import Numbers
from ...structure.parameters.slots import Slot, differences, values_of
from ...structure.robot import HybridRobot
from .evaluation import Designer, DesignRow, effects_of, said, status_of
from .following import follow
from .measure_bars import bars_of
from .study_file import StudyFile, TaskTable

#: Largest difference of efforts of the gradients' model to those of the general path, of the largest effort.
SAME_EFFORTS = 1e-8


class DesignGradient(NamedTuple):
    """A design with the gradients of its measures.

    Attributes:
        row: Its status, its measures and the first error, as a sweep writes them.
        gradient: Derivatives of the measures over the study's parameters, shape (measures, parameters); NaN
            where a measure is.
        closing: Smallest singular value of the loops' rows along all trajectories, without units: where it is
            zero, the assembly ceases to exist. NaN unless the status is "ok".
        closing_gradient: Its derivative, shape (parameters,).
    """

    row: DesignRow
    gradient: Array
    closing: float
    closing_gradient: Array


class _Structure(NamedTuple):
    """The models of designs that differ in slots alone, for each task."""

    base: Description
    slots: tuple[Slot, ...]
    of_tasks: dict[str, DesignGradients]


def _limits(description: Description) -> tuple[tuple[float, ...], ...]:
    """Return the limits of the joints."""
    return tuple((one.lower, one.upper, one.speed_limit, one.effort_limit) for one in description.joints)


class StudyGradients:
    """Evaluates single designs of a study with the gradients of their measures.

    Measures are those of trajectories: of motors, and of columns of joints and motors. A peak has the
    gradient of its own sample.
    """

    def __init__(self, source: StudyFile) -> None:
        """Prepare the evaluation.

        Raises:
            ModelError: A task is a workspace or a scene, or computes passive accelerations.
        """
        self.source, self._designer = source, Designer(source)
        self._structure: _Structure | None = None
        for name, task in source.study.tasks.items():
            if task.trajectory is None or task.passive != "given":
                what = f"a {task.kind}" if task.trajectory is None else "passive = 'solved'"
                raise ModelError(
                    f"{source.file}: task '{name}' has {what}: there are gradients of trajectories only",
                    element=name,
                )

    def __call__(self, values: Array, design: int = 0) -> DesignGradient:
        """Evaluate a design.

        Args:
            values: Values of the study's parameters, shape (parameters,).
            design: Its number, for the row.

        Raises:
            ModelError: A measure has no gradient, or a parameter opens loops.
        """
        values = np.asarray(values, dtype=float)
        row = self._designer(design, values)
        names = self.source.columns
        gradient = np.full((len(names), len(values)), math.nan)
        nothing = DesignGradient(row, gradient, math.nan, np.full(len(values), math.nan))
        if row.status != "ok":
            return nothing
        try:
            robot = self._designer.variants(self._designer.variants.named(values))
            structure, slots, along = self._slots(robot, values)
            closing, at_closing = math.inf, np.zeros(len(values))
            for name, task in self.source.study.tasks.items():
                found = self._task(robot, structure, name, task, (slots, along))
                for key, own in found.measures.items():
                    gradient[names.index(self.source.column(name, key))] = own
                if found.closing < closing:
                    closing, at_closing = found.closing, found.closing_gradient
            gradient[np.isnan(np.array(row.measures, dtype=float))] = math.nan
        except ModelError:
            raise
        except HybridynError as error:  # near singular postures, or of a model
            failed = DesignRow(design, row.values, status_of(error), row.measures, said(error))
            return nothing._replace(row=failed)
        return DesignGradient(row, gradient, closing, at_closing)

    def _slots(self, robot: HybridRobot, values: Array) -> tuple[_Structure, Array, Array]:
        """Return the models of a structure, the numbers in its slots, and their derivative over values."""
        variants, known, base = self._designer.variants, self._structure, robot.description
        differ = {*known.slots} if known is not None and _same(known, base) else set[Slot]()
        slots = None

        def numbers(rows: Array) -> Numbers:
            """Return the numbers in the slots, and find further slots that differ between designs."""
            out, errors = np.full((len(rows), len(slots or ())), math.nan), dict[int, ModelError]()
            for i, row in enumerate(rows):
                try:
                    described = variants.description(variants.named(row))
                    differ.update(differences(base, described))
                except ModelError as error:
                    errors[i] = error
                else:
                    self._check_limits([base, described])
                    out[i] = values_of(described, slots or ())
            return out, errors

        while slots is None or {*slots} != differ:
            slots = tuple(sorted(differ))
            along = changes_of(numbers, values, self._ranges)
        if known is None or slots != known.slots:
            known = self._structure = _Structure(base, slots, {})
        return known, np.array(values_of(base, slots)), along

    @cached_property
    def _ranges(self) -> Array:
        """The bounds of the study's parameters, infinite where there are none, shape (parameters, 2)."""
        stated = self.source.study.parameters.values()
        return np.array([one.range or (-math.inf, math.inf) for one in stated])

    def _check_limits(self, described: Sequence[Description]) -> None:
        """Check that designs have the limits of joints to which margins are measured.

        Raises:
            ModelError: The limits differ.
        """
        margins = [
            (name, word)
            for name, task in self.source.study.tasks.items()
            for word in task.wanted.values()
            if word.endswith("_margin")
        ]
        if margins and len({*map(_limits, described)}) > 1:
            name, word = margins[0]
            raise ModelError(
                f"{self.source.file}: task '{name}': '{word}' has no gradient where limits of joints "
                "follow the parameters", element=name,
            )  # fmt: skip

    def _task(
        self,
        robot: HybridRobot,
        structure: _Structure,
        name: str,
        task: TaskTable,
        numbers: tuple[Array, Array],
    ) -> _TaskGradients:
        """Return the gradients of a task's measures, and of the singular value of its loops."""
        track, effects = self._designer.tracks[name], effects_of(robot, task)
        layout, motions = track.motions(robot)
        if layout.full_state or motions[0].wrenches:
            what = "every joint" if layout.full_state else "wrenches"
            raise ModelError(
                f"{self.source.file}: task '{name}' prescribes {what}: there are gradients of tables of "
                "motors and poses",
                element=name,
            )
        blocks = [*follow(robot, track, task.passive, effects, task.redundancy)]
        whole, tau = TreeSamples.joined([x for x, _ in blocks]), np.concatenate([x for _, x in blocks])
        if name not in structure.of_tasks:
            kept = kept_by_requests(
                robot,
                gather_requests(robot, motions[0].joints, motions[0].platforms, redundancy=task.redundancy),
            )
            structure.of_tasks[name] = DesignGradients(robot, structure.slots, keep=kept, effects=effects)
        words = task.wanted
        bars = [bars_of(robot, word, whole, tau) for word in words.values()]
        p, along = numbers
        found = structure.of_tasks[name].of_measures((whole.q, whole.v, whole.a), p, along, bars)
        self._check(name, found, tau)
        return _TaskGradients(dict(zip(words, found.over, strict=True)), found.closing, found.closing_over)

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


class _TaskGradients(NamedTuple):
    """Gradients of the measures of a task by their names, and the least singular value of its loops."""

    measures: dict[str, Array]
    closing: float
    closing_gradient: Array


def _same(known: _Structure, base: Description) -> bool:
    """Return whether a design has a structure, and differs from it in its slots alone."""
    try:
        return {*differences(known.base, base)} <= {*known.slots}
    except ModelError:
        return False
