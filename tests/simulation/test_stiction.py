"""Joints that stick: inclines, stick-slip and loops against closed forms, energy, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import simulate
from hybridyn.dynamics.holding import Hold
from hybridyn.effects import (
    CoulombFriction,
    DirectedFriction,
    LoadFriction,
    StribeckFriction,
    ViscousFriction,
)
from hybridyn.errors import ModelError, TrajectoryError
from hybridyn.simulation.motion_law import Effort
from hybridyn.simulation.result import SimulationResult
from hybridyn.spatial import Array
from tests.effects.test_friction_statics import WELD, X, Z, linkage
from tests.effects.test_load_friction import END, LINK, SLIDE, wedge
from tests.support.comparing import refused
from tests.support.files import save

G = 9.81
TIGHT = {"rtol": 1e-10, "atol": 1e-12}
SLOW = pytest.mark.slow
EXACT = 1e-12  # of a time: bisected to rounding where nothing moves before
CLOSES = 1e-15  # a loop at rest, which every step closes again: its rounding
GROWS = 1e-9  # of the energy at the start: the method's error of a step, over some hundred steps


def block(tmp_path: Path, slope: float = 0.0) -> hybridyn.HybridRobot:
    """A block of 2 kg on an incline that falls along x."""
    text = f'<robot name="block"><link name="ground"/>{LINK.format("b", 2.0, i=0)}' + SLIDE.format(
        "x", "ground", "b", "1 0 0"
    )
    down = G * np.sin(slope), 0.0, -G * np.cos(slope)
    return hybridyn.load(save(tmp_path, text + END.format("x"), "block.urdf"), gravity=down)


def ramp(rate: float, motors: int = 1) -> Effort:
    return lambda t, q, v: np.array([rate * t] + [0.0] * (motors - 1))


WEIGHT = 2 * G * np.cos(0.3)
LAWS = {
    "coulomb": (CoulombFriction(level={"x": 0.4 * WEIGHT}), 0.4, 0.4),
    "stribeck": (StribeckFriction({"x": 0.3 * WEIGHT}, {"x": 0.4 * WEIGHT}, {"x": 1e-9}), 0.4, 0.3),
    "directed": (DirectedFriction({"x": 0.4 * WEIGHT}, {"x": 0.1 * WEIGHT}), 0.4, 0.4),
    "load": (LoadFriction(normal={"x": 0.3}, static={"x": 4 / 3}, speed={"x": 1e-9}), 0.4, 0.3),
}
FAR = 1e-4  # friction near rest lasts until the speed has passed 1e-9 m/s: that takes some 1e-5 s


@pytest.mark.parametrize("name", ["coulomb", *(pytest.param(x, marks=SLOW) for x in list(LAWS)[1:])])
def test_a_block_on_an_incline_sticks_and_starts_as_statics_say(tmp_path: Path, name: str) -> None:
    robot = block(tmp_path, 0.3)
    law, static, kinetic = LAWS[name]
    options = {"effects": ["default", law], "stiction": True}
    still = simulate(robot, [0.7], [0.0], (0.0, 1e6), method="rk4", step=1e6, **options)
    assert (still.q == 0.7).all()
    assert not still.v.any()
    assert not still.a.any()
    start = static * WEIGHT - 2 * G * np.sin(0.3)
    run = simulate(robot, [0.7], [0.0], (0.9 * start, 1.2 * start), effort=ramp(1.0), **options)
    assert abs(run.t[run.v[:, 0] == 0].max() - start) < EXACT * start
    after = 0.2 * start  # 2 v' = t - start + (static - kinetic) weight
    gained = (after**2 / 2 + (static - kinetic) * WEIGHT * after) / 2
    assert abs(run.v[-1, 0] - gained) < FAR * gained


METHODS = {
    "dopri5": {},
    "rk4": {"method": "rk4", "step": 0.07},
    "implicit": {"method": "implicit", "step": 0.07},
}


@pytest.mark.parametrize("method", ["dopri5", *(pytest.param(x, marks=SLOW) for x in list(METHODS)[1:])])
def test_a_block_slides_until_its_energy_is_spent_and_then_rests(tmp_path: Path, method: str) -> None:
    """A run that is resumed knows what slides and what rests."""
    robot, law, times = block(tmp_path), CoulombFriction(level={"x": 3.0}), np.linspace(0, 2.0, 17)
    options = {"effects": ["default", law], "stiction": True, **METHODS[method]}
    run = simulate(robot, [0.0], [1.2], times, **options)
    assert np.abs(run.v[:, 0] - np.maximum(1.2 - 1.5 * run.t, 0.0)).max() < GROWS
    assert not run.v[run.t > 0.81].any()
    assert np.ptp(run.q[run.t > 0.81]) == 0.0
    assert abs(run.q[-1, 0] - 1.2**2 / 3.0) < GROWS
    for end in (0.5, 1.5):
        simulate(robot, [0.0], [1.2], (0, end), checkpoint=tmp_path / "state", **options)
        again = simulate(robot, None, None, (0, 2.0), resume=tmp_path / "state", **options)
        assert abs(again.q[-1, 0] - run.q[-1, 0]) < GROWS
        assert not again.v[-1].any()


@SLOW
@pytest.mark.parametrize(("speed", "bound"), [(1e-6, 2e-4), (1e-12, 2e-8)])
def test_a_block_that_a_spring_pulls_slips_in_periods(tmp_path: Path, speed: float, bound: float) -> None:
    """2 A / V + 2 (pi - atan(A w / V)) / w, with the stretch A lost by each slip, friction near rest apart.

    What that adds falls with the root of the Stribeck velocity.
    """
    m, k, V, static, kinetic = 2.0, 200.0, 0.1, 5.0, 3.0
    law = StribeckFriction({"x": kinetic}, {"x": static}, {"x": speed})
    run = simulate(block(tmp_path), [0.0], [0.0], (0, 1.7), effects=["default", law], stiction=True,
                   effort=lambda t, q, v: np.array([k * (V * t - q[0])]), **TIGHT)  # fmt: skip
    w, A = np.sqrt(k / m), (static - kinetic) / k
    period = 2 * A / V + 2 * (np.pi - np.arctan(A * w / V)) / w
    v = run.v[:, 0]
    starts = run.t[:-1][(v[:-1] == 0) & (v[1:] > 0)]
    starts = starts[np.insert(np.diff(starts) > period / 2, 0, True)]
    assert len(starts) == 3
    assert abs(starts[0] - static / k / V) < EXACT
    assert np.abs(np.diff(starts) - period).max() < bound


def four_bar() -> hybridyn.HybridRobot:
    return linkage(
        [("crank", "revolute", "ground", "arm", (0, 0), Z),
         ("first", "revolute", "arm", "coupler", (0.1, 0.3), Z),
         ("second", "revolute", "coupler", "ring", (0.7, 0.5), Z),
         ("rocker", "revolute", "ground", "output", (0.8, 0.0), Z)],
        [("ring", "output", (0.7, 0.5), WELD)], ["crank"],
    )  # fmt: skip


def released(run: SimulationResult) -> float:
    return float(run.t[~run.v.any(axis=1)].max())


@pytest.mark.parametrize("sign", [1.0, pytest.param(-1.0, marks=SLOW)])
def test_a_four_bar_is_released_by_the_power_that_its_joints_hold_together(sign: float) -> None:
    """The motion has one parameter: the effort times its rate is the sum of frictions times theirs."""
    robot, levels = four_bar(), {"crank": 1.0, "first": 0.7, "second": 0.4, "rocker": 1.3}
    q, v, _ = hybridyn.assemble(robot, motors={"crank": (0.0, 1.0, 0.0)})
    rates = {name: abs(v[robot.v_slices[robot.joint_index[name]]][0]) for name in levels}
    start = sum(levels[name] * rates[name] for name in levels)
    law = ["default", CoulombFriction(levels)]
    run = simulate(robot, q, 0 * v, (0.9 * start, 1.05 * start), effort=ramp(sign), effects=law,
                   stiction=True, method="rk4", step=0.15 * start)  # fmt: skip
    assert abs(released(run) - start) < EXACT * start
    assert run.v[-1] @ v * sign > 0
    assert np.array_equal(run.q[run.t <= start], np.tile(q, (int((run.t <= start).sum()), 1)))


@pytest.mark.parametrize("sign", [1.0, pytest.param(-1.0, marks=SLOW)])
def test_a_four_bar_in_plain_bearings_starts_where_the_inverse_model_drives_it(sign: float) -> None:
    robot = four_bar()
    radii = {"crank": 0.012, "first": 0.007, "second": 0.005, "rocker": 0.009}
    load = {"output": np.array([0, 0, 0, 0, 0, 12.0])}
    q, v, a = hybridyn.assemble(robot, motors={"crank": (0.0, sign * 1e-9, 0.0)})
    drive = LoadFriction(radial=radii, width=1e-13)
    needed = hybridyn.idm(robot, q, v, 0 * a, wrenches=load, effects=["default", drive])[0]
    middle = hybridyn.idm(robot, q, 0 * v, 0 * a, wrenches=load)[0]
    run = simulate(
        robot, q, 0 * v, (0.995, 1.005), wrenches=load, effects=["default", LoadFriction(radial=radii)],
        stiction=True, method="rk4", step=0.01,
        effort=lambda t, q, v: np.array([middle + t * (needed - middle)]),
    )  # fmt: skip
    assert abs(released(run) - 1.0) < 1e-9  # the rates of 1e-9 rad/s, and rounding over the margin
    assert run.v[-1] @ v > 0


@SLOW
def test_two_motions_of_a_loop_are_released_along_that_which_needs_most() -> None:
    """Of two motions the first to be released leaves one joint at rest; all such motions are tried."""
    robot = hybridyn.load("five_bar")
    rng = np.random.default_rng(5)
    names = [name for name, kind in zip(robot.joints, robot.kinds, strict=True) if kind.single]
    levels = dict(zip(names, rng.uniform(1.0, 6.0, len(names)), strict=True))
    columns = [robot.v_slices[robot.joint_index[name]].start for name in names]
    home = hybridyn.assemble(robot, motors=([0.2, 0.4], [0.0, 0.0], [0.0, 0.0]))[0]
    unit = np.eye(2).tolist()
    moved = [hybridyn.assemble(robot, motors=([0.2, 0.4], rate, [0.0, 0.0]))[1] for rate in unit]
    motions = np.array(moved)[:, columns]
    held = hybridyn.idm(robot, home, np.zeros(robot.nv), np.zeros(robot.nv))
    c = np.array([levels[name] for name in names])
    times = []
    for j in range(len(names)):
        mix = np.array([-motions[1, j], motions[0, j]])  # in which joint j rests
        for way in (mix, -mix):
            if way[0] > 1e-12:  # the first motor's effort rises
                times.append((c @ np.abs(way @ motions) + held @ way) / way[0])
    start = min(times)
    law = ["default", CoulombFriction(levels)]
    assert (held @ motions_limit(motions, c) <= 1).all()  # weight alone does not move it
    run = simulate(robot, home, np.zeros(robot.nv), (0, 1.02 * start), effort=ramp(1.0, 2), effects=law,
                   stiction=True)  # fmt: skip
    assert abs(released(run) - start) < 1e-9 * start
    rest = np.abs(run.v[-1, columns]) == 0.0
    assert rest.sum() == 1


def motions_limit(motions: Array, c: Array) -> Array:
    """Motions of power 1 along which one joint rests, as columns."""
    mixes = np.array([motions[1], -motions[0]])
    out: Array = np.concatenate([mixes, -mixes], axis=1) / np.tile(c @ np.abs(motions.T @ mixes), 2)
    return out


def test_energy_never_grows_and_a_loop_comes_to_rest_where_it_stays() -> None:
    robot = hybridyn.load("five_bar")
    names = [name for name, kind in zip(robot.joints, robot.kinds, strict=True) if kind.single]
    friction = CoulombFriction(dict.fromkeys(names, 4.0))
    q, v, _ = hybridyn.assemble(robot, motors=([0.2, 0.4], [1.5, -0.7], [0.0, 0.0]))
    run = simulate(robot, q, v, (0, 0.05), effects=["default", friction], stiction=True, rtol=1e-7, atol=1e-9)
    assert np.diff(run.energy).max() <= GROWS * run.kinetic[0]
    assert not run.v[-1].any()
    assert np.ptp(run.q[~run.v.any(axis=1)], axis=0).max() < CLOSES


def test_a_wedge_that_locks_itself_holds_its_load(tmp_path: Path) -> None:
    """Below the friction angle the cart stays under any weight, above it the block sinks."""
    for angle, holds in ((0.19, True), (0.21, False)):
        robot = wedge(tmp_path, angle, lifted=True)
        law = LoadFriction(normal={"ramp": np.tan(0.2)})
        q = hybridyn.assemble(robot, motors={"drive": (0.0, 0.0, 0.0)})[0]
        run = simulate(robot, q, np.zeros(robot.nv), (0, 0.1), effects=["default", law], stiction=True)
        assert run.v.any() != holds


def test_what_joints_hold_together_is_found_for_several_motions() -> None:
    """The part is the largest power of a motion over what resists it: all motions of one joint at rest."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        motions = rng.normal(size=(2, 5))
        load, forward, backward = rng.normal(size=2), rng.uniform(0.5, 2, 5), rng.uniform(0.5, 2, 5)
        mass = np.diag(rng.uniform(0.1, 1.0, 2))
        hold = Hold(motions.T @ mass @ motions)
        efforts = -hold.inverse @ motions.T @ mass @ load
        got = hold.share(efforts, forward, backward)
        mixes = np.concatenate(
            [np.array([motions[1], -motions[0]]), np.array([-motions[1], motions[0]])], axis=1
        )
        rates = motions.T @ mixes
        resists = forward @ np.maximum(rates, 0) + backward @ np.maximum(-rates, 0)
        expected = (load @ mixes / resists).max()
        assert abs(got.ratio - expected) < 1e-9 * expected
        assert np.abs(motions @ (got.efforts - efforts)).max() < 1e-9
        begun = hold.begin(motions.T @ mass @ load, forward, backward)
        a = motions.T @ mass @ (load + motions @ begun)
        opposed = np.where(a > 0, begun + forward, begun - backward)
        assert np.abs(opposed[np.abs(a) > 1e-9]).max(initial=0.0) < 1e-9 or expected <= 1


