"""Second derivatives of both models: the oracle in long double along closed paths, and what they cost."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from benchmarks.derivatives import cost_of_product
from hybridyn import effects as fx
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.second.paths import moved
from hybridyn.joints.kinds import JointKind
from hybridyn.spatial import Array, numpy_on_symbols
from hybridyn.structure.building import build_robot
from hybridyn.studies.compare.methods import Model
from tests.compiled import rods
from tests.compiled.found import Found
from tests.compiled.fuzzing import compare, drawn, shaped
from tests.compiled.second_order import ORACLE, Judge, Offs, spins_of
from tests.compiled.test_derivatives import near_a_lost_pivot
from tests.oracle import Oracle
from tests.robots.effect_cases import CASES
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.robots.shipped import shipped
from tests.support.comparing import close_to, refused, same_bits
from tests.support.files import save
from tests.support.samples import slow
from tests.support.written_out import Interpreted

#: Rounding, and the condition of loops and of the mass matrix.
ROUNDING = 1e-11
#: Of second differences of fourth order in double precision: STEP^4, and rounding over STEP^2.
DIFFERENCES, STEP = 1e-6, 3e-3
#: Weights of the differences of fourth order on five samples, over the step and over its square.
SLOPE, BEND = np.array([1, -8, 0, 8, -1]) / 12, np.array([-1, 16, -30, 16, -1]) / 12
#: Most operations of a product, as a multiple of the model.
COST = 8.0
#: Angle of both motors, turned towards each other, at which the five-bar's outer links lie on one line [rad].
LAST = 0.9350555417546272
States = tuple[Array, Array, Array]


def agree(offs: Offs) -> None:
    """Check that results agree to rounding, and derivatives to the claim."""
    assert offs.value <= ROUNDING
    assert max(offs) <= ORACLE


@pytest.mark.parametrize(
    ("model", "coordinates"),
    [("idm", "joints"), ("ddm", "motors"), slow("idm", "motors"), slow("ddm", "joints")],
)
def test_products_against_the_oracle(model: str, coordinates: str, interpreted: None) -> None:
    agree(Judge(build_robot(shipped("five_bar"))).offs(model, coordinates))


@pytest.mark.slow
@pytest.mark.parametrize("model", ["idm", "ddm"])
@pytest.mark.parametrize("name", ["gough_stewart", "delta", "rps3", "tanev", "scara_delta", "lx4"])
def test_products_of_shipped_robots_against_the_oracle(name: str, model: str, interpreted: None) -> None:
    agree(Judge(build_robot(shipped(name)), 3).offs(model, "motors"))


@pytest.mark.slow
@pytest.mark.parametrize("distance", [0.1, 0.03, 0.012])
@pytest.mark.parametrize("model", ["idm", "ddm"])
def test_products_near_a_pivot_that_vanishes(model: str, distance: float, interpreted: None) -> None:
    """Nearer ones are refused."""
    robot = build_robot(shipped("five_bar"))
    judge = Judge(robot, near=near_a_lost_pivot(robot, distance, robot.home))
    for coordinates in ("joints", "motors"):
        agree(judge.offs(model, coordinates))


@pytest.mark.slow
@pytest.mark.parametrize("distance", [0.1, 0.01, 1e-4])
def test_products_where_the_assembly_ends(distance: float, interpreted: None) -> None:
    """The five-bar's outer links close to one line: rows of condition 17 and 150; refused at 900."""
    robot, angle = build_robot(shipped("five_bar")), LAST - distance
    near = hybridyn.assemble(robot, motors=[-angle, angle], guess=robot.home)[0]
    judge = Judge(robot, near=near)
    agree(judge.offs("ddm", "joints"))
    for model in ("idm", "ddm"):
        if distance < 0.01:
            refused(partial(judge.offs, model, "motors"), hybridyn.SingularityError, "nearly vanishes")
        else:
            agree(judge.offs(model, "motors"))


#: Of drawn mechanisms: rods that spin, on a crank and on a platform, and rows that depend on others to the
#: rounding of the file; the fuzz draws all of them.
DRAWN = (24, 13, 42)


