"""Program of the derivatives of motor efforts over positions, rates and accelerations of the motors.

With held motors a group passes the motion of its base on to its outputs, and wrenches on its outputs to its
base. So an input of a group changes its own efforts, those of groups inwards through the wrench on its base,
and those of groups outwards through the motion of its outputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...equations.request import Request
from ...program import Constants, Each, Own, Program, Result, Shared
from ..direct import write_direct_sweeps
from ..inverse import inverse_inputs, write_balance, write_inverse_sweeps
from ..writer import Writer
from .dense import Term, add_terms, by_columns, copy_columns
from .groups import Group, Place, groups_of
from .memory import compacted
from .motion import Motions
from .motor_forces import GroupForces, Targets, columns_from, outputs_of
from .motor_motion import MotorMotions
from .nodes import Joiner

#: Inputs of the derivatives, each with as many columns as there are motors.
INPUTS = ("q", "v", "a")


def motor_inverse_derivatives(request: Request) -> Program:
    """Build the program of tau and of "d_q", "d_v", "d_a": its derivatives over the motors' motion."""
    motors = len(request.robot.motors)
    outputs = [("tau", motors)] + [(f"d_{name}", motors * motors) for name in INPUTS]
    w = Writer("idm_motor_jacobian", inverse_inputs(request), outputs, computed=("tau",))
    write_inverse_sweeps(request, w)
    w.results["a"] = sum(size for _, size in outputs)  # no place: no call that writes there is made
    start = len(w.steps)
    modules = write_direct_sweeps(request, w, motions=True)
    efforts = [call for call in w.calls_from(start) if w.kernels[call.kernel].part == "effects"]
    w.steps[start:] = efforts  # which the legs' kernels read; of the rest only derivatives are needed
    balance = write_balance(request, w, motions=True)
    steps = w.calls_from(start)
    instead: dict[Shared, Shared] = {}
    for of, calls in zip(modules, balance.modules, strict=True):
        for old, new in ((of.V, calls.V), (of.A, calls.A)):
            instead |= {old[o]: new[o] for o in old}
        assert of.u_dot is not None
        assert calls.u_dot is not None
        instead[of.u_dot] = of.u_dot = calls.u_dot
    groups = [
        group for group in groups_of(request, balance) if group.mobility
    ]  # others stand still on the base
    joiner, motions = Joiner(w.kernels, w.handed), Motions(w, instead)
    for of in modules:
        motions.evaluate(of)
    by_motors = MotorMotions(w, motions)
    held: dict[Group, _Held] = {}
    for group in reversed(groups):
        parts = by_motors.of([modules[x.k] for x in group.modules])
        H = {place: [held[child].H for child in children] for place, children in group.children.items()}
        held[group] = _Held.of(GroupForces.of(w, group, parts, steps, joiner, H))
    results = _Results(w, motors, held)
    for group in groups:
        for name in INPUTS:
            for i in range(len(held[group].forces.parts)):
                results.add(group, i, name)
    return compacted(w.program())


@dataclass
class _Held:
    """What the motion of a group's base causes while its motors are held, column by column.

    Attributes:
        forces: Forces of the group.
        motors: Forces along its motors.
        base: Wrench on its base.
        through: Acceleration and twist of each output.
        unit: Number of columns: the base's acceleration, then its twist.
    """

    forces: GroupForces
    motors: Each
    base: Each
    through: dict[Place, tuple[Each, Each]]
    unit: int

    @classmethod
    def of(cls, x: GroupForces) -> _Held:
        """Add the columns."""
        w, group = x.writer, x.group
        moved = x.moved
        unit = sum(end.size for end in moved)
        motors, base = w.each(unit, group.mobility), w.each(unit, 6)
        through = {place: (w.each(unit, a), w.each(unit, v)) for place, a, v in x.places}
        first = 0
        for end in moved:
            targets: Targets = {"motors": columns_from(motors, first), "base": columns_from(base, first)}
            targets |= outputs_of(
                [(columns_from(A, first), columns_from(V, first)) for A, V in through.values()]
            )
            x.columns([(end, Constants(np.eye(end.size)))], end.size, targets)
            first += end.size
        return cls(x, motors, base, through, unit)

    @property
    def H(self) -> Shared:
        """The wrench on the base over the base's motion."""
        return by_columns(self.base, 0, self.unit)


class _Results:
    """Add the derivatives to the results."""

    def __init__(self, w: Writer, motors: int, held: dict[Group, _Held]) -> None:
        self._w, self._motors, self._held = w, motors, held

    def add(self, group: Group, i: int, name: str) -> None:
        """Add the columns of an input of a part's motors to all efforts."""
        w, x = self._w, self._held[group].forces
        own = x.parts[i].motors
        count = len(own)
        places = {
            other: w.result(f"d_{name}", of.forces.motors * self._motors + own[:, None])
            for other, of in self._held.items()
        }
        targets: Targets = {"motors": places.pop(group)}
        wrench = w.own(count, 6) if group.parent else None
        if wrench:
            targets["base"] = wrench
        moved = {place: (w.own(count, a), w.own(count, v)) for place, a, v in x.places}
        x.over_motors(i, name, targets | outputs_of(list(moved.values())))
        at = group
        while wrench is not None and at.parent is not None:
            onto = self._held[at.parent].forces.onto[at.base]
            add_terms(w, count, [_six(onto["motors"], wrench)], [], places.pop(at.parent))
            at, passed = at.parent, w.own(count, 6)
            if at.parent:
                add_terms(w, count, [_six(onto["base"], wrench)], [], passed)
            wrench = passed
        for place, (A, V) in moved.items():
            for child in group.children[place]:
                self._outwards(child, A, V if name != "a" else None, places)
        for other, target in places.items():
            copy_columns(w, count, Constants(np.zeros((count, other.mobility))), target)

    def _outwards(self, group: Group, A: Own, V: Own | None, places: dict[Group, Result]) -> None:
        """Add what a change of motion of a group's base causes in it and all that it carries."""
        w, held = self._w, self._held[group]
        target = places.pop(group)
        count = target.index.shape[0]

        def over(each: Each) -> list[Term]:
            """Return the change of what is stored over the base's motion."""
            twist = [Term(by_columns(each, 6, V.size), V, V.size)] if V else []
            return [_six(each, A), *twist]

        add_terms(w, count, over(held.motors), [], target)
        for place, (over_A, over_V) in held.through.items():
            acceleration, twist = w.own(count, 6), w.own(count, over_V.size) if V else None
            add_terms(w, count, over(over_A), [], acceleration)
            if V and twist:
                add_terms(w, count, [Term(by_columns(over_V, 6, V.size), V, V.size)], [], twist)
            for child in group.children[place]:
                self._outwards(child, acceleration, twist, places)


def _six(each: Each, column: Own) -> Term:
    """Return the first six columns of a matrix times a column."""
    return Term(by_columns(each, 0, 6), column, 6)
