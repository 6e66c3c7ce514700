"""Public functions that take arrays read any that hold the numbers, and refuse others in the same words.

One table says which arguments each function has; it is complete by `hybridyn.__all__`, the methods of a
compiled robot, and those of a joint map.
"""

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.dynamics.quantities.joint_map import JointMap
from hybridyn.errors import TrajectoryError
from tests.dynamics.test_engines import of_map, with_reactions
from tests.support.comparing import arrays, refused, same_bits
from tests.support.engines import engine_of
from tests.support.samples import each, slow

Arrays = dict[str, np.ndarray]
SAMPLES = 3
#: What each argument is made from; the others are the state's.
ALIASES = {"base_acceleration": "six", "wrench": "six", "position": "m", "rate": "m", "acceleration": "m"}


@cache
def engine(name: str, case: str = "five_bar") -> Any:
    """Return an engine of the five-bar, on a moving base where its acceleration is an argument."""
    return engine_of(name, hybridyn.load("five_bar", base="moving" if case == "moving" else None))


@cache
def joint_map() -> JointMap:
    """Return the map of the five-bar's motors onto themselves, at the state's postures."""
    on = engine("general")
    found: JointMap = on.joint_map(state("five_bar")["q"], on.robot.motors)
    return found


@cache
def state(case: str) -> Arrays:
    """Return one array for each argument, of `SAMPLES` samples."""
    robot = engine("general", case).robot
    motors = {name: (0.1 * np.arange(SAMPLES), np.ones(SAMPLES), 0.3) for name in robot.motors}
    q, v, a = hybridyn.assemble(robot, motors=motors)
    m = 0.1 + 0.1 * np.arange(SAMPLES)[:, None] * np.ones(len(robot.motors))
    return {"q": q, "v": v, "a": a, "tau": m, "m": m, "six": np.ones((SAMPLES, 6))}


def link(on: Any) -> str:
    """Return the robot's last link."""
    return list(on.robot.bodies.place)[-1]


def drives(on: Any) -> hybridyn.effects.DcMotors:
    """Return equal DC motors."""
    return hybridyn.effects.DcMotors(
        torque_constant=dict.fromkeys(on.robot.motors, 0.1), resistance=dict.fromkeys(on.robot.motors, 2.0)
    )


#: Calls of functions that a compiled robot has, too, with an engine and arrays by name.
BOTH: dict[str, Callable[..., Any]] = {
    "idm": lambda on, q, v, a: on.idm(q, v, a),
    "ddm": lambda on, q, v, tau: on.ddm(q, v, tau),
    "kinematics": lambda on, q, v, a: on.kinematics(q, v, a),
    "kinematics at rest": lambda on, q, v: on.kinematics(q, v),
    "energy": lambda on, q, v: on.energy(q, v),
    "mass_matrix": lambda on, q: on.mass_matrix(q),
    "motion_map": lambda on, q: on.motion_map(q),
    "motion_map and rate": lambda on, q, v: on.motion_map(q, v),
    "bias": lambda on, q, v: on.bias(q, v),
    "coriolis": lambda on, q, v: on.coriolis(q, v),
    "coriolis_matrix": lambda on, q, v: on.coriolis_matrix(q, v),
    "gravity": lambda on, q: on.gravity(q),
    "link_jacobian": lambda on, q: on.link_jacobian(q, link(on)),
    "delassus": lambda on, q: on.delassus(q, link(on)),
    "operational_inertia": lambda on, q: on.operational_inertia(q, link(on)),
    "joint_map": lambda on, q: of_map(on.joint_map(q, on.robot.motors)),
    "closure_residual": lambda on, q: on.closure_residual(q),
}
MOVING: dict[str, Callable[..., Any]] = {
    "ddm of a base": lambda on, q, v, tau, base_acceleration: on.ddm(
        q, v, tau, base_acceleration=base_acceleration
    ),
    "bias of a base": lambda on, q, v, base_acceleration: on.bias(q, v, base_acceleration=base_acceleration),
}
GENERAL: dict[str, Callable[..., Any]] = {
    "idm of wrenches": lambda on, q, v, a, wrench: on.idm(q, v, a, wrenches={link(on): wrench}),
    "ddm with reactions": lambda on, q, v, tau: with_reactions(on.ddm(q, v, tau, reactions=True)),
    "momentum": lambda on, q, v: on.momentum(q, v),
    "centre_of_mass": lambda on, q: on.centre_of_mass(q),
    "power": lambda on, q, v, tau: on.power(q, v, tau),
    "motor_currents": lambda on, v, tau: on.motor_currents(v, tau, effects=[drives(on)]),
    "regressor": lambda on, q, v, a: on.regressor(q, v, a).Y,
    "idm_jacobian": lambda on, q, v, a: on.idm_jacobian(q, v, a),
    "ddm_jacobian": lambda on, q, v, tau: on.ddm_jacobian(q, v, tau),
}
COMPILED: dict[str, Callable[..., Any]] = {
    "close": lambda on, position, rate, acceleration: on.close(position, rate, acceleration),
    "idm_from_motors": lambda on, position, rate, acceleration: on.idm_from_motors(
        position, rate, acceleration
    ),
}
OF_MAPS: dict[str, Callable[..., Any]] = {
    "joint_rates": lambda found, motor_rates: found.joint_rates(motor_rates),
    "motor_rates": lambda found, joint_rates: found.motor_rates(joint_rates),
    "joint_efforts": lambda found, motor_efforts: found.joint_efforts(motor_efforts),
    "motor_efforts": lambda found, joint_efforts: found.motor_efforts(joint_efforts),
    "joint_accelerations": lambda found, motor_rates, motor_accelerations: found.joint_accelerations(
        motor_rates, motor_accelerations
    ),
    "motor_accelerations": lambda found, joint_rates, joint_accelerations: found.motor_accelerations(
        joint_rates, joint_accelerations
    ),
    "joint_stiffness": lambda found, motor_efforts: found.joint_stiffness(np.ones(2), motor_efforts),
}
#: Public names without arrays of samples, and those of other tests: what closes loops (assembly), integrates
#: (simulation), reads a log (identification), or takes arrays of frameworks (learning, optimal control).
OTHERS = {
    "assemble", "assemblies", "base_parameters", "check", "compile", "convert", "excitation", "identify",
    "from_pinocchio", "geometry_model", "load", "near_singularity", "simulate", "sweep", "jax",
    "torch", "warp", "with_effects", "accelerations", "assemble_requests", "designs", "hand_over",
    "say_of_table", "wait_until_optimised", "at_joints", "at_motors", "casadi_model", "second_derivatives",
}  # fmt: skip