def driven(kind: str, seed: int) -> hybridyn.HybridRobot:
    """Return a random mechanism, or skip it if its motors are not its coordinates."""
    robot = build_robot(random_mechanism(seed, kind=kind))
    try:
        hybridyn.SecondDerivatives(robot, coordinates="motors")
    except hybridyn.ModelError as error:
        pytest.skip(str(error))
    return robot


@pytest.mark.parametrize("kind", [kind if kind == "four_bar" else slow(kind) for kind in KINDS])
def test_products_of_random_mechanisms_against_the_oracle(kind: str, interpreted: None) -> None:
    judge = Judge(driven(kind, 2), 5)
    for model in ("idm", "ddm"):
        agree(judge.offs(model, "motors"))


@pytest.mark.parametrize(
    ("model", "coordinates"), [("idm", "motors"), *(slow("ddm", over) for over in ("joints", "motors"))]
)
def test_products_of_a_rod_that_spins_against_the_oracle(
    model: str, coordinates: str, interpreted: None
) -> None:
    """One of the drawn mechanisms."""
    description, base = drawn(DRAWN[0])
    agree(Judge(build_robot(description, base=base), DRAWN[0]).offs(model, coordinates))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*DRAWN, *range(8)])
def test_drawn_mechanisms_against_the_oracle(seed: int, interpreted: None) -> None:
    """Over joints and over motors, which rods follow whose spins keep their rates."""
    found = Found()
    compare(seed, found, "second")
    assert found.wrong == []
    assert seed not in DRAWN or found.count["idm over motors"] == 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_copies_against_the_oracle(seed: int, interpreted: None) -> None:
    """Modules that share code, mirrored and turned."""
    found = Found()
    compare(seed, found, "second_repeated")
    assert found.wrong == []
    assert found.count["idm over joints"] == 1


@pytest.mark.parametrize("name", [slow("rps3"), slow("gough_stewart"), "five_bar"])
def test_turning_joints_move_as_in_pinocchio(name: str, interpreted: None) -> None:
    """On a floating base: differences of the written model along `integrate` and straight rates."""
    robot = build_robot(shipped(name), base="floating")
    q, v, a, _ = (x[0] for x in random_states(robot, 1))
    random, model = np.random.default_rng(2), Interpreted(robot, ("idm",))
    d = random.normal(size=(3, robot.nv))
    steps = STEP * np.arange(-2, 3)
    rows = [(pin.integrate(robot.model, q, s * d[0]), v + s * d[1], a + s * d[2]) for s in steps]
    (tau,), _ = model.batch("idm", *map(np.array, zip(*rows, strict=True)))
    found = hybridyn.SecondDerivatives(robot).along(q, v, a, d)
    close_to(found.second, BEND @ tau / STEP**2, DIFFERENCES)
    close_to(found.first, SLOPE @ tau / STEP, DIFFERENCES)


@pytest.mark.parametrize(
    ("kind", "joint"),
    [
        ("floating", pin.JointModelFreeFlyer()),
        ("planar", pin.JointModelPlanar()),
        ("spherical", pin.JointModelSpherical()),
    ],
)
def test_a_displacement_is_that_of_pinocchio_to_second_order(kind: str, joint: pin.JointModel) -> None:
    """What is left is of third order: 1e-12 of a step of 1e-4, where the second order is 1e-8."""
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), kind)
    start, d = np.random.default_rng(0).normal(size=(2, model.nv))
    q = pin.integrate(model, pin.neutral(model), start)
    off = moved(JointKind(kind), q, 1e-4 * d) - pin.integrate(model, q, 1e-4 * d)
    assert np.abs(off).max() <= 1e-11


