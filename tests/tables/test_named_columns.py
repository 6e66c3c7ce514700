"""Tables with named columns stand for arrays, whatever the order of their columns."""

from functools import partial

import numpy as np
import pytest

import hybridyn
from hybridyn import HybridRobot, TrajectoryError
from hybridyn.compiled.compiling import interpreted_model
from hybridyn.compiled.equations.states import random_states
from hybridyn.effects import GearEfficiency
from hybridyn.structure.building import build_robot
from tests.robots.mechanisms import random_mechanism
from tests.support.comparing import ROUNDING, SOLVED, close_to, refused, same_bits
from tests.support.engines import engine_of
from tests.support.extras import needs

SAMPLES = 4
State = tuple[np.ndarray, np.ndarray, np.ndarray]


class Table(dict[str, np.ndarray]):
    """What pandas' and polars' frames have in common."""

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(self)


@pytest.fixture(scope="module")
def robot() -> HybridRobot:
    return hybridyn.load("five_bar")


@pytest.fixture(scope="module")
def state(robot: HybridRobot) -> State:
    wave = 0.1 * np.sin(np.arange(SAMPLES))
    return hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, (wave, 0.2, 0.3)))


def table_of(robot: HybridRobot, state: State) -> Table:
    """Write a motion of joints with one coordinate as a table, last joint first."""
    out = Table(time=np.arange(float(len(state[0]))))
    for quantity, values in zip(("position", "velocity", "acceleration"), state, strict=True):
        out |= {f"{j}/{quantity}": values[:, i] for i, j in reversed(list(enumerate(robot.joints)))}
    return out


@pytest.mark.parametrize("engine", ["general", "compiled"])
def test_one_table_is_position_rate_and_acceleration(robot: HybridRobot, state: State, engine: str) -> None:
    on, table = engine_of(engine, robot), table_of(robot, state)
    tau = on.idm(*state)
    same_bits(on.idm(table, table, table), tau)
    lacking = Table(time=np.arange(float(SAMPLES)))
    refused(lambda: on.idm(table, table, lacking), TrajectoryError, "the table lacks the column")
    table |= {f"{motor}/effort": tau[:, i] for i, motor in enumerate(robot.motors)}
    same_bits(on.ddm(table, table, table), on.ddm(*state[:2], tau))
    same_bits(on.mass_matrix(table), on.mass_matrix(state[0]))
    same_bits(on.energy(table, table), on.energy(*state[:2]))
    same_bits(on.kinematics(table, table), on.kinematics(*state[:2]))
    same_bits(on.kinematics(table, table, table), on.kinematics(*state))


def test_derivatives_read_accelerations_of_a_table(
    robot: HybridRobot, state: State, interpreted: None
) -> None:
    """They are the third argument, beside the rates of the same table."""
    table, direction = table_of(robot, state), [np.ones(robot.nv)] * 3
    second = hybridyn.SecondDerivatives(robot)
    for one, wanted in zip(
        second.along(table, table, table, direction), second.along(*state, direction), strict=True
    ):
        same_bits(one, wanted)
    gradients = hybridyn.DesignGradients(robot, ["upper_length"])
    same_bits(gradients.idm(table, table, table).over, gradients.idm(*state).over)
    same_bits(gradients.motion(table, table, table), gradients.motion(*state))


class Row:
    """What a row of pandas' frames has: names of its entries, and the entries by name."""

    ndim = 1

    def __init__(self, table: Table, t: int) -> None:
        self.index, self._entries = list(table), {name: values[t] for name, values in table.items()}

    def __getitem__(self, name: str) -> float:
        return float(self._entries[name])


def test_reactions_that_the_general_path_computes(robot: HybridRobot, state: State) -> None:
    """Compiled models leave those behind gears that lose power to it."""
    effects = ["default", GearEfficiency(dict.fromkeys(robot.motors, 0.9))]
    compiled, joints = interpreted_model(robot, effects, "idm"), [*enumerate(robot.joints)]
    tables = [Table((name, x[:, i]) for i, name in reversed(joints)) for x in state]
    rows = [Row(table, 3) for table in tables]
    for given, asked in ((tables, state), (rows, [x[3] for x in state])):
        tau, found = compiled.idm(*given, reactions=True)
        wanted_tau, wanted = hybridyn.idm(robot, *asked, effects=effects, reactions=True)
        same_bits(tau, wanted_tau)
        for name, wrench in wanted.joints.items():
            same_bits(found.joints[name], wrench)
    assert compiled.handed_over == {"reactions (with the effect 'gear_efficiency')": SAMPLES + 1}


