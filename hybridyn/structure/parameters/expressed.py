"""The numbers of a robot's modules as functions of the numbers in slots of its description."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...spatial import Array
from ..graph import find_modules, undo_cuts
from ..module_spec import ModuleSpec, module_spec
from ..robot import HybridRobot
from .slots import Slot, values_of, with_values
from .traced import Decision, Record, Traced


@dataclass(frozen=True, eq=False)
class Expressed:
    """A robot whose modules' numbers are traced.

    Attributes:
        specs: The numbers of each module of the robot; entries that depend on slots are `Traced`.
        place: `Bodies.place`, likewise.
        decisions: Comparisons of slots that decided the modules' structure.
    """

    specs: tuple[ModuleSpec, ...]
    place: dict[str, tuple[int, Array, Array]]
    decisions: tuple[Decision, ...]


def expressed(robot: HybridRobot, slots: Sequence[Slot], symbols: Sequence[Any]) -> Expressed:
    """Compute the numbers of a robot's modules as functions of the numbers in slots.

    Args:
        robot: The robot; its values decide the structure.
    """
    record = Record()
    values = values_of(robot.description, slots)
    traced = [Traced(value, symbol, record) for value, symbol in zip(values, symbols, strict=True)]
    bodies, graphs = find_modules(with_values(robot.description, slots, traced), robot.held)
    specs = []
    modules = list(robot.modules)
    if robot.base == "floating":
        spec = modules.pop(0).mechanism.spec
        body = replace(bodies.bodies[0], name="", joint=0, heaviest=0.0)  # as `ModuleSpec` has it
        specs.append(replace(spec, outputs_inertia=(body,)))
    for module, graph in zip(modules, graphs, strict=True):
        own = module.mechanism.spec
        if graph.wrists and not own.wrists:
            undo_cuts(bodies, graph)
        specs.append(module_spec(bodies, graph, own.home))
    return Expressed(tuple(specs), bodies.place, tuple(record.decisions))
