"""Control steps: efforts from what the motors do, as closing the loops and the inverse model give them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hybridyn
from benchmarks.operations import flattened
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.library.direct_calls import readable
from hybridyn.compiled.programs.inverse import inverse_program
from hybridyn.compiled.programs.whole_robot import function_of
from hybridyn.description import Coupling, Joint
from hybridyn.structure.building import build_robot
from tests.assembly.test_assembly import stretched, waves
from tests.compiled.test_robust import robot_of
from tests.dynamics.test_idm import symmetric_five_bar
from tests.support.comparing import close_to, same_bits, same_words
from tests.support.samples import slow

SAME = 1e-12  # of the largest effort: rounding
GUARDED = 1.2  # operations of the inverse model over those without its guard
LATER = ("gough_stewart", "lx4", "delta", "tanev", "rps3", "stewart_ur5")
ROBOTS = ["five_bar", *map(slow, LATER)]


def motion(robot: hybridyn.HybridRobot, count: int) -> list[Any]:
    """Return positions, rates and accelerations of the motors at every tick, shape (count, motors) each."""
    moved = waves(robot, 1e-3 * np.arange(count), 0.02)
    return [np.stack([moved[m][i] for m in robot.motors], axis=1) for i in range(3)]


def at_home(robot: hybridyn.HybridRobot) -> Any:
    """Return the first tick of `motion`."""
    return motion(robot, 1)[0][0]


@pytest.mark.parametrize("name", ROBOTS)
def test_efforts_are_those_of_two_calls(name: str) -> None:
    """Ticks one after the other; positions have the same bits, efforts those of the general path."""
    robot = hybridyn.load(name)
    compiled, ticks = hybridyn.compile(robot), [*zip(*motion(robot, 12), strict=True)]
    compiled.idm_from_motors(*ticks[0])  # from here on the first tick, too, is closed in C
    apart: list[Any] = []
    for tick in ticks:
        apart.append(compiled.close(*tick, last=apart[-1][0] if apart else None))
    last = None
    for tick, right in zip(ticks, apart, strict=True):
        tau, *state = compiled.idm_from_motors(*tick, last=last)
        same_bits(tuple(state), right)
        close_to(tau, compiled.idm(*right), SAME)
        close_to(tau, hybridyn.idm(robot, *right), 100 * SAME)
        last = state[0]
    assert compiled.recomputed == 0


@pytest.fixture(scope="module")
def five_bar() -> hybridyn.CompiledRobot:
    """Return a compiled five-bar whose control step is built."""
    compiled = hybridyn.compile(hybridyn.load("five_bar"))
    compiled.idm_from_motors(at_home(compiled.robot))
    return compiled


def test_rows_follow_one_another(five_bar: hybridyn.CompiledRobot) -> None:
    given = motion(five_bar.robot, 5)
    tau, *state = five_bar.idm_from_motors(*given)
    assert tau.shape == (5, 2)
    same_bits((tau, *state), (five_bar.idm(*state), *five_bar.close(*given)))


def test_a_step_moves_to_the_library_that_is_taken_into_use(five_bar: hybridyn.CompiledRobot) -> None:
    held, asked = five_bar._models.control_at_once, []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(type(five_bar._control), "_control", lambda self: asked.append(self) or held)
        five_bar.idm_from_motors(at_home(five_bar.robot))
        assert not asked
        five_bar._models.current.take(five_bar.library)
        five_bar.idm_from_motors(at_home(five_bar.robot))
        five_bar.idm_from_motors(at_home(five_bar.robot))
    assert len(asked) == 1


def single(x: np.ndarray) -> np.ndarray:
    return x.astype(np.float32)


def strided(x: np.ndarray) -> np.ndarray:
    return np.stack([x, np.zeros_like(x)], axis=1)[:, 0]


@pytest.mark.parametrize("call", ["close", "idm_from_motors"])
@pytest.mark.parametrize("form", [strided, single, np.ndarray.tolist, tuple])
def test_numbers_in_other_forms_are_closed_in_c_too(
    five_bar: hybridyn.CompiledRobot, form: Any, call: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They give the bits of contiguous double precision, and the general path is never asked."""
    step, home = getattr(five_bar, call), at_home(five_bar.robot)
    q = step(home)[-3]
    step(home, last=q)
    given = [single(home + 1e-3).astype(float), single(np.ones(2)).astype(float), np.zeros(2)]
    wanted = step(*given, last=q)

    def general(*_: object) -> Any:
        """Fail where the loops are not closed at once."""
        raise AssertionError("the general path was asked")

    monkeypatch.setattr(five_bar, "assemble_requests", general)
    last = q if form is single else form(q)  # in single precision the loops of q are open
    found = step(*map(form, given), last=last)
    same_bits(found, wanted)


def test_what_is_no_number_is_left_to_the_general_path() -> None:
    x = np.zeros(2)
    assert readable(x, x) is None
    assert readable(x, [0.0, [1.0]]) is None
    for no in (
        x + 0j,
        x.astype(bool),
        np.ma.array(x),
        x.astype(str),
        x.astype(object),
        ["1", "2"],
        1.0,
        None,
    ):
        assert readable(strided(x), no) is None


def test_one_number_is_read_whatever_its_stride() -> None:
    """NumPy calls it contiguous: the positions of a single motor in a column of a table."""
    one = np.zeros((1, 3)).T[1]
    assert one.flags.c_contiguous
    assert one.strides == (3 * one.itemsize,)
    copies = readable(one, np.zeros(2)) or ()
    assert [x.strides for x in copies] == [(one.itemsize,)] * 2


