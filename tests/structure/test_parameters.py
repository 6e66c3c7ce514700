"""Chosen numbers of a description as parameters: names, slots, and the numbers of modules that follow."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hybridyn import HybridRobot, assemble, idm, load
from hybridyn.compiled.equations.arguments import Traced, expressed
from hybridyn.compiled.equations.coefficients import at_robot
from hybridyn.compiled.programs.sources import asked_for
from hybridyn.description.records import Description
from hybridyn.effects import GearEfficiency, LoadFriction, Payload, Spring, with_effects
from hybridyn.errors import AssemblyError, ModelError
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.chosen import Parameters
from hybridyn.structure.parameters.entries import _angles
from hybridyn.structure.parameters.slots import Slot, differences, values_of, with_values
from tests.robots.shipped import changed_copy, shipped
from tests.support.comparing import refused
from tests.support.files import save
from tests.support.samples import slow

SAME = 1e-11  # of a robot that is loaded anew
ROUNDED = 1e-15  # the same formulas on other numbers

CASES = {
    "five_bar": (
        "mass:m1_left_upper", "centre:m1_left_lower", "inertia:m1_tool", "position:m1_left_elbow",
        "placement:m1_tool_mount", "position:m1_tip/predecessor",
    ),
    "gough_stewart": (
        "mass:m1_platform", "position:m1_leg1_wrist_y", "position:m1_leg2_cross_y",
        "position:m1_leg3_ball/successor",
    ),
    "delta": ("position:m1_arm1_drive", "placement:m1_arm1_rod_a_cross_y", "mass:m1_arm2_link"),
}  # fmt: skip


def at_the_other_design(x: Any) -> Any:
    """Return the numbers of a structure, traced ones as their expressions: numbers of the other design."""
    if isinstance(x, Traced):
        return [x.expression]
    if dataclasses.is_dataclass(x):
        return [y for field in dataclasses.fields(x) for y in at_the_other_design(getattr(x, field.name))]
    if isinstance(x, tuple) or (isinstance(x, np.ndarray) and x.ndim):
        return [z for y in x for z in at_the_other_design(y)]
    return [x] if isinstance(x, (int, float, np.floating)) else []


@pytest.mark.parametrize("name", ["five_bar", slow("gough_stewart"), slow("delta")])
def test_the_numbers_of_modules_follow_from_the_parameters(name: str) -> None:
    """A number's expression is here its value in another design: formulas run on both at once."""
    robot = build_robot(shipped(name))
    parameters = Parameters(robot.description, CASES[name])
    numbers = parameters.slot_values(1.07 * parameters.nominal[None])[0].tolist()
    found = expressed(robot, parameters.slots, numbers)
    other = build_robot(with_values(robot.description, parameters.slots, numbers))
    for spec, module in zip(found.specs, other.modules, strict=True):
        own, wanted = (
            at_the_other_design(dataclasses.replace(x, home=np.zeros(0)))
            for x in (spec, module.mechanism.spec)
        )
        assert len(own) == len(wanted) > 100
        np.testing.assert_allclose(own, wanted, rtol=ROUNDED, atol=ROUNDED)


def test_parameters_are_the_numbers_of_the_description() -> None:
    description = shipped("five_bar")
    parameters = Parameters(description, ["mass:m1_tool", "placement:m1_left_drive"])
    assert parameters.labels[:2] == ("mass:m1_tool", "placement:m1_left_drive.x")
    joint = next(j for j in description.joints if j.name == "m1_left_drive")
    slots = parameters.slot_values(parameters.nominal[None])[0]
    np.testing.assert_allclose(slots[1:4], joint.placement[:3, 3])
    np.testing.assert_allclose(slots[4:].reshape(3, 3), joint.placement[:3, :3], atol=ROUNDED)
    assert parameters.vector({"mass:m1_tool": 2.0})[0] == 2.0


def same_robot(one: HybridRobot, other: HybridRobot) -> None:
    """Check that two robots have the same home, postures and efforts."""
    np.testing.assert_allclose(one.home, other.home, rtol=0, atol=SAME)
    motors = {name: np.linspace(0.0, 0.1, 4) for name in one.motors}
    q, wanted = (assemble(robot, motors=motors)[0] for robot in (one, other))
    np.testing.assert_allclose(q, wanted, rtol=0, atol=SAME)
    efforts = [idm(robot, q, np.zeros((4, one.nv)), np.zeros((4, one.nv))) for robot in (one, other)]
    np.testing.assert_allclose(*efforts, rtol=SAME, atol=SAME)