BUILT = ("idm_jacobian", "ddm_jacobian")  # which take seconds to build
CASES = [
    *each("general", [("five_bar", name) for name in (BOTH | GENERAL) if name not in BUILT]),
    *each("general", [slow("five_bar", name) for name in BUILT]),
    *each("general", [("moving", name) for name in MOVING]),
    *each("compiled", [("five_bar", name) for name in BOTH | COMPILED]),
    *each("compiled", [slow("moving", name) for name in MOVING]),
    *each("map", [("five_bar", name) for name in OF_MAPS]),
]


def prepared(kind: str, case: str, name: str) -> tuple[Any, Callable[..., Any], Arrays]:
    """Return the first argument of a call, the call, and its arrays."""
    if kind == "map":
        call, on = OF_MAPS[name], joint_map()
    else:
        table = MOVING if case == "moving" else BOTH | GENERAL | COMPILED
        call, on = table[name], engine(kind, case)
    names = list(inspect.signature(call).parameters)[1:]
    known = state(case)
    given = {x: known[ALIASES.get(x, x if x in known else "m")].copy() for x in names}
    return on, call, given


def test_the_table_is_complete() -> None:
    called = {name.split()[0] for name in BOTH | MOVING | GENERAL | COMPILED | OF_MAPS}
    public = {name for name in hybridyn.__all__ if inspect.isfunction(getattr(hybridyn, name))}
    for kind in (hybridyn.CompiledRobot, JointMap):
        public |= {name for name, _ in inspect.getmembers(kind, inspect.isfunction) if name[0] != "_"}
    assert called | OTHERS == public
    assert not called & OTHERS


def with_last(x: np.ndarray, number: float) -> np.ndarray:
    """Return an array with another number at its end."""
    x.flat[-1] = number
    return x


#: Of an array: another one, and what the message says of it, after its name.
WRONG: dict[str, tuple[Callable[[np.ndarray], Any], str]] = {
    "too wide": (lambda x: np.hstack([x, x[:, :1]]), r"has shape \(3, {more}\); wanted \({n},\) or"),
    "too narrow": (lambda x: x[:, :1], r"has shape \(3, 1\); wanted \({n},\) or"),
    "three axes": (lambda x: x[None], r"has shape \(1, 3, {n}\); wanted \({n},\) or"),
    "one number": (lambda x: 1.0, r"has shape \(\); wanted \({n},\) or"),
    "text": (lambda x: "nonsense", "is not an array of numbers: could not convert"),
    "a dictionary": (lambda x: {"q": 1.0}, "is not an array of numbers"),
    "rows of two lengths": (lambda x: [[1.0], [1.0, 2.0]], "is not an array of numbers"),
    "complex": (lambda x: x + 1j, "is not an array of real numbers"),
    "objects": (
        lambda x: np.array([[None] * x.shape[1]] * len(x), dtype=object),
        "is not finite at sample 0",
    ),
    "nan": (lambda x: with_last(x, np.nan), "is not finite at sample 2"),
    "inf": (lambda x: with_last(x, -np.inf), "is not finite at sample 2"),
    "1e300": (lambda x: with_last(x, 1e300), r"has the number 1e\+300 at sample 2 \(at most 1e\+50\)"),
    "-1e60": (lambda x: with_last(x, -1e60), r"has the number -1e\+60 at sample 2 \(at most 1e\+50\)"),
}
#: Advice at the end of messages about a wrong shape.
ADVISED = {"q": "take q, v, a = hybridyn.assemble", "tau": "as robot.motors", "position": "as robot.motors"}
ADVISED |= {"v": ADVISED["q"], "a": ADVISED["q"], "rate": ADVISED["tau"], "acceleration": ADVISED["tau"]}
#: Arguments that are zero where they are None.
OPTIONAL = dict.fromkeys(
    ("energy", "bias", "coriolis", "coriolis_matrix", "momentum", "power", "motion_map and rate"), ("v",)
)
OPTIONAL |= dict.fromkeys(("close", "idm_from_motors"), ("rate", "acceleration"))
OPTIONAL |= {"kinematics": ("a",), "ddm of a base": ("base_acceleration",)}
OPTIONAL |= {"bias of a base": ("v", "base_acceleration")}