@pytest.mark.parametrize("what", ["not finite", "too many", "infinite", slow("out of reach")])
def test_steps_that_cannot_be_made_are_refused_in_the_words_of_two_calls(
    five_bar: hybridyn.CompiledRobot, what: str
) -> None:
    home = at_home(five_bar.robot)
    position = {"not finite": home * np.nan, "out of reach": home + np.array([1e5, 0.0])}
    given = [position.get(what, home), np.ones(2), np.zeros(2)]
    if what == "too many":
        given[1] = np.ones(3)
    if what == "infinite":
        given[2] = np.array([np.inf, 0.0])
    q = five_bar.idm_from_motors(home)[1]
    same_words(
        lambda: five_bar.idm_from_motors(*given, last=five_bar.idm_from_motors(home, last=q)[1]),
        lambda: five_bar.idm(*five_bar.close(*given, last=q)),
    )


def test_a_jump_of_the_motors_stays_on_the_branch(five_bar: hybridyn.CompiledRobot) -> None:
    """Half a radian at once is divided into steps, as in `close`."""
    home = at_home(five_bar.robot)
    q = five_bar.idm_from_motors(home)[1]
    there = home + np.array([0.25, -0.25])
    tau, *state = five_bar.idm_from_motors(there, last=q)
    right = hybridyn.assemble(
        five_bar.robot, motors=dict(zip(five_bar.robot.motors, there, strict=True)), guess=q
    )
    close_to(state[0], right[0], 100 * SAME, 1.0)
    close_to(tau, hybridyn.idm(five_bar.robot, *right), 1e-10)


def test_efforts_that_are_not_certain_are_the_general_paths(
    five_bar: hybridyn.CompiledRobot, monkeypatch: Any
) -> None:
    """C that has closed the loops leaves the rest to `idm`."""
    home, closing = at_home(five_bar.robot), five_bar._postures._close_at_once

    def uncertain(last: Any, position: Any, rate: Any, acceleration: Any, out: Any) -> int:
        """Close the loops only."""
        room = np.empty(len(out) - 2)
        assert closing(last, position, rate, acceleration, room) == 0
        out[:-2] = room
        return 2

    first = five_bar.idm_from_motors(home)
    monkeypatch.setattr(five_bar._models, "control_at_once", uncertain)
    again = five_bar.idm_from_motors(home, last=first[1])
    close_to(again[0], first[0], SAME)


def test_models_that_c_does_not_step_make_two_calls() -> None:
    """Single precision."""
    robot = hybridyn.load("five_bar")
    compiled = hybridyn.compile(robot, dtype="float32")
    home = at_home(robot)
    q = compiled.idm_from_motors(home)[1]
    tau, *state = compiled.idm_from_motors(home, last=q)
    assert (tau == compiled.idm(*state)).all()


@pytest.mark.slow
def test_robots_that_differ_in_their_loops_alone_take_turns() -> None:
    """Racks with other offsets: each step closes the loops of its own robot."""

    def slide(name: str, child: str) -> Joint:
        return Joint(name, "prismatic", "base", child, np.eye(4), np.array([1.0, 0.0, 0.0]))

    slides = [slide("a", "one"), slide("b", "two")]
    racks = [[Coupling("rack", (("a", 0.3), ("b", -1.0)), offset)] for offset in (0.0, 0.2)]
    robots = [robot_of(f"rack{k}", ("one", "two"), slides, [], ["a"], x) for k, x in enumerate(racks)]
    both = [hybridyn.compile(robot) for robot in robots]
    motor, still = np.array([0.1]), np.zeros(1)
    last = [compiled.idm_from_motors(motor)[1] for compiled in both]
    for compiled, q, offset in zip(both, last, (0.0, 0.2), strict=True):
        out = np.empty(2 + 2 * 2 + 1)
        assert compiled._models.control_at_once(q, motor + 0.01, still, still, out) == 0
        assert abs(0.3 * out[0] - out[1] - offset) <= SAME


# -------------------------------------------------------------------- the guard


@pytest.mark.parametrize("name", ROBOTS)
def test_the_guard_of_closed_loops_costs_little_and_still_looks_at_pivots(name: str) -> None:
    robot = hybridyn.load(name)
    asked = request(robot, None)
    program = inverse_program(replace(asked, compared=False))
    guarded, alone = flattened(program)
    assert alone < guarded <= GUARDED * alone
    full, part = function_of(inverse_program(asked)), function_of(program)
    q, v, a, _ = (x[0] for x in random_states(robot, 1))
    (tau, _), (same, guard) = full(q, v, a), part(q, v, a)
    assert float(guard) <= 1.0
    assert np.abs(np.array(tau - same)).max() <= SAME * np.abs(np.array(tau)).max()
    assert not float(part(q * np.nan, v, a)[1]) <= 1.0
    assert not float(part(q, v, a * np.inf)[1]) <= 1.0


#: Rounded posture of the symmetric five-bar with its rods in a line.
STRETCHED = np.array([2.418858, -0.750009, -0.661428, 0.722734, -0.750009, 0.661428])


def test_lost_pivots_are_refused_without_a_look_at_the_loops() -> None:
    """Rods of the five-bar almost in a line."""
    robot = build_robot(symmetric_five_bar())
    part = function_of(inverse_program(replace(request(robot, None), compared=False)))
    still = np.zeros(robot.nv)
    for away, near, refused in ((-0.2, None, False), (-1e-10, STRETCHED, True)):
        q, _, _ = hybridyn.assemble(robot, motors=stretched(robot, away), guess=near)
        assert refused != (float(part(q, still, still)[1]) <= 1.0)
