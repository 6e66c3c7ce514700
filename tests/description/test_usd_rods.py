"""Distance joints with equal distances are rods: lengths stay, and accelerations are those of a rod."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description import read
from tests.comparing import close_to
from tests.extras import needs
from tests.files import save
from tests.usd_texts import DRIVE, at, body, joint, usda

needs("usd")

#: Two hinged bars in centimetres, whose tips a rod of 40 cm joins.
AXIS = 'token physics:axis = "Y"'
ENDS = at(0, "30, 5, 0"), at(1, "30, 0, 2")
LENGTH = 0.4
EXACT = 1e-12


def text(*about: str, held: bool = True) -> str:
    """Return the bars with a distance joint between them."""
    hinge = joint("Revolute", "second", "", "b", AXIS, at(0, "40, 0, 0"))
    return usda(
        body("a"),
        body("b", at="40, 0, 0"),
        joint("Revolute", "first", "", "a", AXIS, schemas=(DRIVE,)),
        hinge if held else "",
        joint("Distance", "rod", "a", "b", *ENDS, *about),
        meters=0.01,
    )


def rod(least: float, most: float) -> tuple[str, str]:
    return f"float physics:minDistance = {least}", f"float physics:maxDistance = {most}"


def test_accelerations_are_those_of_a_constraint_on_the_distance(tmp_path: Path) -> None:
    """M a + h = tau + J^T f, J a + J_dot v = 0 for half the square of the distance, by Pinocchio's tree."""
    file = save(tmp_path, text(*rod(40, 40)), "r.usda")
    robot = hybridyn.load(file)
    assert (robot.mobility, robot.motors, robot.description.notes[1:]) == (1, ("first",), ())
    q, v, a = hybridyn.assemble(robot, motors={"first": (0.3, 1.2, 0.7)})
    tau = hybridyn.idm(robot, q, v, a)
    file.write_text(text())
    tree = hybridyn.load(file)
    model = pin.Model(tree.model)
    two = [robot.v_slices[robot.joints.index(name)].start for name in tree.joints]
    q2, v2, a2 = q[two], v[two], a[two]
    tips = [
        model.addFrame(
            pin.Frame(f"tip{number}", number, pin.SE3(np.eye(3), np.array(point)), pin.FrameType.OP_FRAME)
        )
        for number, point in ((1, (0.3, 0.05, 0.0)), (2, (0.3, 0.0, 0.02)))
    ]
    data = model.createData()
    pin.forwardKinematics(model, data, q2, v2, np.zeros(2))
    pin.computeJointJacobians(model, data, q2)
    world = pin.LOCAL_WORLD_ALIGNED
    place, jacobian, rate, drift = [], [], [], []
    for frame in tips:
        place.append(pin.updateFramePlacement(model, data, frame).translation.copy())
        jacobian.append(pin.getFrameJacobian(model, data, frame, world)[:3])
        rate.append(pin.getFrameVelocity(model, data, frame, world).linear)
        drift.append(pin.getFrameClassicalAcceleration(model, data, frame, world).linear)
    apart, moving = place[1] - place[0], rate[1] - rate[0]
    assert abs(np.linalg.norm(apart) - LENGTH) < EXACT
    assert abs(apart @ moving) < EXACT
    J = apart @ (jacobian[1] - jacobian[0])
    close_to(J @ a2, np.array(-apart @ (drift[1] - drift[0]) - moving @ moving), 1e-10)
    force = pin.rnea(model, data, q2, v2, a2) - np.array([tau[0], 0.0])
    assert abs(force[0] * J[1] - force[1] * J[0]) < 1e-10 * np.linalg.norm(force) * np.linalg.norm(J)


@pytest.mark.parametrize(("about", "kinds"), [(rod(0, 0), []), (rod(40, 40), ["revolute", "revolute"])])
def test_a_body_may_hang_on_a_rod_alone(about: tuple[str, str], kinds: list[str], tmp_path: Path) -> None:
    (tmp_path / "r.usda").write_text(text(*about, held=False))
    found = read(tmp_path / "r.usda")
    assert [joint.kind for joint in found.joints if joint.name.startswith("rod")] == kinds
    (closure,) = found.closures
    assert (closure.name, closure.translations, closure.rotation) == ("rod", (0, 1, 2), "free")
    (loose,) = (joint for joint in found.joints if joint.kind == "floating")
    assert (loose.parent, loose.child) == ("world", "b")


def test_a_distance_without_limits_is_noted(tmp_path: Path) -> None:
    (tmp_path / "r.usda").write_text(text())
    found = read(tmp_path / "r.usda")
    assert found.closures == ()
    assert any("</robot/rod> limits no distance" in note for note in found.notes)
