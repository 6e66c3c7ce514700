"""Numbers of the robot as arguments of compiled models, against a robot that is built with these numbers."""

import pickle
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.coefficients import at_robot
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.programs.designs import DesignsInSlots, changed
from hybridyn.compiled.programs.sources import asked_for
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.effects import GearEfficiency, LoadFriction, Payload, Spring
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.chosen import Parameters
from hybridyn.structure.parameters.effect_numbers import stated_numbers
from tests.compiled import rods
from tests.robots.shipped import shipped
from tests.structure.test_parameters import CASES
from tests.support.comparing import close_to, refused, same_bits

AGREE = 1e-11  # of the largest entry
FEW = {"five_bar": ("mass:m1_tool", "position:m1_left_elbow"), "gough_stewart": CASES["gough_stewart"]}


def states(compiled: hybridyn.CompiledRobot, factor: float, seed: int) -> dict[str, Array]:
    """Return states of a design, its parameters, and both models by the general path."""
    p = factor * compiled.parameters.nominal
    slots = compiled.parameters.slot_values(p[None])[0]
    robot = changed(compiled.robot, compiled.parameters, slots)
    q, v, a, tau = random_states(robot, 5, seed)
    return {
        "q": q, "v": v, "a": a, "tau": tau, "p": np.tile(p, (5, 1)),
        "idm": hybridyn.idm(robot, q, v, a), "ddm": hybridyn.ddm(robot, q, v, tau),
    }  # fmt: skip


def agrees(
    compiled: hybridyn.CompiledRobot, fresh: hybridyn.HybridRobot, p: Any, effects: Any = "default"
) -> None:
    """Compare both models at a design with a robot that is built with its numbers."""
    q, v, a, tau = random_states(fresh, 4)
    for model, last in (("idm", a), ("ddm", tau)):
        wanted = getattr(hybridyn, model)(fresh, q, v, last, effects=effects)
        close_to(getattr(compiled, model)(q, v, last, parameters=p), wanted, AGREE)


def test_a_position_may_move_a_slide_off_the_line_of_its_rod() -> None:
    """The rod's turns move its end along the rod then, too."""
    description = rods.two_legs(0, free=True)
    robot, (slide,) = build_robot(description), description.motors
    parameters = Parameters(description, [f"position:{slide}"])
    slots = parameters.slot_values(parameters.nominal[None] + 0.01)[0]
    model = function_of(programs(robot, models=("idm",), parameters=parameters.slots)["idm"])
    other = changed(robot, parameters, slots)
    q, v, a, _ = (x[0] for x in random_states(other, 1, 0))
    tau, guard = model(q, v, a, slots)
    assert guard <= 1
    close_to(tau.full().ravel(), hybridyn.idm(other, q, v, a), AGREE)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_written_models_take_the_numbers_of_a_design(name: str) -> None:
    """Without a compiler: the programs' graphs."""
    robot = build_robot(shipped(name))
    parameters = Parameters(robot.description, CASES[name])
    functions = {
        model: function_of(program)
        for model, program in programs(robot, models=("idm", "ddm"), parameters=parameters.slots).items()
    }
    slots = parameters.slot_values(1.04 * parameters.nominal[None])[0]
    other = changed(robot, parameters, slots)
    q, v, a, tau = random_states(other, 4)
    for model, last in (("idm", a), ("ddm", tau)):
        wanted = getattr(hybridyn, model)(other, q, v, last)
        rows = [functions[model](*state, slots) for state in zip(q, v, last, strict=True)]
        if "placement" in " ".join(CASES[name]) and name == "five_bar":
            continue  # turned: its loops close nowhere, and the guard says so
        close_to(np.array([np.array(row[0]).ravel() for row in rows]), wanted, AGREE)
        assert max(float(row[1]) for row in rows) <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", FEW)
