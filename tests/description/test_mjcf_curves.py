"""Grippers and cams whose joints follow polynomials, against MuJoCo's matrices and through every engine.

MuJoCo's equalities are soft. Its mass matrix, bias and rows, and the change of its rows, state the motion of
rigid ones.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from tests.compiled import test_derivatives_exact as exact
from tests.conversion.judge import SINGLE, read_back, same_robot
from tests.judges.mujoco_matrices import mass_matrix
from tests.oracle.models import Oracle
from tests.support.comparing import close_to
from tests.support.engines import engine_of, written_agrees
from tests.support.extras import needs
from tests.support.files import save

mujoco = needs("mjcf")

#: Accelerations against MuJoCo's matrices; the change of its rows is a central difference over STEP.
AGAINST_MUJOCO = 1e-8
STEP = 1e-6
#: The same formulas in another order.
SAME = 1e-11

GRIPPER = """<mujoco model="gripper">
<compiler angle="radian"/><option gravity="0 0 -9.81"/>
<worldbody><body name="palm"><geom type="box" size=".03 .03 .02" mass=".5"/>
 <body name="finger" pos="-.03 0 .05"><joint name="drive" axis="0 1 0" ref=".1"/>
  <geom type="capsule" fromto="0 0 0 0 .01 .08" size=".008" mass=".1"/>
  <body name="tip" pos="0 0 .08"><joint name="curl" axis="0 1 0"/>
   <geom type="capsule" fromto="0 0 0 .01 0 .05" size=".006" mass=".05"/></body></body>
 <body name="jaw" pos=".03 0 .05"><joint name="lift" type="slide" axis=".6 0 .8"/>
  <geom type="sphere" size=".01" mass=".2"/></body></body></worldbody>
<tendon><fixed name="sum"><joint joint="drive" coef=".7"/><joint joint="lift" coef="-3"/></fixed>
<fixed name="own"><joint joint="curl" coef="1.5"/></fixed></tendon>
<equality>EQUALITIES</equality>
<actuator><motor joint="drive" gear="2"/></actuator></mujoco>"""

#: Equalities as people write them: a cam, a finger that curls with it, and a sum that leads.
ROBOTS = {
    "cam": '<joint name="cam" joint1="lift" joint2="drive" polycoef=".002 .01 .03 -.02 .008"/>'
    '<joint joint1="curl" joint2="drive" polycoef="0 .5 .2 0 0"/>',
    "no linear part": '<joint name="cam" joint1="lift" joint2="drive" polycoef="0 0 .05 0 0"/>'
    '<joint joint1="curl" joint2="drive" polycoef=".1 0 0 -.3 0"/>',
    "chain": '<joint name="cam" joint1="lift" joint2="drive" polycoef="0 .02 0 .04 0"/>'
    '<joint joint1="curl" joint2="lift" polycoef="0 8 -20 0 0"/>',
    "tendons": '<joint name="cam" joint1="lift" joint2="drive" polycoef=".002 .01 .03 -.02 .008"/>'
    '<tendon name="coupled" tendon1="own" tendon2="sum" polycoef=".1 .4 -.3 .2 0"/>',
}


def given(draw: np.random.Generator) -> dict[str, Any]:
    """Return random positions, rates and accelerations of the motor."""
    return {"drive": tuple(draw.uniform(-0.7, 0.7, size=4) for _ in range(3))}


def gripper(tmp_path: Path, name: str) -> hybridyn.HybridRobot:
    file = save(tmp_path, GRIPPER.replace("EQUALITIES", ROBOTS[name]), "robot.xml")
    return hybridyn.load(file)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.filterwarnings("ignore")
def test_it_moves_as_mujoco_says(name: str, tmp_path: Path) -> None:
    robot, draw = gripper(tmp_path, name), np.random.default_rng(2)
    q, v, a = hybridyn.assemble(robot, motors=given(draw))
    tau = draw.normal(size=(len(q), 1))
    own = hybridyn.ddm(robot, q, v, tau)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    order = [model.joint(joint).qposadr[0] for joint in robot.joints]

    def rows(at: np.ndarray) -> np.ndarray:
        data.qpos[:] = at
        mujoco.mj_forward(model, data)
        return data.efc_J.reshape(-1, model.nv)[: model.neq].copy()

    for t in range(len(q)):
        at, rate, second = (np.zeros(model.nv) for _ in range(3))
        at[order], rate[order], second[order] = q[t], v[t], a[t]
        drift = (rows(at + STEP * rate) - rows(at - STEP * rate)) @ rate / (2 * STEP)
        data.qvel[:] = rate
        K = rows(at)
        assert np.abs(data.efc_pos[: model.neq]).max() < SAME  # it closes the loops of MuJoCo
        assert np.abs(K @ rate).max() < SAME
        assert np.abs(K @ second + drift).max() < AGAINST_MUJOCO * max(1.0, np.abs(second).max())
        whole = np.block([[mass_matrix(model, data), K.T], [K, np.zeros((model.neq, model.neq))]])
        effort = -data.qfrc_bias
        effort[model.joint("drive").dofadr[0]] += tau[t, 0]
        theirs = np.linalg.solve(whole, np.concatenate([effort, -drift]))[: model.nv]
        close_to(own[t], theirs[order], AGAINST_MUJOCO)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.filterwarnings("ignore")
def test_its_equations_are_those_of_the_oracle_and_written_out(name: str, tmp_path: Path) -> None:
    robot = gripper(tmp_path, name)
    written_agrees(robot)
    q, v, a = hybridyn.assemble(robot, motors=given(np.random.default_rng(3)))
    oracle, efforts = Oracle(robot.description), hybridyn.idm(robot, q, v, a)
    for t in range(len(q)):
        close_to(oracle.idm(q[t], v[t], a[t]), efforts[t], SAME)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.filterwarnings("ignore")
def test_its_compiled_model_assembles_and_steps(name: str, tmp_path: Path) -> None:
    robot = gripper(tmp_path, name)
    compiled, asked = engine_of("compiled", robot), given(np.random.default_rng(3))
    q, v, a = hybridyn.assemble(robot, motors=asked)
    close_to(compiled.assemble(motors=asked), (q, v, a), SAME)
    exact.test_derivatives_against_differences_in_113_bits(str(tmp_path / "robot.xml"), 3)
    close_to(compiled.idm(q, v, a), hybridyn.idm(robot, q, v, a), SAME)
    close_to(compiled.ddm(q, v, np.ones((len(q), 1))), hybridyn.ddm(robot, q, v, np.ones((len(q), 1))), SAME)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("ending", [".xml", ".urdf", ".sdf", ".usda"])
@pytest.mark.filterwarnings("ignore")
def test_it_comes_back_from_every_format(name: str, ending: str, tmp_path: Path) -> None:
    """URDF, SDF and USD say it in the model file beside them."""
    robot = gripper(tmp_path, name)
    other, _ = read_back(robot.description, tmp_path / f"other{ending}")
    states = hybridyn.assemble(robot, motors=given(np.random.default_rng(4)))
    same_robot(robot.description, other, states, tolerance=SINGLE if ending == ".usda" else 1e-11)
    assert sum(coupling.curve is not None for coupling in other.couplings) == 2