@pytest.mark.parametrize("pitch", [0.4, np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9])
def test_angles_of_a_rotation_give_its_matrix(pitch: float) -> None:
    """Also at a pitch of 90 degrees, where roll and yaw turn about one line; Pinocchio builds the matrix."""
    for R in (
        pin.rpy.rpyToMatrix(0.3, pitch, 0.7),
        pin.Quaternion(pin.rpy.rpyToMatrix(2.0, pitch, -1.0)).matrix(),
    ):
        assert np.allclose(pin.rpy.rpyToMatrix(_angles(R.ravel())), R, rtol=0, atol=ROUNDED)


def test_with_parameters_builds_the_robot_with_these_numbers(
    built_anew: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ranks are checked near the robot's postures: the search for generic postures does not run."""
    robot = build_robot(shipped("five_bar"))
    values = {"mass:m1_tool": 0.7, "position:m1_left_elbow": (0.27, 0.0, 0.0)}
    fresh = build_robot(replaced(robot.description, 0.7, 0.27))
    monkeypatch.setattr("hybridyn.structure.mechanism.kept_generic_postures", None)
    other = robot.with_parameters(values)
    assert [m.mechanism.reduction.rank for m in other.modules] == [2]
    same_robot(other, fresh)


@pytest.mark.parametrize("name", ["mass:m1_tool", "viscous_friction:m1_left_drive"])
def test_numbers_that_files_refuse_are_refused(name: str) -> None:
    refused(lambda: load("five_bar").with_parameters({name: -1.0}), ModelError, r"of .* cannot be -1")


def test_payloads_and_springs_are_parameters() -> None:
    robot = build_robot(shipped("five_bar"))
    loaded = with_effects(robot, [Payload("m1_tool", 0.5, (0.1, 0.0, 0.0))])
    other = loaded.with_parameters({"payload_mass:m1_tool": 2.0, "payload_centre:m1_tool": (0.0, 0.1, 0.0)})
    fresh = with_effects(robot, [Payload("m1_tool", 2.0, (0.0, 0.1, 0.0))])
    assert other.payloads == fresh.payloads
    same_robot(other, fresh)
    table = {"stiffness": {"m1_left_elbow": 3.0, "m1_left_drive": 1.0}, "rest": {"m1_left_elbow": 0.2}}
    sprung = build_robot(dataclasses.replace(shipped("five_bar"), effects=(("spring", table),)))
    stiff = sprung.with_parameters({"spring_stiffness:m1_left_elbow": 9.0, "spring_rest:m1_left_drive": 0.1})
    wanted = Spring(
        {"m1_left_elbow": 9.0, "m1_left_drive": 1.0}, {"m1_left_elbow": 0.2, "m1_left_drive": 0.1}
    )
    still = np.zeros((1, robot.nv))
    efforts = idm(stiff, robot.home[None], still, still, effects="model")
    np.testing.assert_array_equal(
        efforts, idm(robot, robot.home[None], still, still, effects=["model", wanted])
    )


def test_payloads_and_springs_that_are_not_there_are_named() -> None:
    robot = build_robot(shipped("five_bar"))
    once = with_effects(robot, [Payload("m1_tool", 0.5)])
    for call, words in (
        (
            lambda: robot.with_parameters({"spring_rest:m1_left_elbow": 1.0}),
            "there is no spring on the joint 'm1_left_elbow'",
        ),
        (
            lambda: robot.with_parameters({"payload_mass:m1_tool": 1.0}),
            "there is no payload on the link 'm1_tool'",
        ),
        (
            lambda: with_effects(once, [Payload("m1_tool", 0.7)]).with_parameters(
                {"payload_mass:m1_tool": 1.0}
            ),
            "there are 2 of payload on the link 'm1_tool'",
        ),
        (
            lambda: once.with_parameters({"payload_mass:m1_tool": 1.0, "mass:m1_tool": 1.0}),
            "name one of both",
        ),
        (
            lambda: once.with_parameters({"mass:m1_tool": 9.0}).with_parameters(
                {"payload_mass:m1_tool": 1.0}
            ),
            "add the payload last",
        ),
        (
            lambda: once.with_parameters({"payload_mass:m1_tool": -1.0}),
            "payload's mass of 'm1_tool' cannot be -1",
        ),
    ):
        refused(call, ModelError, words)


def replaced(description: Description, mass: float, length: float) -> Description:
    """Return the five-bar with another tool and another left upper link."""
    links = [dataclasses.replace(x, mass=mass) if x.name == "m1_tool" else x for x in description.links]
    joints = []
    for joint in description.joints:
        placement = joint.placement.copy()
        placement[0, 3] = length if joint.name == "m1_left_elbow" else placement[0, 3]
        joints.append(dataclasses.replace(joint, placement=placement))
    return dataclasses.replace(description, links=tuple(links), joints=tuple(joints))


def test_a_design_of_other_rank_is_decided_anew() -> None:
    """An axis that is no longer parallel to the others: the loop closes nowhere, as in a fresh robot."""
    robot = build_robot(shipped("five_bar"))
    refused(
        lambda: robot.with_parameters({"position:m1_left_elbow": (0.25, 0.1, 0.0)}),
        AssemblyError,
        "no posture closes its loops",
    )


@pytest.mark.slow
def test_arguments_of_a_xacro_file_are_parameters() -> None:
    robot = load("five_bar")
    values = {"upper_length": 0.27, "tool_mass": 0.7}
    fresh = load("five_bar", xacro_args={name: str(value) for name, value in values.items()})
    same_robot(robot.with_parameters(values), fresh)
    parameters = Parameters(robot.description, [*values, "mass:m1_base"])
    assert parameters.labels == ("upper_length", "tool_mass", "mass:m1_base")
    np.testing.assert_array_equal(parameters.nominal, [0.25, 0.4, 6.0])
    found = parameters.slot_values(np.array([[0.27, 0.7, 6.0]]))[0]
    np.testing.assert_array_equal(found, values_of(fresh.description, parameters.slots))
    for call, words in (
        (
            lambda: Parameters(robot.description, ["upper_lenght"]),
            r"no parameter 'upper_lenght' .did you mean 'upper_length'",
        ),
        (
            lambda: Parameters(robot.with_parameters({"mass:m1_tool": 1.0}).description, ["upper_length"]),
            "no longer those of its xacro file",
        ),
    ):
        refused(call, ModelError, words)


def test_the_file_is_read_once_for_each_design(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gradients ask for the same designs for each of their results."""
    parameters = Parameters(load("five_bar").description, ["upper_length"])
    found = parameters.slot_values(np.array([[0.27]]))
    monkeypatch.setattr("hybridyn.structure.parameters.xacro.read", None)
    np.testing.assert_array_equal(parameters.slot_values(np.array([[0.27], [0.27]])), found[[0, 0]])


#: Losses of the five-bar: the side-car's table, not all of its numbers and not by name, or what is asked for.
LOSSES: dict[str, tuple[str, Any]] = {
    "gears, asked for": ("", GearEfficiency({"m1_right_drive": 0.8})),
    "load friction, asked for": ("", LoadFriction({"m1_right_drive": 0.02, "m1_left_elbow": 0.01})),
    "gears of the file": (
        "[effects.gear_efficiency]\nefficiency = {m1_right_drive = 0.8}\n",
        "gear_efficiency",
    ),
    "load friction of the file": (
        "[effects.load_friction]\nradial = {m1_right_drive = 0.02, m1_left_elbow = 0.01}\n",
        "load_friction",
    ),
}


@pytest.mark.parametrize("case", LOSSES)
def test_models_over_an_argument_of_xacro_have_losses(case: str, tmp_path: Path) -> None:
    """No argument states them; designs have those of the model."""
    (table, asked), file = LOSSES[case], changed_copy("five_bar", tmp_path, {})
    if table:
        side_car = tmp_path / "models" / "five_bar" / "model.toml"
        side_car.parent.mkdir(parents=True)
        side_car.write_text(table)
    robot, on, parameters = asked_for(load(file), ["default", asked], ["upper_length"], "float64")
    found = parameters.slot_values(np.array([[0.27]]))[0]
    fresh = load(file, xacro_args={"upper_length": "0.27"})
    np.testing.assert_array_equal(found, values_of(fresh.description, parameters.slots))
    design = robot.with_parameters({"upper_length": 0.27})
    q, v, a = assemble(fresh, motors=dict.fromkeys(fresh.motors, (0.1, 0.2, 0.3)))
    wanted = idm(fresh, q, v, a, effects=["default", asked])
    np.testing.assert_array_equal(idm(design, q, v, a, effects=at_robot(on, design)), wanted)


def with_three_motors(folder: Path, drives: str, elbows: str) -> Path:
    """Copy the five-bar with other effort limits of its drives and of its hinges, and give its file."""
    changes = {
        "modules/five_bar.xacro": ('effort="${torque}"', f'effort="{drives}"'),
        "modules/joints.xacro": ('effort="0"', f'effort="{elbows}"'),
    }
    return changed_copy("five_bar", folder, changes)


#: Motors of the five-bar, of which two would do.
THREE = ["m1_left_drive", "m1_right_drive", "m1_left_elbow"]


def test_designs_of_one_model_share_loads_among_motors_alike(tmp_path: Path) -> None:
    """Ratios of limits may not change, near the robot's own length or far from it; the limits may."""

    def asked(name: str, drives: str, elbows: str) -> Parameters:
        robot = load(with_three_motors(tmp_path / name, drives, elbows), motors=THREE)
        return asked_for(robot, None, ["upper_length"], "float64")[2]

    words = "with upper_length = .*3 motors share a load by their effort limits, whose ratios differ"
    refused(lambda: asked("near", "15", "${20 * x}"), ModelError, words)
    far = asked("far", "15", "${5 if x &lt; 0.3 else 6}")
    far.slot_values(np.array([[0.29]]))
    refused(lambda: far.slot_values(np.array([[0.31]])), ModelError, words)
    asked("alike", "${40 * upper_length}", "${20 * x}").slot_values(np.array([[0.29]]))


def test_friction_by_load_may_vanish_in_a_design() -> None:
    table = {"radial": {"m1_left_drive": 0.01}, "width": 0.01}
    rough = dataclasses.replace(shipped("five_bar"), effects=(("load_friction", table),))
    slot = Slot("load_friction", "m1_left_drive", "radial")
    smooth = with_values(rough, [slot], [0.0])
    assert differences(rough, smooth) == [slot] == differences(smooth, rough)
    robot = build_robot(smooth)
    q, v, a = assemble(robot, motors=dict.fromkeys(robot.motors, (0.1, 0.2, 0.3)))
    plain = idm(build_robot(dataclasses.replace(rough, effects=())), q, v, a, effects="model")
    np.testing.assert_array_equal(idm(robot, q, v, a, effects="model"), plain)


def test_what_follows_from_an_efficiency_is_no_number_of_its_own() -> None:
    motor = "m1_left_drive"
    back, efficiency = (Slot("gear_efficiency", motor, field) for field in ("back", "efficiency"))
    cases: list[tuple[dict[str, Any], list[Slot]]] = [
        ({}, [efficiency]),
        ({"back": {motor: 0.7}}, [back, efficiency]),
    ]
    for stated, found in cases:
        table = {"efficiency": {motor: 0.9}, **stated}
        robot = dataclasses.replace(shipped("five_bar"), effects=(("gear_efficiency", table),))
        other = with_values(robot, found, [0.8] * len(found))
        assert sorted(differences(robot, other)) == found


COUNTED = """<robot name="stack" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="length" default="0.5"/>
  <xacro:arg name="rods" default="2"/>
  <xacro:arg name="colour" default="red"/>
  <link name="rod_0"/>
  <xacro:macro name="rods" params="i n">
    <xacro:if value="${i &lt; n}">
      <link name="rod_${i + 1}"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
      <joint name="turn_${i}" type="revolute"><parent link="rod_${i}"/><child link="rod_${i + 1}"/>
        <origin xyz="0 0 ${$(arg length) * (2 if $(arg length) > 0.8 else 1)}"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
      <xacro:rods i="${i + 1}" n="${n}"/>
    </xacro:if>
  </xacro:macro>
  <xacro:rods i="0" n="$(arg rods)"/>
</robot>"""


def test_a_robot_in_memory_has_no_arguments() -> None:
    description = dataclasses.replace(shipped("five_bar"), read_from=None)
    refused(
        lambda: Parameters(description, ["upper_length"]),
        ModelError,
        "'upper_length': the robot was not read from a xacro file",
    )


@pytest.mark.slow
def test_arguments_that_change_the_structure_are_refused(tmp_path: Path) -> None:
    robot = load(save(tmp_path, COUNTED, "stack.urdf.xacro"))
    for call, words in (
        (
            lambda: Parameters(robot.description, ["rods"]),
            r"rods = 2\.026: the links are others.*another structure",
        ),
        (lambda: Parameters(robot.description, ["colour"]), "'colour' is 'red', which is no number"),
    ):
        refused(call, ModelError, words)
    parameters = Parameters(robot.description, ["length"])
    assert len(robot.with_parameters({"rods": 3}).joints) == 3
    np.testing.assert_allclose(parameters.slot_values(np.array([[0.4], [0.9]])), [[0.4, 0.4], [1.8, 1.8]])


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["mass:m1_toll"], "there is no link 'm1_toll'.*m1_tool"),
        (["weight:m1_tool"], "there is no parameter 'weight:m1_tool'"),
        (["position:m1_tip"], "there is no joint or side of a closure 'm1_tip'"),
        (["offset:gear"], "there is no coupling 'gear'"),
        (["placement:m1_left_drive", "position:m1_left_drive"], "both set placement.*m1_left_drive"),
    ],
)
def test_wrong_parameters_are_named(names: list[str], message: str) -> None:
    refused(lambda: Parameters(shipped("five_bar"), names), ModelError, message)
