"""Trees read from SDF against Drake, whose parser is libsdformat, the reference reader of SDFormat."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.structure.robot import HybridRobot
from tests.extras import needs
from tests.samples import slow
from tests.sdf_texts import WORLD, joint, link, random_pair, sdf

pydrake = needs("drake", "pydrake")

#: Two programs that multiply the same few matrices.
AGAINST_DRAKE = 1e-13

VERSIONS = ("1.4", "1.5", "1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12")


def plant_of(file: Path) -> tuple[Any, Any]:
    """Return Drake's plant of a file and a context."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(file))
    plant.Finalize()
    return plant, plant.CreateDefaultContext()


def drawn(robot: HybridRobot, seed: int) -> tuple[np.ndarray, dict[str, float]]:
    """Draw a posture, and return it also by joint."""
    draw = np.random.default_rng(seed)
    q, named = pin.neutral(robot.model), {}
    for name, kind, at in zip(robot.joints, robot.kinds, robot.q_slices, strict=True):
        named[name] = x = float(draw.uniform(-1, 1))
        q[at] = (np.cos(x), np.sin(x)) if kind == "continuous" else x
    return q, named


@pytest.mark.parametrize(("seed", "version"), [(30, "1.6"), *(slow(31, version) for version in VERSIONS)])
def test_poses_and_inertia_are_those_of_drake(seed: int, version: str, tmp_path: Path) -> None:
    pin.seed(seed)
    file = tmp_path / "robot.sdf"
    file.write_text(sdf(*random_pair(seed, version).sdf[:-1], version=version))
    robot = hybridyn.load(file)
    q, named = drawn(robot, seed)
    plant, context = plant_of(file)
    for name, x in named.items():
        theirs = plant.GetJointByName(name)
        (theirs.set_angle if hasattr(theirs, "set_angle") else theirs.set_translation)(context, x)
    same_poses(robot, q, plant, context)
    M = pin.crba(robot.model, robot.model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    ours = [at.start for at in robot.v_slices]
    theirs = [plant.GetJointByName(name).velocity_start() for name in robot.joints]
    expected = plant.CalcMassMatrix(context)[np.ix_(theirs, theirs)]
    np.testing.assert_allclose(M[np.ix_(ours, ours)], expected, atol=AGAINST_DRAKE * np.abs(expected).max())


@pytest.mark.parametrize(
    ("kind", "more", "positions"),
    [
        ("universal", "<axis2><xyz>3 0 -1</xyz></axis2>", {"j_1": 0.7, "j_2": -0.4}),
        ("screw", "<screw_thread_pitch>0.5</screw_thread_pitch>", {"j": 0.7, "j_slide": 0.35 / (2 * np.pi)}),
        ("screw", "<thread_pitch>4</thread_pitch>", {"j": 0.7, "j_slide": -0.7 / 4}),
    ],
)
def test_joints_of_several_axes_move_as_in_drake(
    kind: str, more: str, positions: dict[str, float], tmp_path: Path
) -> None:
    file = tmp_path / "robot.sdf"
    arm = link("arm", "<pose>0.5 0.6 -0.7 0.8 0.9 -1.0</pose>")
    pose = "<pose>0.1 -0.2 0.3 0.4 -0.5 0.6</pose>"
    file.write_text(sdf(link("base"), arm, WORLD, joint("j", kind, "base", "arm", pose, more, axis="1 2 3")))
    robot = hybridyn.load(file)
    q = pin.neutral(robot.model)
    for name, x in positions.items():
        q[robot.q_slices[robot.joints.index(name)]] = x
    plant, context = plant_of(file)
    plant.SetPositions(context, [x for name, x in positions.items() if name != "j_slide"])
    same_poses(robot, q, plant, context)


def same_poses(robot: HybridRobot, q: np.ndarray, plant: Any, context: Any) -> None:
    """Compare the poses of all links that stand in the file."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    for body in robot.description.links:
        if plant.HasBodyNamed(body.name):
            theirs = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(body.name)).GetAsMatrix4()
            ours = data.oMf[robot.model.getFrameId(body.name, pin.BODY)].homogeneous
            np.testing.assert_allclose(ours, theirs, atol=AGAINST_DRAKE)