@pytest.mark.parametrize("coordinates", [slow("joints"), "motors"])
def test_the_first_order_is_that_of_the_jacobians(coordinates: str, interpreted: None) -> None:
    robot = build_robot(shipped("five_bar"))
    q, v, a, tau = random_states(robot, 2)
    for model, x, jacobian in (
        ("idm", a, hybridyn.idm_jacobian),
        ("ddm", tau, hybridyn.ddm_jacobian),
    ):
        J = jacobian(robot, q, v, x, coordinates=coordinates)
        second = hybridyn.SecondDerivatives(robot, model, coordinates=coordinates)
        weights = np.random.default_rng(0).normal(size=J["q"].shape[1])
        d = [np.ones(block.shape[2]) for block in J.values()]
        found, path = second.product(q, v, x, weights, d), second.along(q, v, x, d)
        for name, block in J.items():
            close_to(found.slope[name], np.einsum("i,tij->tj", weights, block), ROUNDING)
        close_to(path.first, sum(block.sum(axis=2) for block in J.values()), ROUNDING)
        H, whole = second.hessian(q, v, x, weights), np.concatenate(d)
        close_to(H, H.transpose(0, 2, 1), ROUNDING)
        close_to(H @ whole, np.concatenate([*found.product.values()], axis=1), ROUNDING)
        close_to(path.second @ weights, whole @ H @ whole, ROUNDING)


def test_rates_in_time_of_elastic_drives(interpreted: None) -> None:
    """Efforts along a motion that is a polynomial of the motors' time, against its differences."""
    robot = build_robot(shipped("five_bar"))
    t = STEP * np.arange(-2, 3)
    c = np.random.default_rng(1).normal(size=(6, 2)) * 0.2
    levels = [np.array([np.polynomial.Polynomial(c[:, i]).deriv(k)(t) for i in range(2)]).T for k in range(5)]
    q, v, a = hybridyn.assemble(robot, motors=tuple(levels[:3]))
    tau = hybridyn.idm(robot, q, v, a)
    second = hybridyn.SecondDerivatives(robot, coordinates="motors")
    found = second.rates(q[2], v[2], a[2], levels[3][2], levels[4][2])
    close_to(found.value, tau[2], ROUNDING)
    close_to(found.first, SLOPE @ tau / STEP, DIFFERENCES)
    close_to(found.second, BEND @ tau / STEP**2, DIFFERENCES)
    joints = hybridyn.SecondDerivatives(robot)
    jerk = SLOPE @ a / STEP
    snap = BEND @ a / STEP**2
    close_to(joints.rates(q[2], v[2], a[2], jerk, snap).second, found.second, DIFFERENCES)


def test_closed_motions_bend_as_differences_do(interpreted: None) -> None:
    """Of q, v and a over the motors' motion along a line, by the general path."""
    robot = build_robot(shipped("five_bar"))
    random = np.random.default_rng(2)
    at, d = 0.3 * random.normal(size=(3, 2)), random.normal(size=(3, 2))
    steps = STEP / 3 * np.arange(-2, 3)
    lines = tuple(x + steps[:, None] * one for x, one in zip(at, d, strict=True))
    rows = np.concatenate(hybridyn.assemble(robot, motors=lines), axis=1)
    q, v, a = np.split(rows[2], [robot.nq, robot.nq + robot.nv])
    second = hybridyn.SecondDerivatives(robot, "close", coordinates="motors")
    weights = random.normal(size=len(rows[2]))
    found = second.product(q, v, a, weights, d)
    close_to(found.value, rows[2], ROUNDING)
    slopes = np.concatenate([found.slope[name] for name in "qva"])
    close_to(slopes @ d.ravel(), weights @ second.along(q, v, a, d).first, ROUNDING)
    bend = weights @ (BEND @ rows) / (STEP / 3) ** 2
    close_to(np.concatenate([found.product[name] for name in "qva"]) @ d.ravel(), bend, 10 * DIFFERENCES)
    moving = build_robot(shipped("five_bar"), base="moving")
    refusals: list[tuple[Callable[[], object], str]] = [
        (
            lambda: hybridyn.SecondDerivatives(robot, "close"),
            "'close' need coordinates='motors', not 'joints'",
        ),
        (lambda: hybridyn.SecondDerivatives(moving, "close", coordinates="motors"), "is prescribed. Load"),
        (lambda: second.rates(q, v, a, at[0], at[0]), "rates in time are those of efforts"),
    ]
    for call, words in refusals:
        refused(call, hybridyn.ModelError, words)
    refused(lambda: second.product(q, v + 0.1, a, weights, d), hybridyn.TrajectoryError, "v differs by")