@pytest.mark.parametrize(("kind", "case", "name"), CASES)
def test_wrong_arrays_are_refused_in_the_same_words(kind: str, case: str, name: str) -> None:
    """By each function, and one by one for each of its arguments."""
    on, call, given = prepared(kind, case, name)
    called = {"wrench": f"wrench on '{link(engine('general'))}'"}
    for key, x in given.items():
        named = called.get(key, key)
        for what, (other, said) in WRONG.items():
            if name == "joint_map" and what == "a dictionary":  # of positions by name
                continue
            words = f"^{named} {said.format(n=x.shape[1], more=x.shape[1] + 1)}"
            if "shape" in said and key in ADVISED:
                words += f".*{ADVISED[key]}"
            refused(lambda: call(on, **(given | {key: other(x.copy())})), TrajectoryError, words)  # noqa: B023
        if key not in OPTIONAL.get(name, ()):
            refused(lambda: call(on, **(given | {key: None})), TrajectoryError, f"^{named} is missing")  # noqa: B023
        elif name != "motion_map and rate":  # which then leaves the rate out
            same_bits(call(on, **(given | {key: None})), call(on, **(given | {key: 0 * x})))


@pytest.mark.parametrize(("kind", "case", "name"), CASES)
def test_numbers_of_samples_are_compared(kind: str, case: str, name: str) -> None:
    """No array stands for more samples than it has, but a wrench or a base's acceleration for all."""
    on, call, given = prepared(kind, case, name)
    if kind == "map":
        given["q"] = on.q  # stays
    if len(given) == 1:
        pytest.skip("one array")
    for key, x in given.items():
        for less in (x[:2], x[:1], x[:0], x[0]):
            if key == "q" and kind == "map":
                continue
            if np.ndim(less) == 1 and (key in ("wrench", "base_acceleration") or kind == "map"):
                continue
            arguments = {k: less if k == key else y for k, y in given.items() if k != "q" or kind != "map"}
            words = r"have [0-3](, [0-3])* samples|wanted \(6,\) or \(\d, 6\)"
            refused(lambda: call(on, **arguments), TrajectoryError, words)  # noqa: B023


def strided(x: np.ndarray) -> np.ndarray:
    """Return every second row and column of a larger array."""
    out = np.full((2 * x.shape[0], 2 * x.shape[1]), np.nan)[::2, ::2]
    out[...] = x
    return out


def locked(x: np.ndarray) -> np.ndarray:
    """Return an array that cannot be written."""
    x = x.copy()
    x.flags.writeable = False
    return x


#: Of an array: another that holds the same numbers.
SAME: dict[str, Callable[[np.ndarray], Any]] = {
    "Fortran's order": np.asfortranarray,
    "strided": strided,
    "backwards": lambda x: x[::-1].copy()[::-1],
    "read-only": locked,
    "lists": lambda x: x.tolist(),
    "other byte order": lambda x: x.astype(">f8"),
    "float128": lambda x: x.astype(np.longdouble),
    "objects": lambda x: x.astype(object),
}


@pytest.mark.parametrize(("kind", "case", "name"), CASES)
def test_layout_and_type_do_not_matter(kind: str, case: str, name: str) -> None:
    """The bits are those of the same numbers as contiguous doubles; also of one sample and of none."""
    on, call, given = prepared(kind, case, name)
    if name == "operational_inertia":
        pytest.skip("a planar robot's links have none")

    def result(some: dict[str, Any]) -> tuple[np.ndarray, ...]:
        return tuple(np.asarray(x) for x in arrays(call(on, **some)))

    whole = result(given)
    for other in SAME.values():
        same_bits(result({key: other(x) for key, x in given.items()}), whole)
    single = {key: x.astype(np.float32) for key, x in given.items()}
    same_bits(result(single), result({key: x.astype(float) for key, x in single.items()}))
    rest = {key: 0 * x[:2] + (state(case)["q"][0] if key == "q" else 0) for key, x in given.items()}
    integers = {key: x if key == "q" else x.astype(int) for key, x in rest.items()}
    if kind != "map":  # which has its samples
        same_bits(result(integers), result(rest))
        one = result({key: x[:1] for key, x in given.items()})
        same_bits(tuple(x[0] for x in one), result({key: x[0] for key, x in given.items()}))
        none = result({key: x[:0] for key, x in given.items()})
        assert [x.shape for x in none] == [(0, *x.shape[1:]) for x in whole]