def test_a_row_of_a_table_is_one_sample(robot: HybridRobot, state: State) -> None:
    """Entries are matched by name, not by place."""
    row = Row(table_of(robot, state), 2)
    tau = hybridyn.idm(robot, *(x[2] for x in state))
    same_bits(hybridyn.idm(robot, row, row, row), tau)  # type: ignore[arg-type]


def test_motors_of_a_table_are_those_that_it_names(robot: HybridRobot, state: State) -> None:
    """Of a table of every joint, those of the motors; of one of motors alone, all but the time."""
    table, at = table_of(robot, state), [robot.v_slices[robot.joint_index[m]].start for m in robot.motors]
    short = Table(time=table["time"]) | {m: state[0][:, i] for m, i in zip(robot.motors, at, strict=True)}
    for on in (engine_of("general", robot), engine_of("compiled", robot)):
        for one, other in zip(on.assemble(motors=table), state, strict=True):
            close_to(one, other, SOLVED)
        wanted = on.assemble(motors={m: short[m] for m in robot.motors})
        same_bits(on.assemble(motors=Table(short)), wanted)
        same_bits(on.assemble(motors=Row(Table(short), 2))[0], on.assemble(motors=state[0][2, at])[0])
    refused(
        lambda: hybridyn.assemble(robot, motors=Table(elbow=np.zeros(2))),
        TrajectoryError,
        "unknown joint 'elbow'",
    )


def test_columns_that_are_there_twice_are_refused(robot: HybridRobot, state: State) -> None:
    class Twice(Table):
        """A table whose last column is there twice."""

        @property
        def columns(self) -> list[str]:
            """Names of the columns."""
            return [*self, list(self)[-1]]

    last = f"{robot.joints[0]}/acceleration"
    table = Twice(table_of(robot, state))
    refused(
        lambda: hybridyn.idm(robot, table, table, table),
        TrajectoryError,
        f"acceleration: the table has 2 columns '{last}'",
    )


def test_frames_of_polars(robot: HybridRobot, state: State) -> None:
    """Each array a frame of its own, its columns named by the joints alone."""
    polars = needs("io")
    frames = [
        polars.DataFrame({j: x[:, i] for i, j in reversed(list(enumerate(robot.joints)))}) for x in state
    ]
    same_bits(hybridyn.idm(robot, *frames), hybridyn.idm(robot, *state))
    same_bits(hybridyn.assemble(robot, motors=frames[0])[0], state[0])


def test_every_kind_of_joint_has_its_components() -> None:
    """Positions, rates and accelerations of a chain with each kind of joint, written by their components."""
    robot = build_robot(random_mechanism(3, kind="serial_all"))
    assert {"continuous", "planar", "spherical", "floating"} <= set(robot.kinds)
    q, v, a, _ = random_states(robot, 3)
    table = Table()
    for joint, kind, at_q, at_v in zip(
        robot.joints, robot.kinds, robot.q_slices, robot.v_slices, strict=True
    ):
        x, places, rates = q[:, at_q], kind.places, kind.rates
        if kind in ("continuous", "planar"):
            x = np.column_stack([x[:, :-2], np.arctan2(x[:, -1], x[:, -2])])
        table |= {f"{joint}/position/{n}".rstrip("/"): x[:, i] for i, n in enumerate(places)}
        for quantity, y in (("velocity", v[:, at_v]), ("acceleration", a[:, at_v])):
            table |= {f"{joint}/{quantity}/{n}".rstrip("/"): y[:, i] for i, n in enumerate(rates)}
    close_to(hybridyn.idm(robot, table, table, table), hybridyn.idm(robot, q, v, a), ROUNDING)


def test_what_is_missing_is_named(robot: HybridRobot, state: State) -> None:
    table, first = table_of(robot, state), f"{robot.joints[0]}/position"
    lacking = Table((name, x) for name, x in table.items() if name != first)
    words, typo = np.array(["a"] * SAMPLES), first.replace("position", "positon")
    for wrong, said in (
        (lacking, f"lacks the column '{first}'"),
        (lacking | {typo: table[first]}, f"lacks the column '{first}' .did you mean '{typo}'"),
        (table | {first: words}, "does not hold numbers"),
    ):  # fmt: skip
        refused(partial(hybridyn.mass_matrix, robot, Table(wrong)), TrajectoryError, said)


def test_a_base_that_moves_needs_arrays(state: State) -> None:
    robot = hybridyn.load("five_bar", base="floating")
    refused(
        lambda: hybridyn.mass_matrix(robot, table_of(hybridyn.load("five_bar"), state)),
        TrajectoryError,
        "fixed base; give arrays",
    )
