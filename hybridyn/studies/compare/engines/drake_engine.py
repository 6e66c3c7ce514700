"""Drake: the robot as its own reader sees it, as a continuous plant and as a discrete one.

Drake's Python package has no type information, so its objects are `Any` here.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ....description.names import counted
from ....spatial import Array
from ....structure.robot import HybridRobot
from ..engine import (
    Engine,
    NotComparableError,
    SingleJoints,
    Way,
    refuse_other_joints,
    refuse_several_freedoms,
)
from ..own_file import OwnFile
from .drake_plants import PARSED, constrained_plant, own_plant

#: Time step of a discrete plant in simulations [s], and the one whose first step gives its accelerations.
STEP, SHORT_STEP = 1e-3, 1e-6


class DrakeEngine:
    """A Drake plant on a fixed base."""

    def __init__(self, robot: HybridRobot, build: Callable[[float], Any], way: str, discrete: bool) -> None:
        self.robot, self.way, self.discrete = robot, way, discrete
        self.step = STEP
        self._build = build
        self.plant = build(SHORT_STEP if discrete else 0.0)
        self.context = self.plant.CreateDefaultContext()
        self.map = self._map(self.plant)
        stated = counted(self.plant.num_constraints(), "constraint")
        self.notes: tuple[str, ...] = (f"the plant states {stated}",)

    def _map(self, plant: Any) -> SingleJoints:
        joints = {}
        for index in plant.GetJointIndices():
            joint = plant.get_joint(index)
            if joint.num_velocities():
                joints[joint.name()] = joint
        refuse_other_joints(self.robot, list(joints), "Drake's reader")
        order = [joints[name] for name in self.robot.joints]
        return SingleJoints(
            self.robot,
            np.array([joint.position_start() for joint in order]),
            np.array([joint.velocity_start() for joint in order]),
        )

    def _set(self, q: Array, v: Array, force: Array) -> None:
        plant = self.plant
        plant.SetPositions(self.context, self.map.positions(q, plant.num_positions()))
        plant.SetVelocities(self.context, self.map.rates(v, plant.num_velocities()))
        plant.get_applied_generalized_force_input_port().FixValue(
            self.context, self.map.rates(force, plant.num_velocities())
        )

    def forward(self, q: Array, v: Array, force: Array) -> Array:
        """Compute accelerations: the time derivatives, or the change over one very short step."""
        found = self.call(q, v, force)()
        return self.map.rates_back(np.asarray(found))

    def call(self, q: Array, v: Array, force: Array) -> Callable[[], object]:
        """Return the plant's accelerations at a state."""
        self._set(q, v, force)
        plant, context = self.plant, self.context
        now = np.array(plant.GetVelocities(context))

        def continuous() -> Array:
            """Compute the accelerations of a plant in continuous time."""
            plant.get_applied_generalized_force_input_port().FixValue(
                context, self.map.rates(force, plant.num_velocities())
            )
            derivatives = plant.EvalTimeDerivatives(context).CopyToVector()
            return np.asarray(derivatives)[plant.num_positions() :]

        def discrete() -> Array:
            """Compute the accelerations from a short step of a discrete plant."""
            plant.get_applied_generalized_force_input_port().FixValue(
                context, self.map.rates(force, plant.num_velocities())
            )
            values = plant.EvalUniquePeriodicDiscreteUpdate(context)
            after = np.asarray(values.get_vector(0).CopyToVector())[plant.num_positions() :][: len(now)]
            out: Array = (after - now) / SHORT_STEP
            return out

        return discrete if self.discrete else continuous

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Compute forces by `CalcInverseDynamics`."""
        from pydrake.multibody.tree import MultibodyForces

        self._set(q, v, np.zeros(self.robot.nv))
        forces = MultibodyForces(self.plant)
        self.plant.CalcForceElementsContribution(self.context, forces)
        wanted = self.map.rates(a, self.plant.num_velocities())
        return self.map.rates_back(self.plant.CalcInverseDynamics(self.context, wanted, forces))

    def freedoms(self, q: Array) -> int | None:
        """Return None if the plant states constraints: Drake has no Jacobian of them."""
        return None if self.plant.num_constraints() else int(self.plant.num_velocities())

    def run(self, q: Array, seconds: float) -> list[Array]:
        """Simulate from rest, by Drake's default integrator or in steps of a millisecond."""
        from pydrake.systems.analysis import Simulator

        plant = self._build(STEP if self.discrete else 0.0)
        simulator = Simulator(plant)
        context = simulator.get_mutable_context()
        plant.SetPositions(context, self.map.positions(q, plant.num_positions()))
        plant.get_applied_generalized_force_input_port().FixValue(context, np.zeros(plant.num_velocities()))
        simulator.Initialize()
        out = []
        for end in np.linspace(0.0, seconds, 101)[1:]:
            simulator.AdvanceTo(float(end))
            out.append(self.map.back(np.asarray(plant.GetPositions(context))))
        return out


def ways(robot: HybridRobot, own: OwnFile) -> Iterator[Way]:
    """Yield the ways into Drake: by its reader, continuous and discrete."""
    if own.format in PARSED:
        for word, discrete in (("continuous", False), ("discrete (SAP)", True)):
            way = f"its {own.format} reader, {word}"
            yield (
                way,
                functools.partial(_engine, robot, functools.partial(own_plant, robot, own), way, discrete),
            )
    if robot.description.closures or robot.description.couplings:
        way = "ball, weld and coupler constraints, discrete (SAP)"
        yield way, functools.partial(_engine, robot, functools.partial(constrained_plant, robot), way, True)


def _engine(robot: HybridRobot, build: Callable[[float], Any], way: str, discrete: bool) -> Engine:
    if robot.base != "fixed":
        raise NotComparableError("Drake is compared on a fixed base only")
    refuse_several_freedoms(robot, "Drake")
    return DrakeEngine(robot, build, way, discrete)