def spinning(robot: hybridyn.HybridRobot, motors: Array, spin: float, t: float, near: Array) -> States:
    """Return q, v, a of motors' positions, rates and accelerations, and of a rod that spins for a time t."""
    oracle = Oracle(robot.description, robot.base)
    ((own, n),) = spins_of(oracle, near)
    q, v, a = (x[0] for x in hybridyn.assemble(robot, motors=tuple(motors[:, None]), guess=near))
    turn = np.zeros(robot.nv)
    turn[own] = n * spin * t
    q = pin.integrate(robot.model, q, turn)
    Z, u = oracle.motions(q), robot.motor_v

    def with_spin(x: Array, level: int, share: float) -> Array:
        """Return rates or accelerations with those of the motors, and of the spin."""
        lacks = np.append(motors[level] - x[u], share - n @ x[own])
        return np.asarray(x + Z @ np.linalg.solve(np.vstack([Z[u], n @ Z[own]]), lacks))

    v = with_spin(oracle.project_velocity(q, v), 1, spin)
    return q, v, with_spin(oracle.consistent_acceleration(q, v, a), 2, 0.0)


@pytest.mark.slow
def test_rates_in_time_beside_a_spin(interpreted: None) -> None:
    """A rod without symmetry about its line spins on: efforts change with its turn."""
    robot = build_robot(shaped(rods.crank(3, "ball"), np.random.default_rng(1), "askew"))
    n, t = len(robot.motors), STEP * np.arange(-2, 3)
    c = np.random.default_rng(1).normal(size=(6, n)) * 0.2
    polynomials = [np.polynomial.Polynomial(c[:, i]) for i in range(n)]
    c[0] += robot.home[robot.motor_q]
    levels = [np.array([p.deriv(k)(t) for p in polynomials]).T for k in range(5)]
    near = hybridyn.assemble(robot, motors=tuple(x[2:3] for x in levels[:3]), guess=robot.home)[0][0]
    for spin in (2.0, 0.0):
        states = [spinning(robot, np.array([x[k] for x in levels[:3]]), spin, t[k], near) for k in range(5)]
        tau = np.array([hybridyn.idm(robot, *state) for state in states])
        second = hybridyn.SecondDerivatives(robot, coordinates="motors")
        found = second.rates(*states[2], levels[3][2], levels[4][2])
        close_to(found.value, tau[2], ROUNDING)
        close_to(found.first, SLOPE @ tau / STEP, DIFFERENCES)
        close_to(found.second, BEND @ tau / STEP**2, DIFFERENCES)


@pytest.mark.parametrize(
    "name", ["five_bar", *map(slow, ("gough_stewart", "delta", "rps3", "tanev", "lx4", "snake"))]
)
@pytest.mark.parametrize(
    ("model", "coordinates"),
    [("ddm", "joints"), *(slow(*one) for one in (("idm", "motors"), ("idm", "joints"), ("ddm", "motors")))],
)
def test_a_product_costs_at_most_eight_models(name: str, model: Model, coordinates: str) -> None:
    assert cost_of_product(build_robot(shipped(name)), model, coordinates) <= COST


@pytest.mark.slow
@pytest.mark.parametrize("name", ["five_bar", "gough_stewart", "lx4"])
@pytest.mark.parametrize("model", ["idm", "ddm"])
def test_c_threads_and_single_samples(name: str, model: str) -> None:
    robot = hybridyn.load(name)
    q, v, a, tau = random_states(robot, 3)
    x = a if model == "idm" else tau
    for coordinates in ("joints", "motors"):
        second = hybridyn.SecondDerivatives(robot, model, coordinates=coordinates, threads=2)
        n = len(robot.motors) if coordinates == "motors" else robot.nv
        d = [np.ones(n), np.ones(n), np.ones(len(robot.motors) if model == "ddm" else n)]
        weights = np.arange(1.0, 1 + (robot.nv if model == "ddm" and n == robot.nv else len(robot.motors)))
        second._products.wait_until_compiled()  # what is said to take more than half a minute is built beside
        assert second._products.library is not None
        many = second.product(*(np.tile(y, (500, 1)) for y in (q, v, x)), weights, d)
        one = second.product(q[1], v[1], x[1], weights, d)
        same_bits(one.product, {key: block[1] for key, block in many.product.items()})
        same_bits(one.product, {key: block[-2] for key, block in many.product.items()})


