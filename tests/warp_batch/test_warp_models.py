"""Batches compute what compiled models compute, at the same guards; samples in doubt are NaN, and counted."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.states import any_accelerations, random_states
from hybridyn.compiled.failures import difference
from hybridyn.compiled.verifying import MODEL_AGREES
from hybridyn.scenes.references import MotorAxes
from hybridyn.structure.building import build_robot
from hybridyn.warp_batch import arrays
from tests.robots.mechanisms import KINDS, OVER_FOLDS, random_mechanism
from tests.robots.shipped import ROBOTS
from tests.support.extras import needs
from tests.support.samples import slow

wp = needs("gpu")
wp.config.log_level = wp.LOG_WARNING

SAMPLES = 12
#: Largest difference from compiled models in multiples of what one rounding of the inputs changes there, and
#: what it may be in any case: fused products and the library's sines round otherwise.
ROUNDINGS, LEAST = 100.0, 1e-13
#: Largest difference of guards: those of loops measure rounding itself.
SAME_GUARD = 1e-2
#: Closures after a walk or steps, of the module's length.
CLOSED = 1e-12

MECHANISMS = list(KINDS)[:20]
#: Their motors cannot do all that is asked: freedoms without a motor, two motors of one freedom.
NOT_CLOSED = ("serial_all", "four_bar_two_motors")
EVERY = ["five_bar", *(slow(name) for name in ROBOTS if name != "five_bar"), *map(slow, MECHANISMS)]


@lru_cache(maxsize=4)
def robot_of(name: str) -> hybridyn.HybridRobot:
    """Load a shipped robot, or draw a random mechanism."""
    return hybridyn.load(name) if name in ROBOTS else build_robot(random_mechanism(3, kind=name))


def allowed(model: Any, given: list[np.ndarray], wanted: np.ndarray) -> np.ndarray:
    """Return the difference that rounding allows at each sample: c eps times the conditioning."""
    rng = np.random.default_rng(0)
    rounded = [x * (1 + 2.0**-52 * rng.uniform(-1, 1, x.shape)) for x in given]
    return np.maximum(LEAST, ROUNDINGS * difference(model(*rounded), wanted))


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("name", EVERY)
def test_both_models_are_those_of_compile(name: str, dtype: str) -> None:
    robot = robot_of(name)
    compiled, batch = hybridyn.compile(robot, dtype=dtype), hybridyn.warp(robot, dtype=dtype, device="cpu")
    exact = hybridyn.compile(robot)
    q, v, a, tau = random_states(robot, SAMPLES)
    for model, last in (("idm", a), ("ddm", tau)):
        given = [q, v, last]
        (right,), guards = compiled.library.batch(model, *given)
        found, guard = getattr(batch, model)(*given)
        assert found.dtype == guard.dtype == np.dtype(dtype)
        assert ((guard <= 1) == (guards <= 1)).all()
        good = guard <= 1
        assert np.isnan(found[~good]).all()
        assert batch.failed.get(model, 0) == (~good).sum()
        if dtype == "float64":
            np.testing.assert_allclose(guard, guards, rtol=SAME_GUARD, atol=SAME_GUARD)
        within = np.full(SAMPLES, MODEL_AGREES[dtype])
        if dtype == "float64":
            within = allowed(getattr(exact, model), given, right)
        assert (difference(found, right)[good] <= within[good]).all()


@pytest.mark.parametrize(
    "name",
    ["five_bar", *(slow(name) for name in (*ROBOTS, *MECHANISMS) if name not in ("five_bar", *NOT_CLOSED))],
)
def test_loops_close_along_the_way_and_efforts_follow(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = robot_of(name)
    monkeypatch.setattr(arrays, "AT_ONCE", 5)  # threads close several modules one after the other
    compiled, batch = hybridyn.compile(robot), hybridyn.warp(robot, device="cpu")
    drawn = batch.random_states(SAMPLES, seed=1)
    q, v = (x.numpy() for x in drawn[:2])
    assert hybridyn.closure_residual(robot, q).max() < CLOSED
    axes = MotorAxes.of(robot)
    position, rate = np.array([axes.positions(x) for x in q]), v[:, axes.columns]
    acceleration = np.random.default_rng(0).normal(size=rate.shape)
    *found, guard = batch.close(position, rate, acceleration)
    assert (guard <= 1).all()
    assert hybridyn.closure_residual(robot, found[0]).max() < CLOSED
    for one, other in zip(found, (q, v), strict=False):  # as they were drawn
        np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(other).max())
    tau, *same, _ = batch.idm_from_motors(position, rate, acceleration)
    right, _ = batch.idm(*found)
    assert difference(tau, right).max() < 1e-9  # the loops' rates are closed to 1e-11
    for one, other in zip(found, same, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(one).max())
    for t in range(3):
        wanted = compiled.close(position[t], rate[t], acceleration[t])
        for one, other in zip(found, wanted, strict=True):
            assert np.abs(one[t] - other).max() <= 1e-9 * max(np.abs(other).max(), 1.0)


@pytest.mark.parametrize("name", ["five_bar", slow("lx4")])
def test_functions_close_loops_as_kernels_do(name: str) -> None:
    """They close one module after the other, in the thread of the sample."""
    robot, n = robot_of(name), 8
    batch = hybridyn.warp(robot, device="cpu")
    efforts, rows = batch.functions.idm_from_motors, wp.array2d(dtype=wp.float64)

    @wp.kernel(module="unique", enable_backward=False)
    def followed(
        near: rows, position: rows, rate: rows, acceleration: rows,
        q: rows, v: rows, a: rows, tau: rows, worst: wp.array(dtype=wp.float64),
    ):  # type: ignore[no-untyped-def] # fmt: skip
        i = wp.tid()
        worst[i] = efforts(near[i], position[i], rate[i], acceleration[i], q[i], v[i], a[i], tau[i])

    motion = np.random.default_rng(0).normal(size=(3, n, len(robot.motors)))
    motion[0] = robot.home[robot.motor_q] + 0.02 * motion[0]
    given = [wp.array(x, dtype=wp.float64, device="cpu") for x in (np.tile(robot.home, (n, 1)), *motion)]
    widths = (robot.nq, robot.nv, robot.nv, len(robot.motors))
    out = [wp.zeros((n, width), dtype=wp.float64, device="cpu") for width in widths]
    worst = wp.zeros(n, dtype=wp.float64, device="cpu")
    wp.launch(followed, dim=n, inputs=[*given, *out, worst], device="cpu")
    right, *moved, guard = batch.idm_from_motors(*motion)
    for one, other in zip(out, (*moved, right), strict=True):
        np.testing.assert_allclose(one.numpy(), other, rtol=0, atol=1e-9 * np.abs(other).max())
    assert max(guard.max(), worst.numpy().max()) <= 1


def test_no_posture_of_another_branch_comes_back() -> None:
    robot = robot_of("loop_universal")
    batch = hybridyn.warp(robot, device="cpu")
    q, *_, guard = batch.close(OVER_FOLDS)
    assert (guard <= 1).tolist() == [True, False]
    assert np.isnan(q[1]).all()
    home = MotorAxes.of(robot).positions(robot.home)
    ways = [np.linspace(home, end, 100) for end in OVER_FOLDS]  # so finely that rows cannot be confused
    right, *_ = hybridyn.assemble(robot, motors=dict(zip(robot.motors, ways[0].T, strict=True)))
    np.testing.assert_allclose(q[0], right[-1], atol=1e-10)
    with pytest.raises(hybridyn.AssemblyError):
        hybridyn.assemble(robot, motors=dict(zip(robot.motors, ways[1].T, strict=True)))


@pytest.mark.slow
def test_modules_come_as_near_to_folds_as_the_general_path() -> None:
    robot = robot_of("lx4")
    wide = np.random.default_rng(7).uniform(-0.1, 0.1, (1000, len(robot.motors)))[[240, 799]]
    position = robot.home[robot.motor_q] + wide
    q, *_, guard = hybridyn.warp(robot, device="cpu").close(position)
    assert (guard <= 1).all()
    for x, found in zip(position, q, strict=True):
        motors = dict(zip(robot.motors, x[:, None], strict=True))
        right, *_ = hybridyn.assemble(robot, motors=motors, guess=robot.home)
        np.testing.assert_allclose(found, right[0], atol=1e-10)


def test_motors_that_depend_on_each_other_do_not_close_loops() -> None:
    batch = hybridyn.warp(robot_of("four_bar_two_motors"), device="cpu")
    for call in (lambda: batch.close([[0.1, 0.1]]), lambda: batch.random_states(2)):
        with pytest.raises(hybridyn.SingularityError, match="its motors depend on each other") as refused:
            call()
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", EVERY)
def test_bodies_move_as_the_kinematics_of_the_general_path_say(name: str) -> None:
    robot = robot_of(name)
    q, v, a, _ = random_states(robot, 4)
    found, guard = hybridyn.warp(robot, device="cpu").kinematics(q, v, a)
    (right,), _ = hybridyn.compile(robot).library.batch("kinematics", q, v, a)
    np.testing.assert_allclose(found, right, atol=1e-12)
    assert (guard <= 1).all()


def test_samples_in_doubt_are_nan_counted_and_computed_by_the_general_path_where_asked() -> None:
    robot = robot_of("five_bar")
    batch = hybridyn.warp(robot, device="cpu")
    q, v, a, tau = random_states(robot, 4)
    opened = q.copy()
    opened[1] += 1e-9  # open by more than rounding: the models refuse, the general path does not
    found, guard = batch.ddm(opened, v, tau)
    assert np.isnan(found[1]).all()
    assert not np.isnan(found[[0, 2, 3]]).any()
    assert not guard[1] <= 1
    assert batch.failed == {"ddm": 1}
    found, guard = batch.ddm(opened, v, tau, fallback=True)
    np.testing.assert_allclose(found[1], hybridyn.ddm(robot, opened[1], v[1], tau[1]))
    assert not guard[1] <= 1
    tau_of, _ = batch.idm(opened, v, a, fallback=True)
    np.testing.assert_allclose(tau_of[1], hybridyn.idm(robot, opened[1], v[1], a[1], passive="given"))
    q[2] = np.nan
    found, guard = batch.ddm(q, v, tau)
    assert np.isnan(found[2]).all()
    assert np.isnan(guard[2])
    assert batch.failed["ddm"] == 3
    with pytest.raises(hybridyn.TrajectoryError, match="finite"):
        batch.kinematics(q, v, a, fallback=True)
    with pytest.raises(hybridyn.TrajectoryError, match="finite"):
        batch.ddm(q, v, tau, fallback=True)


def test_closing_falls_back_to_assembling() -> None:
    robot = robot_of("five_bar")
    batch = hybridyn.warp(robot, device="cpu")
    near = robot.home + 1e-3  # open: the walk begins from a closed posture
    position = np.tile(robot.home[robot.motor_q], (2, 1))
    wide = position + np.array([[0.0, 0.0], [-3.0, 3.0]])
    *_, guard = batch.close(wide)
    assert (guard <= 1).tolist() == [True, False]
    with pytest.raises(hybridyn.AssemblyError):
        batch.close(wide, fallback=True)
    assert batch.failed["close"] == 2
    q, *_, guard = batch.close(position, near=near, fallback=True)
    assert (guard <= 1).all()
    np.testing.assert_allclose(q[0], robot.home, atol=1e-10)


def test_parameters_of_each_sample_are_those_of_compile() -> None:
    robot = hybridyn.load("five_bar")
    names = tuple(f"mass:{link.name}" for link in robot.description.links if link.mass)[-2:]
    batch = hybridyn.warp(robot, parameters=names, device="cpu")
    compiled = hybridyn.compile(robot, parameters=names)
    q, v, _, tau = random_states(robot, 3)
    designs = batch.parameters.nominal * [[1.0, 1.0], [1.5, 1.0], [0.5, 2.0]]
    right = compiled.ddm(q, v, tau, parameters=designs)
    for given in (designs, batch.numbers(designs)):
        np.testing.assert_allclose(batch.ddm(q, v, tau, parameters=given)[0], right, rtol=1e-10)
    np.testing.assert_allclose(batch.ddm(q, v, tau)[0], hybridyn.ddm(robot, q, v, tau), rtol=1e-10)
    moved, *_ = batch.step(q, v, 1e-3, tau=tau, parameters=designs)
    alone, *_ = batch.step(q, v, 1e-3, tau=tau)
    assert (moved[0] == alone[0]).all()
    assert (moved[1] != alone[1]).any()
    opened = q + 1e-9
    found, _ = batch.ddm(opened, v, tau, parameters=designs, fallback=True)
    np.testing.assert_allclose(found, compiled.ddm(opened, v, tau, parameters=designs), rtol=1e-9)


def test_a_moving_base_has_an_acceleration() -> None:
    robot = hybridyn.load("five_bar", base="moving")
    batch = hybridyn.warp(robot, device="cpu")
    q, v, _, tau = random_states(robot, 3)
    up = np.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0])
    for given in (None, up):
        right = hybridyn.ddm(robot, q, v, tau, base_acceleration=given)
        np.testing.assert_allclose(batch.ddm(q, v, tau, base_acceleration=given)[0], right, atol=1e-8)
    with pytest.raises(hybridyn.ModelError, match="no closed steps"):
        batch.step(q, v, 1e-3, tau=tau)


def test_joints_whose_limits_enclose_nothing_are_drawn_as_those_without() -> None:
    described = robot_of("five_bar").description
    joints = tuple(replace(joint, lower=0.0, upper=0.0) for joint in described.joints)
    drawn = hybridyn.warp(build_robot(replace(described, joints=joints)), device="cpu")._drawn
    assert drawn is not None
    home, low, high, _, low_q, high_q, _ = drawn._limits()
    np.testing.assert_allclose([home - low, high - home], np.pi)
    assert np.isinf([low_q, high_q]).all()


def test_states_are_drawn_again_outside_limits_and_in_reach_of_any_accelerations() -> None:
    robot = robot_of("five_bar")
    batch = hybridyn.warp(robot, device="cpu")
    q, v, _, failed = batch.random_states(50, seed=4)
    again = batch.random_states(50, seed=4)
    assert (q.numpy() == again[0].numpy()).all()
    assert failed == again[3] > 0
    assert (q.numpy()[:20] == batch.random_states(20, seed=4)[0].numpy()).all()  # each has its own draws
    assert not batch.failed
    for i, name in enumerate(robot.joints):
        record = robot.records[name]
        x = q.numpy()[:, robot.q_slices[i].start]
        assert record.kind == "continuous" or ((x >= record.lower) & (x <= record.upper)).all()
        assert (np.abs(v.numpy()[:, robot.v_slices[i].start]) <= record.speed_limit * (1 + 1e-12)).all()
    assert len(np.unique(q.numpy()[:, 0])) > 40
    any_a = any_accelerations(robot, q.numpy(), v.numpy())
    assert (batch.idm(q.numpy(), v.numpy(), any_a)[1] <= 1).all()
    home, rest, _, count = batch.random_states(3, tries=0)
    np.testing.assert_allclose(home.numpy(), np.tile(robot.home, (3, 1)), atol=1e-12)
    assert not rest.numpy().any()
    assert count == 0
