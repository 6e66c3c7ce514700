"""Rotors of transmissions: no statement of one is lost without a note."""

import re
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.drake_plant import Plant
from tests.description.reading import refused
from tests.robots.robot_texts import INERTIAL
from tests.support.files import save

#: One hinge, with `{}` in it and behind it.
ARM = (
    '<robot name="r" xmlns:drake="http://drake"><link name="base"/><link name="arm">' + INERTIAL + "</link>"
    '<joint name="hold" type="fixed"><parent link="world"/><child link="base"/></joint>'
    '<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="9" velocity="9"/>{}</joint>{}</robot>'
)
SIMPLE = (
    '<transmission name="t{0}"><type>transmission_interface/SimpleTransmission</type><joint name="j">{1}'
    '</joint><actuator name="m{0}">{2}</actuator></transmission>'
)


def value(tag: str, number: float) -> str:
    """Return an element with a number as Drake writes it."""
    return f'<{tag} value="{number}"/>'


def text(tag: str, number: float) -> str:
    """Return an element with a number as ROS writes it."""
    return f"<{tag}>{number}</{tag}>"


OF_DRAKE = value("drake:rotor_inertia", 2e-4) + value("drake:gear_ratio", 160)
ROTOR, REDUCTION = text("rotor_inertia", 2e-4), text("mechanicalReduction", 50)
SUM = "rotors in several transmissions: their inertias at the joint add; Drake counts the last one alone"
#: What the joint states, its transmissions, the inertia at the joint, and what is noted.
ROTORS: dict[str, tuple[str, str, float, str | None]] = {
    "of Drake, beside a reduction of ROS": (
        "", SIMPLE.format(1, "", text("mechanicalReduction", 1) + OF_DRAKE), 2e-4 * 160**2, None,
    ),
    "of Drake, beside another reduction": (
        "", SIMPLE.format(1, "", REDUCTION + OF_DRAKE), 2e-4 * 160**2,
        "drops <mechanicalReduction> 50: another element states 160",
    ),
    "with the reduction of ros2_control": (
        "", SIMPLE.format(1, "", ROTOR + text("mechanical_reduction", 50)), 2e-4 * 50**2, None,
    ),
    "of a joint, with the reduction of a transmission": (
        ROTOR, SIMPLE.format(1, "", REDUCTION), 2e-4 * 50**2, None,
    ),
    "in two transmissions": (
        "", SIMPLE.format(1, "", ROTOR + REDUCTION) + SIMPLE.format(2, "", text("rotor_inertia", 3e-4)),
        2e-4 * 50**2 + 3e-4, SUM,
    ),
    "in three transmissions": (
        "", "".join(SIMPLE.format(n, "", ROTOR + text("gear_ratio", 10 * n)) for n in (1, 2, 3)),
        2e-4 * 1400, SUM,
    ),
    "in the second of two transmissions": (
        "", SIMPLE.format(1, "", "") + SIMPLE.format(2, "", ROTOR + REDUCTION), 2e-4 * 50**2, None,
    ),
    "in the joint and the actuator of a transmission": (
        "", SIMPLE.format(1, text("rotor_inertia", 1e-4), ROTOR + REDUCTION), 1e-4 * 50**2,
        "drops the rotor inertia 0.0002 of <actuator name=\"m1\">: another place states 0.0001",
    ),
    "in the joint and in its transmission": (
        text("rotor_inertia", 1e-4), SIMPLE.format(1, "", ROTOR + REDUCTION), 2e-4 * 50**2,
        "drops the rotor inertia 0.0001 of joint 'j': a transmission states 0.0002",
    ),
    "the same in the joint and in its transmission": (
        ROTOR, SIMPLE.format(1, "", ROTOR + REDUCTION), 2e-4 * 50**2, None,
    ),
    "of a joint with another ratio than its transmission": (
        ROTOR + text("gear_ratio", 160), SIMPLE.format(1, "", REDUCTION), 2e-4 * 50**2,
        "drops the gear ratio 160 of joint 'j': a transmission states 50",
    ),
    "none, and a reduction that is no number": (
        "", SIMPLE.format(1, "", "<mechanicalReduction>reduction</mechanicalReduction>"), 0.0,
        "<mechanicalReduction> 'reduction' is no number; no rotor needs it",
    ),
    "none, and two reductions": (
        "", SIMPLE.format(1, text("mechanicalReduction", 2), REDUCTION), 0.0, None,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ROTORS)
def test_no_rotor_is_lost_without_a_note(name: str, tmp_path: Path) -> None:
    in_joint, transmissions, inertia, words = ROTORS[name]
    found = read(save(tmp_path, ARM.format(in_joint, transmissions)))
    joint = next(joint for joint in found.joints if joint.name == "j")
    assert joint.rotor_inertia * joint.gear_ratio**2 == pytest.approx(inertia, rel=1e-14)
    notes = [note for note in found.notes if "world" not in note]
    assert [words in note for note in notes if words] == [True] * len(notes), notes
    assert bool(notes) == bool(words)
    assert all(re.match(r".*\.urdf:\d+: ", note) for note in notes)


@pytest.mark.parametrize(
    "name", ["of Drake, beside a reduction of ROS", "of Drake, beside another reduction"]
)
def test_a_rotor_of_drake_weighs_as_in_drake(name: str, tmp_path: Path) -> None:
    file = save(tmp_path, ARM.format(*ROTORS[name][:2]))
    drake = Plant(file, "r")
    theirs = drake.plant.CalcMassMatrix(drake.context)
    ours = hybridyn.mass_matrix(hybridyn.load(file), np.zeros(1), effects="model")
    np.testing.assert_allclose(ours, theirs, rtol=1e-14)


@pytest.mark.parametrize(
    ("number", "words"), [("0", "a gear ratio of 0 moves nothing"), ("x", "text 'x' is not")]
)
def test_a_wrong_reduction_of_a_rotor_is_refused(number: str, words: str, tmp_path: Path) -> None:
    wrong = SIMPLE.format(1, "", f"<mechanicalReduction>{number}</mechanicalReduction>{ROTOR}")
    refused(save(tmp_path, ARM.format("", wrong)), words)