SMOOTH = [
    "rotor_inertia", "viscous_friction", "stribeck_friction", "spring", "polynomial_spring", "bushings",
    "gravity_compensation",
]  # fmt: skip


@pytest.mark.parametrize("law", ["coulomb_friction", *map(slow, SMOOTH)])
def test_smooth_effects_are_among_the_forces(law: str, interpreted: None) -> None:
    robot = build_robot(shipped("five_bar"))
    on = ["default", *CASES[law](robot)]
    q, v, a, _ = (x[0] for x in random_states(robot, 1))
    second = hybridyn.SecondDerivatives(robot, effects=on, coordinates="motors")
    d = np.random.default_rng(3).normal(size=(3, 2))
    found = second.along(q, v, a, d)
    at, step = (q[robot.motor_q], v[robot.motor_v], a[robot.motor_v]), STEP / 3
    levels = tuple(x + step * np.arange(-2, 3)[:, None] * one for x, one in zip(at, d, strict=True))
    tau = hybridyn.idm(robot, *hybridyn.assemble(robot, motors=levels, guess=q), effects=on)
    close_to(found.second, BEND @ tau / step**2, 10 * DIFFERENCES)
    plain = hybridyn.SecondDerivatives(robot, coordinates="motors").along(q, v, a, d)
    assert law in ("rotor_inertia", "spring", "viscous_friction") or (
        np.abs(plain.second - found.second).max() > 1e-6 * np.abs(found.second).max()
    )


HANGING = """<robot name="hanging"><link name="base"/>
<link name="rod"><inertial><origin xyz="0 0 -0.1"/><mass value="2"/>
<inertia ixx="0.03" iyy="0.04" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="ball" type="spherical"><parent link="base"/><child link="rod"/></joint></robot>"""


@pytest.mark.usefixtures("by")
def test_a_spring_at_rest_is_smooth(tmp_path: Path) -> None:
    """The turn along a step from rest is the step; its second derivative is of the size of the turn."""
    robot = hybridyn.load(save(tmp_path, HANGING, "hanging.urdf"), motors=[])
    q = np.array([[half, 0.0, 0.0, 1.0] for half in (0.0, 1e-17, 1e-13, 1e-9)])
    v, tau = np.zeros((len(q), 3)), np.zeros((len(q), 0))
    spring = fx.BallSpring({"ball": 100.0})
    second = hybridyn.SecondDerivatives(robot, "ddm", effects=["default", spring])
    found = second.hessian(q, v, tau, np.ones(3))
    assert np.abs(found - found[0]).max() <= 1e-8 * 100.0 / 0.02  # of stiffness over inertia


def test_without_motors_efforts_have_no_rates(tmp_path: Path, interpreted: None) -> None:
    robot = hybridyn.load(save(tmp_path, HANGING, "hanging.urdf"), motors=[])
    q, v, a = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), np.zeros(3)
    assert hybridyn.SecondDerivatives(robot).rates(q, v, a, a, a).second.shape == (0,)


@pytest.mark.parametrize("half", [0.0, 1e-17, 0.02, 0.0316, 0.0317, 0.04, 0.8])
def test_series_and_quotient_of_a_turn_meet(half: float) -> None:
    """The turn is twice x: its second derivative is zero."""
    x = ca.SX.sym("x")
    p = (1.0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1)
    with numpy_on_symbols():
        turn = fx.BallSpring().position(p, [ca.sin(x), 0.0, 0.0, ca.cos(x)])
    orders = ca.Function("orders", [x], [turn, ca.jacobian(turn, x), ca.hessian(turn, x)[0]])
    close_to([*map(float, orders(half))], [2 * half, 2.0, 0.0], 1e-13)