def test_a_batch_has_a_design_for_each_sample(name: str) -> None:
    compiled = hybridyn.compile(hybridyn.load(name), parameters=FEW[name])
    parts = [states(compiled, factor, seed) for seed, factor in enumerate((1.0, 1.06, 0.95))]
    many = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    q, v, p = many["q"], many["v"], many["p"]
    efforts = compiled.idm(q, v, many["a"], parameters=p)
    close_to(efforts, many["idm"], AGREE)
    close_to(compiled.ddm(q, v, many["tau"], parameters=p), many["ddm"], AGREE)
    assert compiled.recomputed == 0
    same_bits(compiled.idm(q[-1], v[-1], many["a"][-1], parameters=p[-1]), efforts[-1])
    same_bits(compiled.idm(q[-5:], v[-5:], many["a"][-5:], parameters=p[-1]), efforts[-5:])
    close_to(compiled.idm(q[:5], v[:5], many["a"][:5]), parts[0]["idm"], AGREE)
    again = pickle.loads(pickle.dumps(compiled))
    same_bits(again.idm(q, v, many["a"], parameters=p), efforts)


@pytest.mark.slow
def test_arguments_of_a_xacro_file_are_expanded_for_each_design() -> None:
    robot = hybridyn.load("five_bar")
    compiled = hybridyn.compile(robot, parameters=["upper_length", "tool_mass"])
    designs = np.array([[0.27, 0.7], [0.25, 0.4]])
    for length, mass in designs:
        given = {"upper_length": str(length), "tool_mass": str(mass)}
        agrees(compiled, hybridyn.load("five_bar", xacro_args=given), [length, mass])
    assert compiled.recomputed == 0


@pytest.mark.slow
def test_samples_of_another_structure_go_to_the_general_path() -> None:
    """A wrist that no longer meets in one point is not cut: its robot has other equations."""
    compiled = hybridyn.compile(hybridyn.load("gough_stewart"), parameters=["position:m1_leg1_wrist_x"])
    p = compiled.parameters.nominal + np.array([0.0, 0.02, 0.03])
    slots = compiled.parameters.slot_values(p[None])[0]
    other = changed(compiled.robot, compiled.parameters, slots)
    q, v, a, _ = random_states(other, 3)
    close_to(compiled.idm(q, v, a, parameters=p), hybridyn.idm(other, q, v, a), AGREE)
    assert compiled.recomputed == len(q)


@pytest.mark.slow
def test_wrong_arguments_are_named() -> None:
    robot = hybridyn.load("five_bar")
    rest = robot.home, *np.zeros((2, robot.nv))
    compiled, plain = hybridyn.compile(robot, parameters=FEW["five_bar"]), hybridyn.compile(robot)
    shape = r"parameters has shape \(2,\).*\(4,\) \(mass:m1_tool, "
    refused(lambda: compiled.idm(*rest, parameters=[1.0, 2.0]), hybridyn.TrajectoryError, shape)
    refused(lambda: plain.idm(*rest, parameters=[1.0]), hybridyn.ModelError, "has no parameters")
    unknown = partial(hybridyn.compile, robot, parameters=["mass:m1_toll"])
    refused(unknown, hybridyn.ModelError, "there is no link 'm1_toll'")


@pytest.mark.slow
@pytest.mark.parametrize("many", [False, True])
def test_springs_and_payloads_are_parameters(many: bool) -> None:
    """Against a payload and a spring that are stated with the numbers of each design, down to none at all."""
    robot = hybridyn.load("five_bar")
    joint, link = "m1_left_elbow", "m1_tool"

    def effects(p: list[float]) -> list[object]:
        moments = ((p[6], p[7], p[8]), (p[7], p[9], p[10]), (p[8], p[10], p[11]))
        return ["default", Spring({joint: p[0]}, {joint: p[1]}), Payload(link, p[2], tuple(p[3:6]), moments)]

    first = [3.0, 0.2, 0.5, 0.01, 0.02, 0.03, 0.01, 0.001, 0.0, 0.02, 0.0, 0.015]
    names = [f"spring_{x}:{joint}" for x in ("stiffness", "rest")]
    names += [f"payload_{x}:{link}" for x in ("mass", "centre", "inertia")]
    compiled = hybridyn.compile(
        hybridyn.with_effects(robot, effects(first)), effects(first), parameters=names
    )
    assert compiled.parameters.nominal.tolist() == first
    designs = [[5.0, -0.3, 1.2, 0.05, 0.0, 0.01, *(2 * x for x in first[6:])], [0.0] * 12]
    for p in designs:
        given = np.tile(p, (4, 1)) if many else np.array(p)
        agrees(compiled, hybridyn.with_effects(robot, effects(p)), given, effects(p))
    assert compiled.recomputed == 0
    motors = {name: np.linspace(0.0, 0.3, 5) for name in robot.motors}
    table = compiled.designs(designs, motors=motors)
    for p, found in zip(designs, table.tau, strict=True):
        fresh = hybridyn.with_effects(robot, effects(p))
        states = hybridyn.assemble(fresh, motors=motors)
        close_to(found, hybridyn.idm(fresh, *states, effects=effects(p)), AGREE)
    negative = partial(compiled.idm, *(x[0] for x in states), parameters=[-1.0, *first[1:]])
    refused(negative, hybridyn.ModelError, "stiffness of 'm1_left_elbow' is negative in design 0")


