"""Kinds of joints against Pinocchio's joints, and the words that formats have for them."""

import re

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description.closure_forms import FORMS, words_of_rows
from hybridyn.description.joint_words import JOINTS, WORDS
from hybridyn.joints.kinds import JointKind
from hybridyn.linkage.joints import TreeJoint
from hybridyn.structure.pinocchio_model import pinocchio_joint
from tests import ROOT

#: The pitch of a screw [m/rad], which other kinds do not have.
PITCH = 0.3
MOVING = [kind for kind in JointKind if kind is not JointKind.FIXED]
#: Files that may name a kind of joint by its word: the kinds, their words, keys of a file and public texts.
NAMING = {
    "joints/kinds.py", "description/joint_words.py", "description/side_cars/tables.py", "loading.py",
}  # fmt: skip


@pytest.mark.parametrize("kind", MOVING)
@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
def test_a_kind_is_that_of_pinocchio(kind: JointKind, axis: tuple[float, ...]) -> None:
    """Coordinates, freedoms, zero, and the twist that each rate is."""
    pitch = PITCH if kind is JointKind.SCREW else 0.0
    joint = TreeJoint("j", kind, axis=np.array(axis) if kind.single else np.eye(3)[2], pitch=pitch)
    model = pin.Model()
    model.addJoint(0, pinocchio_joint(joint), pin.SE3.Identity(), "j")
    assert (model.nq, model.nv) == (kind.nq, kind.nv)
    np.testing.assert_array_equal(pin.neutral(model), kind.zero)
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    S = np.array(data.joints[1].S, dtype=float).reshape(6, -1)
    np.testing.assert_allclose(joint.S, S, rtol=0, atol=1e-15)
    if axis[2] == 1.0 and not pitch:
        np.testing.assert_array_equal(S, np.eye(6)[:, kind.columns])


@pytest.mark.parametrize("kind", JointKind)
def test_parts_and_closure_have_its_freedoms(kind: JointKind) -> None:
    assert sum(part.nv for part in kind.parts.values()) == kind.nv
    if kind.closure is not None:  # no closure is a screw
        assert len(words_of_rows(*kind.closure)) == 6 - kind.nv
        assert (kind in FORMS) == (kind.nv < 6)


def test_each_kind_has_its_words_once() -> None:
    assert {*WORDS} == {*JointKind}
    assert all(joint.closure in ("", *FORMS) for joint in JOINTS)
    for form in ("urdf", "drake", "gepetto", "sdf", "usd"):  # MuJoCo has one word for two kinds of hinges
        words = [word for joint in JOINTS if (word := getattr(joint, form))]
        assert len(words) == len({*words}), form


def test_code_asks_kinds_and_does_not_name_them() -> None:
    """A reader or writer that names a kind would have to be found when a kind is added."""
    word = re.compile(r"""["'](planar|spherical|continuous|screw)["']""")
    package = ROOT / "hybridyn"
    naming = {
        str(path.relative_to(package)) for path in package.rglob("*.py") if word.search(path.read_text())
    }
    assert naming <= NAMING
