"""Reactions in C: the wrenches of the general path, also where redundant rows share them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.comparing import SAMPLES
from hybridyn.compiled.compiling import interpreted_model
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.states import moving_states
from hybridyn.compiled.programs.inverse import rubbing_program
from hybridyn.compiled.programs.quantities.transmitted import transmitted
from hybridyn.compiled.programs.reactions import reactions_program
from hybridyn.compiled.programs.unpacking import computed_alone, reactions_in
from hybridyn.compiled.programs.whole_robot import Interpreted
from hybridyn.dynamics.load_friction import wrenches_of
from hybridyn.dynamics.reactions import Reactions
from hybridyn.effects import GearEfficiency, LoadFriction, RotorInertia, ViscousFriction
from hybridyn.effects.choice import choose
from hybridyn.errors import AssemblyError, ModelError
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.compiled.test_friction_in_c import rubbing_law
from tests.oracle import Base
from tests.quantities.ankle import ankle
from tests.robots.mechanisms import random_mechanism
from tests.robots.shipped import ROBOTS, shipped
from tests.support.comparing import close_to
from tests.support.samples import slow

ROUNDED = 1e-11  # of the largest wrench: efforts and closures are solved by other eliminations
BASES = ("fixed", "moving", "floating")


def balanced(robot: HybridRobot, effects: Any = None) -> list[np.ndarray]:
    """Return q, v and a of random efforts."""
    q, v, tau = moving_states(robot, SAMPLES, 1, idle=False)
    return [q, v, hybridyn.ddm(robot, q, v, tau, effects=effects)]


def same(found: Reactions, wanted: Reactions) -> None:
    """Compare all attributes; of self-stresses what does not depend on the choice of their basis."""
    for kind in ("modules", "joints", "closures", "joints_shared", "determined", "joints_determined"):
        assert [*getattr(found, kind)] == [*getattr(wanted, kind)]
    assert found.unique == wanted.unique
    close_to(_every(found), _every(wanted), ROUNDED)
    for name, shared in wanted.joints_shared.items():
        stress = found.joints_shared[name]
        assert stress.shape == shared.shape
        close_to(stress @ np.swapaxes(stress, -1, -2), shared @ np.swapaxes(shared, -1, -2), ROUNDED)
        assert (found.joints_determined[name] == wanted.joints_determined[name]).all()
    for name, determined in wanted.determined.items():
        assert (found.determined[name] == determined).all()


def _every(found: Reactions) -> np.ndarray:
    """Return all wrenches of reactions side by side."""
    parts = (found.modules, found.joints, found.closures)
    return np.concatenate([found.base, *(x for part in parts for x in part.values())], axis=-1)


def test_joints_and_redundant_closures_of_a_planar_loop() -> None:
    robot = hybridyn.load("five_bar")
    compiled = hybridyn.compile(robot, threads=2)
    states = [np.tile(x, (40, 1)) for x in balanced(robot)]
    tau, found = compiled.idm(*states, reactions=True)
    wanted_tau, wanted = hybridyn.idm(robot, *states, reactions=True)
    close_to(tau, wanted_tau, ROUNDED)
    same(found, wanted)
    assert not found.unique["m1_tip"]
    assert found.determined["m1_tip"][:, [0, 2]].all()
    one = [x[3] for x in states]
    tau, found = compiled.idm(*one, reactions=True)
    assert tau.shape == (2,)
    assert found.base.shape == (6,)
    same(found, hybridyn.idm(robot, *one, reactions=True)[1])
    assert not compiled.recomputed


def test_friction_and_rotors_act_along_their_joints() -> None:
    """The program of reactions is that of the robot without them."""
    robot = hybridyn.load("five_bar")
    rubs = ViscousFriction(dict.fromkeys(robot.joints, 0.3))
    effects = ["default", rubs, RotorInertia(dict.fromkeys(robot.motors, 0.02))]
    states, compiled = balanced(robot, effects), interpreted_model(robot, effects, "idm")
    tau, found = compiled.idm(*states, reactions=True)
    wanted_tau, wanted = hybridyn.idm(robot, *states, effects=effects, reactions=True)
    close_to(tau, wanted_tau, ROUNDED)
    same(found, wanted)
    assert not compiled.recomputed


def written(robot: HybridRobot) -> None:
    """Compare the program, run by CasADi, with the general path."""
    q, v, a = balanced(robot)
    tau, wanted = hybridyn.idm(robot, q, v, a, reactions=True)
    along = np.zeros_like(v)
    along[:, robot.motor_v] = tau
    library = Interpreted([reactions_program(request(robot, None))])
    (root, *modules), guard = library.batch("reactions", q, v, a, along)
    assert (guard <= 1.0).all()
    same(reactions_in(robot, root, modules), wanted)


def test_an_ankle_on_a_floating_base(tmp_path: Path) -> None:
    written(build_robot(ankle(tmp_path).description, base="floating"))


def test_efforts_that_do_not_balance_the_motion_are_not_trusted() -> None:
    robot = hybridyn.load("five_bar")
    library = Interpreted([reactions_program(request(robot, None))])
    assert (library.batch("reactions", *balanced(robot), np.ones((12, robot.nv)))[1] > 1.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", [name for name in ROBOTS if name != "snake"])
def test_shipped_robots(name: str, base: str) -> None:
    written(build_robot(shipped(name), base=base))


@pytest.mark.parametrize(
    "kind",
    ["gear_three", *map(slow, ("serial_all", "loop_fixed", "branched", "star_four", "stack", "on_leg"))],
)
def test_random_mechanisms(kind: str) -> None:
    robot = build_robot(random_mechanism(3, kind=kind))
    assert not computed_alone(robot)
    written(robot)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gough_stewart", "lx4"])
def test_libraries_of_platforms(name: str) -> None:
    robot = hybridyn.load(name)
    compiled = hybridyn.compile(robot, threads=2, wait=True)
    states = balanced(robot)
    same(compiled.idm(*states, reactions=True)[1], hybridyn.idm(robot, *states, reactions=True)[1])
    assert not compiled.recomputed


@pytest.mark.slow
def test_the_library_of_a_robot_whose_friction_grows_with_load() -> None:
    robot = hybridyn.load("five_bar")
    rubs = LoadFriction(radial=dict.fromkeys(robot.joints, 5e-3), width=0.05)
    effects = ["default", rubs, ViscousFriction(dict.fromkeys(robot.joints, 0.3))]
    compiled, states = hybridyn.compile(robot, effects=effects, threads=2), balanced(robot, effects)
    tau, found = compiled.idm(*states, reactions=True)
    wanted_tau, wanted = hybridyn.idm(robot, *states, effects=effects, reactions=True)
    close_to(tau, wanted_tau, ROUNDED)
    same(found, wanted)
    assert not compiled.recomputed


@pytest.mark.parametrize(
    ("kind", "seed", "base"),
    [
        ("gear_three", 2, "floating"),
        *(slow(*one) for one in (("stack", 0, "fixed"), ("star_four", 1, "moving"))),
    ],
)
def test_friction_that_grows_with_the_reactions(kind: str, seed: int, base: Base) -> None:
    """Its efforts are among those along the joints; the program solves for it, joint by joint."""
    robot = build_robot(random_mechanism(seed, kind=kind), base=base)
    law = rubbing_law(robot, seed=seed, share=0.5)
    effects = ["default", LoadFriction(law.radial, normal=law.normal, width=0.05)]
    on, states = choose(robot, effects), balanced(robot, effects)
    assert on.loaded is not None
    tau, wanted = hybridyn.idm(robot, *states, effects=effects, reactions=True)
    programs = [reactions_program(request(robot, None)), rubbing_program(request(robot, on))]
    library = Interpreted(programs)
    found_tau, found, guard = transmitted(robot, library, on, states, None, 1)
    assert (guard <= 1.0).all()
    close_to(found_tau, tau, ROUNDED)
    same(found, wanted)
    friction = library.batch("idm_rubbing", *states)[0][1]
    close_to(friction, on.loaded.sizes(wrenches_of(on.loaded, wanted)), ROUNDED)
    assert (friction > 0).any(axis=0).all()


def test_what_no_program_computes_is_left_to_the_general_path() -> None:
    robot = hybridyn.load("five_bar")
    effects = ["default", GearEfficiency({"m1_left_drive": 0.9})]
    compiled, (q, v, a) = interpreted_model(robot, effects, "idm"), (x[0] for x in balanced(robot))
    tau, found = compiled.idm(q, v, a, reactions=True)
    wanted_tau, wanted = hybridyn.idm(robot, q, v, a, effects=effects, reactions=True)
    assert np.array_equal(tau, wanted_tau)
    assert np.array_equal(_every(found), _every(wanted))
    assert compiled.handed_over == {"reactions (with the effect 'gear_efficiency')": 1}


def test_errors_are_those_of_the_general_path() -> None:
    robot = hybridyn.load("five_bar")
    compiled = interpreted_model(robot, None, "idm")
    q, v, a = balanced(robot)
    with pytest.raises(ModelError, match="leave out 'parameters'"):
        compiled.idm(q, v, a, parameters=[0.5], reactions=True)
    a[1, 0] += 1.0
    with pytest.raises(AssemblyError, match="sample 1"):
        compiled.idm(q, v, a, reactions=True)