@pytest.mark.slow
def test_coefficients_of_friction_are_parameters() -> None:
    """The laws read the number of each sample; the general path builds the robot with it."""
    description = shipped("five_bar")
    joints = tuple(replace(j, damping=0.3) if j.name == "m1_left_elbow" else j for j in description.joints)
    robot = build_robot(replace(description, joints=joints))
    name, effects = "viscous_friction:m1_left_elbow", ["default", "viscous_friction"]
    compiled = hybridyn.compile(robot, effects, parameters=[name])
    agrees(compiled, robot.with_parameters({name: 0.8}), [0.8], effects)
    agrees(compiled, robot, None, effects)
    stated = partial(hybridyn.compile, robot, parameters=[name])
    refused(stated, hybridyn.ModelError, "'viscous_friction' does not act on the joint")


#: Coefficients of the motors of two robots.
RUBS = {"five_bar": ("radial", [2e-3, 1e-3]), "lx4": ("normal", [0.05, 0.03, 0.02, 0.04])}


def test_written_models_take_coefficients_of_load_friction() -> None:
    """Without a compiler: the programs' graphs, at coefficients that the general path is given."""
    law, p = LoadFriction({"m1_left_drive": 2e-3, "m1_left_elbow": 1e-3}, width=0.05), [5e-3, 3e-3]
    robot, on, parameters = asked_for(
        hybridyn.load("five_bar"),
        ["default", law],
        [f"load_friction_radial:{x}" for x in law.radial],
        "float64",
    )
    written = programs(robot, on, models=("idm", "ddm"), parameters=parameters.slots)
    other = ["default", LoadFriction(dict(zip(law.radial, p, strict=True)), width=0.05)]
    q, v, a, tau = (x[0] for x in random_states(robot, 1, 4))
    for model, last in (("idm", a), ("ddm", tau)):
        found, guard = function_of(written[model])(q, v, last, p)
        assert guard <= 1
        close_to(found.full().ravel(), getattr(hybridyn, model)(robot, q, v, last, effects=other), AGREE)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["five_bar", "lx4"])
