"""Arguments of a xacro file that change numbers of effects which the file states."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import idm, load
from hybridyn.compiled.programs.sources import asked_for
from hybridyn.effects import LineSprings, Stop
from hybridyn.structure.parameters.slots import values_of
from tests.support.comparing import refused
from tests.support.files import save

#: A pendulum with a spring to the base, and a bushing.
PENDULUM = """<robot name="pendulum" xmlns:xacro="http://www.ros.org/wiki/xacro" xmlns:drake="http://drake.mit.edu">
  <xacro:arg name="m" default="2"/><xacro:arg name="k" default="3"/>
  <xacro:arg name="top" default="1"/>
  <link name="base"/><link name="arm"><inertial><origin xyz="0 0 -1"/><mass value="$(arg m)"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="$(arg top)" effort="1" velocity="1"/></joint>
  FORCE
</robot>"""
SPRING = """<drake:linear_spring_damper><drake:linear_spring_damper_body_A name="base"/>
  <drake:linear_spring_damper_p_AP value="1 0 0"/><drake:linear_spring_damper_body_B name="arm"/>
  <drake:linear_spring_damper_p_BQ value="0 0 PLACE"/><drake:linear_spring_damper_free_length value="0.2"/>
  <drake:linear_spring_damper_stiffness value="$(arg k)"/><drake:linear_spring_damper_damping value="0"/>
</drake:linear_spring_damper>"""
BUSHING = """<drake:linear_bushing_rpy><drake:bushing_frameA name="base"/><drake:bushing_frameC name="arm"/>
  <drake:bushing_torque_stiffness value="0 $(arg k) 0"/><drake:bushing_torque_damping value="0 0 0"/>
  <drake:bushing_force_stiffness value="0 0 0"/><drake:bushing_force_damping value="0 0 0"/>
</drake:linear_bushing_rpy>"""


def written(folder: Path, force: str, place: str = "-0.5") -> Path:
    """Write a pendulum with a force, and give its file."""
    return save(folder, PENDULUM.replace("FORCE", force.replace("PLACE", place)), "pendulum.urdf.xacro")


@pytest.mark.parametrize("force", [SPRING, BUSHING], ids=["spring", "bushing"])
def test_arguments_change_the_forces_that_the_file_states(force: str, tmp_path: Path) -> None:
    file, state = written(tmp_path, force), (np.array([0.6]), np.zeros(1), np.zeros(1))
    robot, _, parameters = asked_for(load(file), "model", ["k", "m"], "float64")
    fresh = load(file, xacro_args={"k": 30, "m": 2.5})
    found = parameters.slot_values(np.array([[30.0, 2.5]]))[0]
    np.testing.assert_array_equal(found, values_of(fresh.description, parameters.slots))
    wanted = idm(fresh, *state, effects="model")
    design = robot.with_parameters({"k": 30, "m": 2.5})
    np.testing.assert_array_equal(idm(design, *state, effects="model"), wanted)
    assert np.abs(wanted - idm(robot, *state, effects="model")).min() > 1.0


def test_numbers_that_the_file_and_the_effects_state_are_refused_where_they_change(tmp_path: Path) -> None:
    robot = load(written(tmp_path, SPRING))
    ((name, stated),) = robot.description.effects
    assert name == "line_springs"
    asked = LineSprings(**{**stated, "stiffness": dict.fromkeys(stated["stiffness"], 5.0)})
    words = (
        "the arguments change numbers of 'line_springs' in the file, but .* state others: name one of both"
    )
    refused(lambda: asked_for(robot, [asked], ["k"], "float64")[2].slots, hybridyn.ModelError, words)
    parameters = asked_for(robot, [asked], ["m"], "float64")[2]
    assert {slot.table for slot in parameters.slots} == {"links"}


def test_arguments_that_move_the_ends_of_a_force_are_refused(tmp_path: Path) -> None:
    robot = load(written(tmp_path, SPRING, "-$(arg m)"))
    words = "the effects are others: the robot has another structure"
    refused(lambda: asked_for(robot, "model", ["m"], "float64")[2].slots, hybridyn.ModelError, words)


def test_an_argument_that_moves_the_begin_of_a_stop_is_refused(tmp_path: Path) -> None:
    """Also beside others; not where the stop has limits of its own, or does not act."""
    robot = load(written(tmp_path, ""))
    words = "with top = .*limit 'upper' of joint 'turn' is .* instead of 1, where the effect 'stop' begins"
    for names in (["top"], ["top", "m"]):
        call = partial(asked_for, robot, ["default", Stop({"turn": 100.0})], names, "float64")
        refused(call, hybridyn.ModelError, words)
    own = Stop({"turn": 100.0}, upper={"turn": 1.0})
    for asked in ([own], []):
        _, _, parameters = asked_for(robot, ["default", *asked], ["top", "m"], "float64")
        assert {slot.table for slot in parameters.slots} == {"links"}
    call = partial(asked_for, robot, ["default", own], ["top"], "float64")
    refused(call, hybridyn.ModelError, "no number of the models depends on top: leave them out")
