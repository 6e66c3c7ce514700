"""Trees read from SDF against Drake, whose parser is libsdformat, the reference reader of SDFormat."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.structure.robot import HybridRobot
from tests.extras import needs
from tests.files import save
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
    file = save(tmp_path, sdf(*random_pair(seed, version).sdf[:-1], version=version), "robot.sdf")
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
    plant.SetPositions(context, [*positions.values()])
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


PART = """<sdf version="1.9"><model name="part"><pose>0.3 0.1 0 0 0.2 0</pose>
<frame name="f2" attached_to="y"><pose relative_to="jj">0.1 0.2 0.3 0.3 0.2 0.1</pose></frame>
<link name="x"><pose>1 2 3 0.1 0.2 0.3</pose></link>
<link name="y"><pose relative_to="x">0.5 0 0 0 0.4 0</pose></link>
<frame name="f1" attached_to="x"><pose>0 1 0 0.5 0 0</pose></frame>
<joint name="jj" type="revolute"><parent>f1</parent><child>y</child><pose>0.1 0 0 0 0 0.7</pose>
<axis><xyz expressed_in="f1">0 1 1</xyz></axis></joint></model></sdf>"""
WHOLE = """<sdf version="1.9"><model name="m"><pose>0 0 1 0 0 0.5</pose>
<link name="base"><pose>0.2 0 0 0 0 0.1</pose></link>
<joint name="hold" type="fixed"><parent>world</parent><child>base</child></joint>
<frame name="fb" attached_to="base"><pose>0 0 0.4 0.2 0 0</pose></frame>
<include><uri>package://nest/part.sdf</uri><name>p1</name>
<pose relative_to="fb">0.1 0 0 0 0 1</pose></include>
<joint name="k1" type="revolute"><parent>fb</parent><child>p1::f1</child><pose>0.2 0 0 0 0.1 0</pose>
<axis><xyz>1 0 1</xyz></axis></joint>
<include><uri>package://nest/part.sdf</uri><name>p2</name>
<pose relative_to="p1::f2">0.1 0 0 0 0 1</pose></include>
<joint name="k2" type="revolute"><parent>p1</parent><child>p2::x</child>
<axis><xyz expressed_in="p1::__model__">0 1 0</xyz></axis></joint>
<model name="in"><pose relative_to="p2::jj">0 0 1 0.1 0 0</pose>
<link name="a"><pose>0 1 0 0 0 1</pose></link>
<link name="b"><pose relative_to="__model__">0 2 0 0 1 0</pose></link>
<joint name="ab" type="prismatic"><parent>a</parent><child>b</child><pose relative_to="__model__"/>
<axis><xyz>1 2 0</xyz></axis></joint></model>
<joint name="k3" type="continuous"><parent>p2::y</parent><child>in</child>
<pose relative_to="in::a">0 0 0 0 0.3 0</pose><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""


def test_composed_models_stand_as_in_drake(tmp_path: Path) -> None:
    """Nested and included models, with frames of each other."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import BodyIndex, JointIndex

    folder = tmp_path / "nest"
    folder.mkdir()
    (folder / "part.sdf").write_text(PART)
    (folder / "main.sdf").write_text(WHOLE)
    robot = hybridyn.load(folder / "main.sdf", package_dirs=[folder])
    q, named = drawn(robot, 3)
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().Add("nest", str(folder))
    parser.AddModels(str(folder / "main.sdf"))
    plant.Finalize()
    context = plant.CreateDefaultContext()

    def full(element: Any) -> str:
        model = plant.GetModelInstanceName(element.model_instance())
        return f"{model}::{element.name()}".removeprefix("m::")

    joints = {
        full(plant.get_joint(JointIndex(n))): plant.get_joint(JointIndex(n))
        for n in range(plant.num_joints())
    }
    for name, x in named.items():  # Drake counts a joint to the model of its child
        theirs = joints.get(name) or next(one for key, one in joints.items() if key.endswith(f"::{name}"))
        (theirs.set_angle if hasattr(theirs, "set_angle") else theirs.set_translation)(context, x)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    bodies = {
        full(plant.get_body(BodyIndex(n))): plant.get_body(BodyIndex(n)) for n in range(1, plant.num_bodies())
    }
    assert {*bodies} == {"base", "p1::x", "p1::y", "p2::x", "p2::y", "in::a", "in::b"}
    for name, body in bodies.items():
        ours = data.oMf[robot.model.getFrameId(name, pin.BODY)].homogeneous
        theirs = plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
        np.testing.assert_allclose(ours, theirs, atol=AGAINST_DRAKE)