REFUSED = {
    "backwards": ((1.0, 0.0), {"stiction": True}, TrajectoryError, "time must rise"),
    "conserving": (
        (0.0, 1.0), {"stiction": True, "method": "conserving", "step": 0.1}, TrajectoryError,
        "has no stiction",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_runs_have_no_stiction(tmp_path: Path, name: str) -> None:
    times, options, kind, words = REFUSED[name]
    law = ["default", CoulombFriction(level={"x": 1.0})]
    refused(lambda: simulate(block(tmp_path), [0.0], [0.0], times, effects=law, **options), kind, words)


def test_a_joint_by_itself_holds_what_its_own_side_can() -> None:
    """An effort of friction that is positive resists a negative motion."""
    held = [Hold(np.eye(1)).share(np.array([x]), np.ones(1), np.full(1, 4.0)) for x in (2.0, -2.0)]
    assert [one.ratio for one in held] == [0.5, 2.0]


def test_a_load_that_hardly_exceeds_what_a_joint_holds_releases_it(tmp_path: Path) -> None:
    """By a third of a percent at the end of the step."""
    options = {"effects": ["default", CoulombFriction({"x": 3.0})], "stiction": True}
    run = simulate(block(tmp_path), [0.0], [0.0], (0, 1.0), effort=ramp(3.01), **options)
    start = 3.0 / 3.01
    assert abs(released(run) - start) < EXACT
    assert abs(run.v[-1, 0] - 3.01 * (1.0 - start) ** 2 / 4) < EXACT  # 2 v' = 3.01 (t - start)


def test_a_joint_that_would_turn_back_at_once_sticks(tmp_path: Path) -> None:
    """Its load exceeds what it holds for a nanosecond; friction must not drive it backwards then."""
    options = {"effects": ["default", CoulombFriction({"x": 3.0})], "stiction": True}
    run = simulate(block(tmp_path), [0.0], [0.0], (0, 1.0), **options,
                   effort=lambda t, q, v: np.array([3.0 * (1.0 + 1e-9) - t]))  # fmt: skip
    assert not run.v[-1].any()
    assert np.abs(run.q).max() < EXACT


def test_without_dry_friction_nothing_can_stick() -> None:
    robot = linkage([("arm", "revolute", "ground", "a", (0, 0), Z)], [], ["arm"])
    start, law = (robot.home, np.zeros(robot.nv), (0, 1)), ["default", ViscousFriction({"arm": 1.0})]
    refused(
        lambda: simulate(robot, *start, effects=law, stiction=True), ModelError, "no joint has dry friction"
    )


def sliders(names: str, level: float) -> tuple[hybridyn.HybridRobot, CoulombFriction]:
    """Sliders side by side, of 1 kg each, with equal friction."""
    rows = [(n, "prismatic", "ground", n.upper(), (0, i), X) for i, n in enumerate(names)]
    return linkage(rows, [], list(names)), CoulombFriction(dict.fromkeys(names, level))


def test_joints_that_reach_their_limits_together_start_together() -> None:
    robot, law = sliders("abc", 3.0)
    run = simulate(robot, [0.0] * 3, [0.0] * 3, (0, 6.0), effects=["inertia", law], stiction=True,
                   effort=lambda t, q, v: np.full(3, t))  # fmt: skip
    assert np.abs(run.v[-1] - 4.5).max() < 1e-11  # (t - 3)^2 / 2, from rest within 1e-12 of their limits


def test_mirrored_joints_start_at_once_although_rounding_tells_them_apart() -> None:
    eps = np.finfo(float).eps
    for behind, second in ((eps, 1.0), (1e-6, 0.0)):
        held = Hold(np.eye(2)).share(np.array([-(1 + eps), 1 - behind]), np.ones(2), np.ones(2))
        assert held.motion.tolist() == [1.0, -second]
        assert held.ratio == 1 + eps
    below = Hold(np.eye(2)).share(np.array([-(1 - eps), 1 - eps]), np.ones(2), np.ones(2))
    assert not below.motion.any()


def test_a_joint_whose_friction_is_zero_never_sticks() -> None:
    rows = [("a", "prismatic", "ground", "A", (0, 0), X), ("b", "prismatic", "A", "B", (0, 0), X)]
    robot, law = linkage(rows, [], ["b"]), CoulombFriction({"a": 0.0, "b": 3.0})
    run = simulate(robot, [0.0] * 2, [0.0] * 2, (2.9, 5.0), effects=["inertia", law], stiction=True,
                   effort=lambda t, q, v: np.array([t]))  # fmt: skip
    assert np.abs(run.v[-1] - [-2.0, 4.0]).max() < 1e-11  # they stick to each other until t = 3
    refused(lambda: simulate(robot, [0.0] * 2, [0.0] * 2, (0, 1.0), stiction=True,
                             effects=["inertia", CoulombFriction({"a": 0.0})]),
            ModelError, "no joint has dry friction")  # fmt: skip


def test_a_resumed_run_judges_its_start_anew(tmp_path: Path) -> None:
    """A joint that an event stopped stays at rest; one under another load starts at once."""
    robot, law, state = block(tmp_path), CoulombFriction({"x": 3.0}), tmp_path / "state"
    options = {"effects": ["default", law], "stiction": True}
    at_rest = hybridyn.Event("rest", lambda t, q, v: float(v[0]), terminal=True)
    simulate(robot, [0.0], [1.2], (0, 2.0), events=[at_rest], checkpoint=state, **options)
    run = simulate(robot, None, None, (0, 2.0), resume=state, **options)
    assert run.v[-1] == 0.0
    assert abs(run.q[-1, 0] - 0.48) < GROWS
    simulate(robot, [0.0], [0.0], (0, 1.0), effort=np.array([1.0]), checkpoint=state, **options)
    run = simulate(robot, None, None, (0, 2.0), effort=np.array([5.0]), resume=state, **options)
    assert abs(run.v[-1, 0] - 1.0) < GROWS
    refused(lambda: simulate(robot, None, None, (0, 2.0), resume=state, effects=["default", law]),
            TrajectoryError, "other joints that stick")  # fmt: skip
