"""Numbers of effects as arguments of compiled models, against effects that are built with these numbers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.coefficients import at_robot
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.programs.designs import DesignsInSlots
from hybridyn.compiled.programs.sources import asked_for
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.effects import (
    BallSpring,
    Bushings,
    CoulombFriction,
    Damper,
    DirectedFriction,
    GearEfficiency,
    GroundContact,
    LineSprings,
    LoadFriction,
    PolynomialDamper,
    PolynomialSpring,
    Spring,
    Stop,
    StribeckFriction,
    Tendons,
)  # fmt: skip
from hybridyn.errors import ModelError
from hybridyn.joints.kinds import JointKind
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from hybridyn.structure.parameters.effect_numbers import EFFECT_NUMBERS
from tests.compiled import rods
from tests.robots.mechanisms import random_mechanism
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

AGREE = 1e-12  # of the largest entry
STEP = 1e-2  # of the numbers; differences are extrapolated, and miss its fourth power
IDLE = "lower", "upper", ".roll", ".yaw", ".y"  # one end of a slack range, and ways out of the plane
SLOPES = 1e-8  # of the largest entry: the same, and rounding of efforts over the step

A, B = "m1_left_drive", "m1_left_elbow"
#: Effects of the five-bar with all of their numbers.
LAWS: dict[str, Any] = {
    "coulomb": CoulombFriction({A: 0.3, B: 0.2}, width=0.5),
    "stribeck": StribeckFriction({A: 0.3, B: 0.2}, {A: 0.5, B: 0.3}, {A: 0.7, B: 0.6}, width=0.5),
    "directed": DirectedFriction({A: 0.3, B: 0.2}, {A: 0.1, B: 0.4}, width=0.5),
    "damper": Damper({A: 0.3, B: 0.2}),
    "spring": Spring({A: 3.0, B: 2.0}, {A: 0.1, B: 0.3}),
    "stop": Stop({A: 30.0, B: 20.0}, 0.2, {A: 0.1}, {B: -0.2}),
    "polynomial spring": PolynomialSpring({A: [2.0, 0.3, 0.1], B: [1.0]}, {A: 0.1, B: 0.2}),
    "polynomial damper": PolynomialDamper({A: [0.2, 0.1], B: [0.1, 0.05]}),
    "load friction": LoadFriction(
        {A: 2e-3, B: 1e-3}, static={A: 1.4, B: 1.2}, speed={A: 0.5, B: 0.8}, width=0.3
    ),
    "tendons": Tendons(
        {A: {"t": 1.0, "u": 0.5}, B: {"t": 0.3, "u": -1.0}},
        stiffness={"t": 3.0, "u": 2.0},
        friction={"t": 0.2},
        damping={"t": 0.2, "u": 0.3},
        lower={"t": 0.5, "u": -0.8},
        upper={"t": 1.0, "u": -0.4},
        width=0.4,
    ),
    "line springs": LineSprings(
        {"l": ("m1_base", "m1_tool")},
        {"l": ((0.1, 0.2, 0.3), (0.0, 0.1, 0.0))},
        stiffness={"l": 30.0},
        damping={"l": 2.0},
        friction={"l": 0.4},
        lower={"l": 0.05},
        upper={"l": 0.1},
        width=0.3,
    ),
    "bushings": Bushings(
        {"b": ("m1_base", "m1_tool")},
        torque_stiffness={"b": [1.0, 2.0, 3.0]},
        torque_damping={"b": [0.1, 0.2, 0.3]},
        force_stiffness={"b": [4.0, 5.0, 6.0]},
        force_damping={"b": [0.4, 0.5, 0.6]},
    ),
    "ground": GroundContact({"m1_tool": ((0.0, 0.1, 0.0), (0.1, 0.0, 0.0))}, 200.0, 0.3, 0.5, 0.4, 3.0),
    "gears": GearEfficiency({A: 0.9, "m1_right_drive": 0.8}, {A: 0.7, "m1_right_drive": 0.6}, width=0.4),
}


def names_and_numbers(law: Any) -> dict[str, float | list[float]]:
    """Return the parameters of a law by name."""
    out: dict[str, Any] = {}
    for word, of in EFFECT_NUMBERS[law.name].items():
        numbers = getattr(law, word)
        kind = {"gear_efficiency": {"efficiency": "gear_efficiency", "back": "gear_back"}}.get(law.name, {})
        by_name = {law.name: numbers} if of.shared else numbers
        prefix = word if of.shared else kind.get(word, f"{law.name}_{word}")
        out |= {f"{prefix}:{name}": x for name, x in by_name.items()}
    return out


def rebuilt_law(law: Any, p: Array) -> Any:
    """Return a law with other numbers, in the order of its parameters."""
    left, fields = iter(p.tolist()), {}
    for word in EFFECT_NUMBERS[law.name]:
        numbers = getattr(law, word)
        if isinstance(numbers, Mapping):
            fields[word] = {
                name: [next(left) for _ in x] if isinstance(x, list) else next(left)
                for name, x in numbers.items()
            }
        else:
            fields[word] = next(left)
    return replace(law, **fields)


def slope_of(of: Callable[[Array], Array], p: Array, way: Array) -> Array:
    """Compute the derivative along a way by extrapolated differences, shape (n,)."""

    def quotient(h: float) -> Array:
        return (of(p + h * way) - of(p - h * way)) / (2 * h)

    return (4 * quotient(STEP / 2) - quotient(STEP)) / 3


def agree(robot: hybridyn.HybridRobot, *laws: Any, models: Sequence[str] = ("idm", "ddm")) -> None:
    """Compare written models at other numbers, and their derivatives, with the general path."""
    each = [names_and_numbers(law) for law in laws]
    named = {name: x for of in each for name, x in of.items()}
    stated, on, parameters = asked_for(robot, ["default", *laws], list(named), "float64")
    wanted = np.concatenate([np.atleast_1d(x) for x in named.values()])
    np.testing.assert_array_equal(parameters.nominal, wanted)
    written = programs(stated, on, models=tuple(models), parameters=parameters.slots)
    q, v, a, tau = (x[0] for x in random_states(robot, 1, 4))
    random = np.random.default_rng(0)
    p = wanted * random.uniform(0.97, 1.03, len(wanted))
    way = p * random.uniform(0.5, 1.0, len(p))
    ends = np.cumsum([sum(map(np.size, of.values())) for of in each])[:-1]

    def rebuilt(p: Array) -> list[Any]:
        """Return the laws with other numbers."""
        return ["default", *map(rebuilt_law, laws, np.split(p, ends))]

    for model in models:
        of, last = function_of(written[model]), a if model == "idm" else tau

        def general(p: Array, model: str = model, last: Array = last) -> Array:
            found: Array = getattr(hybridyn, model)(robot, q, v, last, effects=rebuilt(p))
            return found

        found, guard = of(q, v, last, p)
        assert guard <= 1
        close_to(found.full().ravel(), general(p), AGREE)
        symbol = ca.SX.sym("p", len(p))
        slopes = ca.Function("slopes", [symbol], [ca.jacobian(of(q, v, last, symbol)[0], symbol)])(p).full()
        counts = dict(zip(parameters.labels, np.abs(slopes).max(axis=0) > 0, strict=True))
        assert all(counts[x] for x in counts if not any(word in x for word in IDLE)), counts
        close_to(slopes @ way, slope_of(general, p, way), SLOPES)
    changed = stated.with_parameters(_by_name(named, p))
    wanted = hybridyn.ddm(robot, q, v, tau, effects=rebuilt(p))
    for effects in (at_robot(on, changed), ["default", *(law.name for law in laws)]):
        close_to(hybridyn.ddm(changed, q, v, tau, effects=effects), wanted, AGREE)


def _by_name(named: Mapping[str, Any], p: Array) -> dict[str, Any]:
    """Return numbers by the names of parameters."""
    ends = np.cumsum([np.size(x) for x in named.values()])[:-1]
    return dict(zip(named, np.split(p, ends), strict=True))


#: Laws whose numbers are arguments of one model.
TOGETHER = "stribeck", "stop", "gears", "line springs"


@pytest.mark.parametrize(
    "laws",
    [TOGETHER, ("load friction",), *(slow((x,)) for x in sorted(LAWS.keys() - {"load friction"}))],
    ids=", ".join,
)
def test_every_number_of_an_effect_is_a_parameter(laws: Sequence[str]) -> None:
    agree(hybridyn.load("five_bar"), *(LAWS[law] for law in laws))


@pytest.mark.parametrize("name", ["rps3", *map(slow, ("ball_gough", "gough_stewart", "lx4"))])
def test_numbers_of_joints_in_legs_and_in_several_modules_are_parameters(name: str) -> None:
    """Slides of equal legs, each with its own numbers, balls, and modules that feel each other."""
    robot = build_robot(rods.ball_gough(2)) if name == "ball_gough" else hybridyn.load(name)
    joints = robot.motors[:: len(robot.motors) // 2][:2]
    near_rest = {"static": dict(zip(joints, (1.4, 1.2), strict=True)), "speed": dict.fromkeys(joints, 0.5)}
    laws: list[Any] = [
        LoadFriction(normal=dict(zip(joints, (0.05, 0.03), strict=True)), **near_rest, width=0.3)
    ]
    if name == "ball_gough":
        laws.append(BallSpring({"b6_lower": 3.0, "j1_lower": 2.0}))
    agree(robot, *laws)


def test_numbers_of_laws_in_a_ball_are_parameters() -> None:
    """Its spin is not driven: few accelerations are possible, and only the direct model is asked."""
    robot = build_robot(random_mechanism(0, kind="rssr"))
    (ball,) = (n for n, k in zip(robot.joints, robot.kinds, strict=True) if k is JointKind.SPHERICAL)
    rubs = LoadFriction({ball: 2e-3}, static={ball: 1.3}, speed={ball: 0.4}, width=0.3)
    agree(robot, rubs, BallSpring({ball: 3.0}), models=("ddm",))


def test_wrong_numbers_are_named_with_their_design() -> None:
    robot = hybridyn.load("five_bar")
    for law, index, number, words in (
        ("stribeck", 0, 0.9, "level of 'm1_left_drive' must be at most static, not 0.9 in design 1"),
        ("stribeck", 2, 0.2, "level of 'm1_left_drive' must be at most static, not 0.3 in design 1"),
        ("stribeck", 4, 0.0, "speed of 'm1_left_drive' must be above 0, not 0 in design 1"),
        ("coulomb", 2, 0.0, "width of 'coulomb_friction' must be above 0, not 0 in design 1"),
        ("load friction", 2, 0.9, "static of 'm1_left_drive' must be at least 1, not 0.9 in design 1"),
        ("stop", 4, -1.0, "damping of 'stop' is negative in design 1"),
        ("stop", 2, 2.0, "lower of 'm1_left_drive' must be at most upper, not 2 in design 1"),
        ("tendons", 8, -1.0, "lower of 'u' must be at most upper, not -0.8 in design 1"),
    ):
        named = names_and_numbers(LAWS[law])
        stated, on, parameters = asked_for(robot, ["default", LAWS[law]], list(named), "float64")
        wrong = parameters.nominal.copy()
        wrong[index] = number
        numbers = partial(DesignsInSlots(stated, on, parameters).numbers, [parameters.nominal, wrong], (2,))
        refused(numbers, ModelError, words)
    for effects, name, words in (
        ([Damper({A: 1.0}), Damper({A: 2.0})], f"damper_coefficient:{A}", "several effects 'damper' act"),
        ([Spring({A: 1.0}), Spring({A: 2.0})], f"spring_stiffness:{A}", "several effects 'spring' act"),
        (
            [CoulombFriction({A: 1.0}), CoulombFriction({B: 1.0}, 0.1)],
            "width:coulomb_friction",
            "several effects 'coulomb_friction' act",
        ),
        ([GearEfficiency({A: 0.9})], f"gear_back:{A}", f"there is no gear with 'back' at the motor '{A}'"),
        ([Damper({A: 1.0})], "width:damper", "there is no stated 'width' of the effect 'damper'"),
    ):
        refused(partial(asked_for, robot, ["default", *effects], [name], "float64"), ModelError, words)