@pytest.mark.parametrize("names", [["mass:m1_tool"], slow(["upper_length", "mass:m1_tool"])])
@pytest.mark.parametrize("model", ["ddm", slow("idm")])
def test_a_compiled_robot_offers_them(model: str, names: list[str], interpreted: None) -> None:
    """With its effects, threads and parameters: those of a changed robot."""
    robot = hybridyn.load("five_bar")
    on = ["default", *CASES["viscous_friction"](robot)]
    fast = hybridyn.compile(robot, on, parameters=names, threads=2, wait=False)
    second = fast.second_derivatives(model, coordinates="motors")
    assert (second.threads, second.parameters.labels) == (2, fast.parameters.labels)
    p = 1.05 * second.parameters.nominal
    other = robot.with_parameters(dict(zip(names, p, strict=True)))
    q, v, a, tau = random_states(other, 2)
    given = q, v, a if model == "idm" else tau
    weights, d = [1.0, -0.5], np.random.default_rng(0).normal(size=(3, 2))
    known = hybridyn.SecondDerivatives(other, model, on, coordinates="motors")
    many = second.product(*given, weights, d, parameters=np.tile(p, (2, 1)))
    wanted = known.product(*given, weights, d)
    for found, right in zip(many, wanted, strict=True):
        close_to(found, right, ROUNDING)
    H = second.hessian(*(x[0] for x in given), weights, parameters=p)
    close_to(H, known.hessian(*(x[0] for x in given), weights), ROUNDING)
    wrong = partial(second.product, *given, weights, d, parameters=-p)
    refused(wrong, hybridyn.ModelError, "negative")


def test_what_has_no_second_derivative_is_refused(interpreted: None) -> None:
    robot = build_robot(shipped("five_bar"))
    make = partial(hybridyn.SecondDerivatives, robot)
    for law, words in (
        ("stop", "'stop' has no second derivative: its end is a kink"),
        ("polynomial_damper", "the size of the rate is a kink"),
        ("ground_contact", "the touch is a kink"),
    ):
        refused(partial(make, effects=CASES[law](robot)), hybridyn.ModelError, words)
    rope = fx.Tendons({x: {"rope": 0.1} for x in robot.motors}, {"rope": 5.0}, lower={"rope": 0.0})
    make(effects=["default", rope])  # a bound that is not stated is zero: no slack range
    rope = replace(rope, upper={"rope": 0.1})
    refused(partial(make, effects=["default", rope]), hybridyn.ModelError, "slack range is a kink")
    for call, words in (
        (partial(make, effects=["default", "limits"]), "each limit is a kink"),
        (partial(make, "kinematics"), "not of 'kinematics'"),
        (partial(make, threads=0), "threads must be at least 1"),
        (partial(make, coordinates="u"), "'joints' or 'motors', not 'u'"),
    ):
        refused(call, hybridyn.ModelError, words)
    q, v, a, _ = (x[0] for x in random_states(robot, 1))
    second, still = make(coordinates="motors"), np.zeros(2)
    refusals: list[tuple[Callable[[], object], type[Exception], str]] = [
        (lambda: second.product(q, v, a, [1.0], [still] * 3), hybridyn.TrajectoryError, "weights has shape"),
        (lambda: second.product(q, v, a, still, [still]), hybridyn.TrajectoryError, "direction has 1 parts"),
        (lambda: second.product(q, v + 0.1, a, still, [still] * 3), hybridyn.TrajectoryError, "v differs by"),
        (
            lambda: second.product(q + 0.1, v, a, still, [still] * 3),
            hybridyn.HybridynError,
            "close the loops",
        ),
        (lambda: second.rates(q, v, a, still, [np.nan, 0.0]), hybridyn.TrajectoryError, "snap is not finite"),
        (
            lambda: make("ddm").rates(q, v, a, v, v),
            hybridyn.ModelError,
            r"take SecondDerivatives\(robot, 'idm'\)",
        ),
    ]
    for call, error, words in refusals:
        refused(call, error, words)
    near = near_a_lost_pivot(robot, 1e-6)
    lost = partial(second.product, near, 0 * v, 0 * v, still, [still] * 3)
    refused(lost, hybridyn.SingularityError, "not to be trusted at sample 0: a pivot")
