"""Actuators on sites and cranks: a motor where they act on one joint alike at all positions, else a note."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from tests.support.extras import needs
from tests.support.files import save

mujoco = needs("mjcf")

TEXT = """<mujoco><option gravity="0 0 0"/><worldbody>
<body name="a"><joint name="j" axis="0 1 0"/><geom size=".1"/><site name="s" pos=".3 0 0"/>
<body name="b" pos="1 0 0"><joint name="k" axis="0 1 0"/><geom size=".1"/><site name="t" pos=".1 0 0"/></body>
</body><body name="c"><joint name="l" type="slide" axis="1 0 0"/><geom size=".1"/><site name="u"/></body>
</worldbody><actuator>{}</actuator></mujoco>"""

#: Actuators, the joint that they drive, and the effort at the largest control.
MOTORS = {
    '<motor name="m" site="s" gear="0 0 2 0 0 0" ctrlrange="-3 3"/>': ("j", 1.8),
    '<motor name="m" site="s" gear="0 0 0 0 2 0" ctrlrange="-3 3"/>': ("j", 6.0),
    '<motor name="m" site="u" gear="4 0 0 0 0 0" ctrlrange="-3 3"/>': ("l", 12.0),
    '<motor name="m" site="u" refsite="s" gear="0 0 0 0 1 0" ctrlrange="-3 3"/>': ("j", 3.0),
}
NONE = (
    '<motor name="m" site="t" gear="0 0 2 0 0 0"/>',
    '<motor name="m" site="u" gear="0 0 1 0 0 0"/>',
    '<general name="m" cranksite="u" slidersite="s" cranklength=".5"/>',
)


@pytest.mark.parametrize("actuator", MOTORS)
def test_an_actuator_that_acts_on_one_joint_alike_is_a_motor(actuator: str, tmp_path: Path) -> None:
    """Its effort accelerates the robot as its largest control does MuJoCo's model, but for the sign."""
    joint, effort = MOTORS[actuator]
    file = save(tmp_path, TEXT.format(actuator), "robot.xml")
    robot = hybridyn.load(file)
    assert robot.motors == (joint,)
    assert abs(robot.records[joint].effort - effort) < 1e-12
    model = mujoco.MjModel.from_xml_path(str(file))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = (0.3, -0.2, 0.1), 3.0
    mujoco.mj_forward(model, data)
    at = [model.joint(name).qposadr[0] for name in robot.joints]
    force = data.qfrc_actuator[model.joint(joint).dofadr[0]]
    assert abs(abs(force) - effort) < 1e-12
    own = hybridyn.ddm(robot, data.qpos[at], np.zeros(3), np.array([force]))
    np.testing.assert_allclose(own, data.qacc[at], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("actuator", NONE)
def test_other_actuators_are_noted(actuator: str, tmp_path: Path) -> None:
    description = read(save(tmp_path, TEXT.format(actuator), "robot.xml"))
    assert description.motors == ()
    assert any("'m' drives no joint" in note for note in description.notes)
