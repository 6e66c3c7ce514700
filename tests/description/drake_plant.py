"""Drake's model of a robot file, where Drake is installed (`pip install drake`)."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.structure.robot import HybridRobot

#: Two programs that multiply the same few matrices.
AGAINST_DRAKE = 1e-13


class Plant:
    """Drake's model of a file, whose folder is the package "nest".

    Attributes:
        plant: The model.
        context: Its state.
        joints: Its joints by name, with those of the models around them, but for the outermost.
        bodies: Its bodies but for the world, likewise.
    """

    def __init__(self, file: Path, name: str) -> None:
        pytest.importorskip("pydrake", reason="pip install drake")
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant
        from pydrake.multibody.tree import BodyIndex, JointIndex

        self.plant = plant = MultibodyPlant(0.0)
        parser = Parser(plant)
        parser.package_map().Add("nest", str(file.parent))
        parser.AddModels(str(file))
        plant.Finalize()
        self.context = plant.CreateDefaultContext()
        joints = (plant.get_joint(JointIndex(n)) for n in range(plant.num_joints()))
        bodies = (plant.get_body(BodyIndex(n)) for n in range(1, plant.num_bodies()))
        self.joints, self.bodies = (
            {
                f"{plant.GetModelInstanceName(one.model_instance())}::{one.name()}".removeprefix(
                    f"{name}::"
                ): one
                for one in many
            }
            for many in (joints, bodies)
        )

    def move(self, robot: HybridRobot, seed: int) -> np.ndarray:
        """Draw a posture of all joints, and return it for the robot."""
        draw, q = np.random.default_rng(seed), pin.neutral(robot.model)
        for name, kind, at in zip(robot.joints, robot.kinds, robot.q_slices, strict=True):
            x = float(draw.uniform(-1, 1))
            q[at] = (np.cos(x), np.sin(x)) if kind == "continuous" else x
            # Drake counts a joint to the model of its child.
            theirs = next(one for key, one in self.joints.items() if f"::{key}".endswith(f"::{name}"))
            (theirs.set_angle if hasattr(theirs, "set_angle") else theirs.set_translation)(self.context, x)
        return q

    def compare_poses(self, robot: HybridRobot, q: np.ndarray) -> None:
        """Compare the poses of all bodies."""
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, q)
        for name, body in self.bodies.items():
            theirs = self.plant.EvalBodyPoseInWorld(self.context, body).GetAsMatrix4()
            ours = data.oMf[robot.model.getFrameId(name, pin.BODY)].homogeneous
            np.testing.assert_allclose(ours, theirs, atol=AGAINST_DRAKE)

    def accelerations(self, q: Any, v: Any, efforts: Any) -> np.ndarray:
        """Return the rates' derivatives of a tree of Drake's under efforts on its freedoms."""
        from pydrake.multibody.tree import MultibodyForces

        plant, context = self.plant, self.context
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        pushed = forces.mutable_generalized_forces()
        pushed += np.asarray(efforts, dtype=float)
        bias = plant.CalcInverseDynamics(context, np.zeros(plant.num_velocities()), forces)
        return np.linalg.solve(plant.CalcMassMatrix(context), -bias)
