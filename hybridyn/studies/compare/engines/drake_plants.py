"""Build Drake's plants: from the robot's own file, or from its tree with constraints for its closures.

Drake's Python package has no type information, so its objects are `Any` here.
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from ....conversion.convert import convert
from ....errors import ModelError
from ....structure.robot import HybridRobot
from ..engine import NotComparableError
from ..own_file import OwnFile
from .joinings import joinings

#: Drake's words for the formats that its parser reads from a text.
PARSED = {"URDF": "urdf", "MJCF": "xml", "SDF": "sdf"}
#: Name of the link that Drake takes for the world.
WORLD = "world"
#: Elements of hybridyn's URDF that Drake shall not read: constraints stand in their place.
LOOPS = ("loop", "coupling", "mimic", "transmission", "visual", "collision")


def own_plant(robot: HybridRobot, own: OwnFile, step: float) -> Any:
    """Build a plant from the robot's own file.

    Args:
        step: Time step [s]; 0 for a continuous plant.

    Raises:
        NotComparableError: Drake refuses the file.
    """
    return _finished(robot, step, own.text, PARSED[own.format], lambda plant: None)


def constrained_plant(robot: HybridRobot, step: float) -> Any:
    """Build a plant from the robot's tree, with ball, weld and coupler constraints.

    Args:
        step: Time step [s].

    Raises:
        NotComparableError: Drake refuses the tree, or has no constraint for a closure.
    """
    return _finished(robot, step, _tree(robot), "urdf", lambda plant: _constrain(robot, plant))


def _tree(robot: HybridRobot) -> str:
    """Return the robot's tree as URDF."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        try:
            convert(robot, file)
        except ModelError as error:
            raise NotComparableError(f"cannot be written as URDF: {error}") from None
        root = etree.parse(str(file)).getroot()
    for node in list(root.iter(*LOOPS)):
        above = node.getparent()
        if above is not None:
            above.remove(node)
    return etree.tostring(root, encoding="unicode")


def _constrain(robot: HybridRobot, plant: Any) -> None:
    """Add the robot's closures and couplings to a plant."""
    from pydrake.math import RigidTransform

    missing = []
    for closure in robot.description.closures:
        found = joinings(closure, robot.bodies.size)
        missing += [] if found else [closure.name]
        a, b = (plant.GetBodyByName(link) for link in (closure.link_a, closure.link_b))
        for kind, frame_a, frame_b in found:
            if kind == "point":
                plant.AddBallConstraint(a, frame_a[:3, 3], b, frame_b[:3, 3])
            else:
                plant.AddWeldConstraint(a, RigidTransform(frame_a), b, RigidTransform(frame_b))
    for coupling in robot.description.couplings:
        if len(coupling.terms) != 2:
            missing.append(coupling.name)
            continue
        (first, weight), (second, other) = coupling.terms
        joints = (plant.GetJointByName(first), plant.GetJointByName(second))
        plant.AddCouplerConstraint(*joints, -other / weight, coupling.offset / weight)
    if missing:
        raise NotComparableError(f"Drake has no constraint for {', '.join(missing)}")


def _finished(robot: HybridRobot, step: float, text: str, word: str, constrain: Callable[[Any], None]) -> Any:
    """Parse a text into a plant, its root on the world, without friction and rotors."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant

    root = robot.description.root
    if root != WORLD and any(link.name == WORLD for link in robot.description.links):
        raise NotComparableError("Drake takes its link 'world', which is not its root, for the world")
    logging.getLogger("drake").setLevel(logging.ERROR)  # after the import, which sets it
    plant = MultibodyPlant(step)
    if step:
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        plant.SetUseSampledOutputPorts(False)  # so that a step is one update of the discrete state
    try:
        Parser(plant).AddModelsFromString(text, word)
        if word != "xml" and root != WORLD:
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root))
        constrain(plant)
        for index in plant.GetJointIndices():
            joint = plant.get_mutable_joint(index)
            if joint.num_velocities():
                joint.set_default_damping_vector(np.zeros(joint.num_velocities()))
        for index in plant.GetJointActuatorIndices():
            plant.get_mutable_joint_actuator(index).set_default_rotor_inertia(0.0)
        plant.mutable_gravity_field().set_gravity_vector(np.array(robot.gravity))
        plant.Finalize()
    except (RuntimeError, ValueError) as error:
        raise NotComparableError(f"Drake refuses it: {' '.join(str(error).split())[:200]}") from None
    return plant
