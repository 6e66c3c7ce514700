"""Inertia along tendons of MJCF files, against MuJoCo's accelerations."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from tests.judges.mujoco_matrices import mass_matrix
from tests.support.comparing import close_to
from tests.support.extras import needs
from tests.support.files import save

mujoco = needs("mjcf")

pytestmark = pytest.mark.skipif(
    not hasattr(mujoco.MjModel.from_xml_string("<mujoco/>"), "tendon_armature"),
    reason="this MuJoCo has no armature of tendons",
)

BAR = '<inertial pos="{} .02 .03" mass="{}" diaginertia=".1 .2 .25"/>'
TEXT = f"""<mujoco><compiler angle="radian"/><worldbody>
<body name="a"><joint name="j" axis="0 1 0" armature=".2" ref=".1"/>{BAR.format(0.1, 2)}
 <body name="b" pos="1 0 0"><joint name="k" axis="0 .6 .8"/>{BAR.format(0.2, 1.5)}
  <body name="c"><joint name="s" type="slide" axis="1 0 0"/>{BAR.format(0.1, 1)}</body></body></body>
</worldbody><tendon>{{}}</tendon></mujoco>"""
TENDONS = {
    "over one joint": '<fixed name="t" armature="3"><joint joint="k" coef="2"/></fixed>',
    "over two joints": '<fixed name="t" armature="3"><joint joint="j" coef="1"/><joint joint="s" coef="-2"/>'
    "</fixed>",
    "two over the same joints": '<fixed armature="3" stiffness="7"><joint joint="j" coef="1"/>'
    '<joint joint="k" coef=".5"/></fixed><fixed name="j" armature="1"><joint joint="k" coef="1"/>'
    '<joint joint="j" coef="-2"/><joint joint="s" coef="1"/></fixed>',
}


@pytest.mark.parametrize("name", TENDONS)
def test_inertia_along_tendons_is_that_of_mujoco(name: str, tmp_path: Path) -> None:
    file = save(tmp_path, TEXT.format(TENDONS[name]), "robot.xml")
    robot, model = hybridyn.load(file, motors=["j", "k", "s"]), mujoco.MjModel.from_xml_path(str(file))
    data, draw = mujoco.MjData(model), np.random.default_rng(3)
    data.qpos[:], data.qvel[:] = draw.normal(size=(2, model.nv))
    mujoco.mj_forward(model, data)
    theirs = np.linalg.solve(mass_matrix(model, data), data.qfrc_passive - data.qfrc_bias + [1.0, 2.0, 3.0])
    moved = {joint: (data.qpos[n], data.qvel[n], theirs[n]) for n, joint in enumerate(("j", "k", "s"))}
    q, v, _ = hybridyn.assemble(robot, motors=moved)
    found = hybridyn.ddm(robot, q, v, [1.0, 2.0, 3.0], effects="model")
    columns = [robot.v_slices[robot.joints.index(joint)].start for joint in ("j", "k", "s")]
    close_to(found[columns], theirs, 1e-10)