def test_coefficients_of_load_friction_are_parameters(name: str) -> None:
    """Of one joint, of several, of several modules; other joints keep their numbers; zero is no friction."""
    robot, (word, numbers) = hybridyn.load(name), RUBS[name]
    table = dict(zip(robot.motors[:: len(robot.motors) // len(numbers)], numbers, strict=False))
    effects = ["default", LoadFriction(**{word: table}, width=0.05)]
    chosen = list(table)[: len(numbers) // 2 * 2 - 1]
    names = [f"load_friction_{word}:{joint}" for joint in chosen]
    compiled = hybridyn.compile(robot, effects, parameters=names)
    assert compiled.parameters.nominal.tolist() == numbers[: len(chosen)]
    for p in (2 * compiled.parameters.nominal, 0 * compiled.parameters.nominal):
        other = LoadFriction(**{word: table | dict(zip(chosen, p.tolist(), strict=True))}, width=0.05)
        agrees(compiled, robot, np.tile(p, (4, 1)), ["default", other])
    assert compiled.recomputed == 0


@pytest.mark.slow
def test_coefficients_of_load_friction_out_of_range_are_named_with_their_sample() -> None:
    table = {"m1_left_drive": 2e-3, "m1_left_elbow": 1e-3}
    description = replace(shipped("five_bar"), effects=(("load_friction", {"radial": table, "width": 0.05}),))
    robot, names = build_robot(description), [f"load_friction_radial:{joint}" for joint in table]
    compiled = hybridyn.compile(robot, "model", parameters=names)
    agrees(compiled, robot.with_parameters({names[0]: 4e-3}), [4e-3, 1e-3], "model")
    q, v, a, _ = random_states(robot, 2)
    for numbers, kind, words in (
        ([-1e-3, 0.0], hybridyn.ModelError, "radial of 'm1_left_drive' is negative in design 1"),
        ([50.0, 50.0], hybridyn.ActuationError, "may jam at sample 1: .* by [0-9.]+ times itself"),
    ):
        refused(partial(compiled.idm, q, v, a, parameters=[[2e-3, 1e-3], numbers]), kind, words)
    refused(partial(hybridyn.compile, robot, parameters=names), hybridyn.ModelError, "does not act on the")
    unknown = partial(hybridyn.compile, robot, "model", parameters=["load_friction_radial:m1_right_drive"])
    refused(unknown, hybridyn.ModelError, "there is no load friction on the joint 'm1_right_drive'")


def test_written_models_take_efficiencies_of_gears() -> None:
    """Without a compiler; what is not stated of a gear that is driven follows from its efficiency."""
    robot = hybridyn.load("five_bar")
    first, second = robot.motors
    for back, extra in ((None, []), ({first: 0.7, second: 0.6}, [f"gear_back:{second}"])):
        law, p = GearEfficiency({first: 0.95, second: 0.8}, back=back, width=0.1), [0.85, 0.3]
        effects, names = ["default", law], [f"gear_efficiency:{first}", *extra]
        stated, on, parameters = asked_for(robot, effects, names, "float64")
        written = programs(stated, on, models=("idm", "ddm"), parameters=parameters.slots)
        other = replace(law, efficiency={first: 0.85, second: 0.8}, back=back and {first: 0.7, second: 0.3})
        q, v, a, tau = (x[0] for x in random_states(robot, 1, 4))
        for model, last in (("idm", a), ("ddm", tau)):
            found, guard = function_of(written[model])(q, v, last, p[: len(names)])
            assert guard <= 1
            wanted = getattr(hybridyn, model)(robot, q, v, last, effects=["default", other])
            close_to(found.full().ravel(), wanted, AGREE)
        changed_robot = stated.with_parameters(dict(zip(names, p, strict=False)))
        close_to(hybridyn.idm(changed_robot, q, v, a, effects=["default", "gear_efficiency"]),
                 hybridyn.idm(robot, q, v, a, effects=["default", other]), AGREE)  # fmt: skip
    refused(
        partial(asked_for, robot, effects[:1], names, "float64"), hybridyn.ModelError, "no gear with losses"
    )
    designs = DesignsInSlots(stated, on, parameters)
    for number, words in (((1.1, 0.5), "efficiency of .* above 0 and at most 1, not 1.1 in design 1"),
                          ((0.5, 1.5), "back of .* must be at most 1, not 1.5 in design 1")):  # fmt: skip
        refused(partial(designs.numbers, [p, number], (2,)), hybridyn.ModelError, words)


@pytest.mark.parametrize("back", [None, 0.75])
def test_designs_state_back_where_the_effect_that_is_asked_for_does(back: float | None) -> None:
    """Though the file has the same numbers, of which it states the other ones."""
    motor = hybridyn.load("five_bar").motors[0]
    tables = {"efficiency": {motor: 0.8}} | ({} if back else {"back": {motor: 0.75}})
    robot = build_robot(replace(shipped("five_bar"), effects=(("gear_efficiency", tables),)))
    law, name = GearEfficiency({motor: 0.8}, back=back and {motor: back}), f"gear_efficiency:{motor}"
    stated, on, _ = asked_for(robot, ["default", law], [name], "float64")
    design = stated.with_parameters({name: 0.5})
    found = dict(stated_numbers(design.description))
    assert found.get(("gear_efficiency", motor, "back")) == back
    gears = at_robot(on, design).gears
    assert gears is not None
    assert gears.effect.back == law.back
    assert gears.effect.efficiency == {motor: 0.5}


def test_a_coefficient_that_reaches_zero_takes_the_static_part_along() -> None:
    robot, first, second = hybridyn.load("five_bar"), "m1_left_drive", "m1_left_elbow"
    law = LoadFriction({first: 2e-3, second: 1e-3}, static={first: 1.4}, speed={first: 0.3})
    name = f"load_friction_radial:{first}"
    stated, on, _ = asked_for(robot, ["default", law], [name], "float64")
    loaded = at_robot(on, stated.with_parameters({name: 0.0})).loaded
    assert loaded is not None
    assert loaded.joints == (second,)
    assert loaded.factor.tolist() == [1e-3]
