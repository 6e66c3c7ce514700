"""Both models and the quantities by every engine: the oracle's numbers in any batch; wrong arrays refused."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description import Description
from hybridyn.errors import AssemblyError, TrajectoryError
from hybridyn.structure.building import build_robot
from tests.judges.judging import BACKWARD, BASES, ORACLE, Wrenches, efforts
from tests.oracle import Base, Oracle
from tests.quantities.reduced import columns_of, oracle_bias, oracle_drift, oracle_map, oracle_mass
from tests.robots.mechanisms import KINDS, random_mechanism, random_states, random_wrenches
from tests.robots.shipped import ROBOTS, States, shipped, states_near_home
from tests.support.comparing import ROUNDING, SOLVED, arrays, close_to, refused, same_bits
from tests.support.engines import engine_of
from tests.support.samples import CHOSEN, each, in_turn, slow

WITHIN = {"general": SOLVED, "written": 1e-10, "compiled": SOLVED}
#: Recipes with one motor for each freedom.
SQUARE = [name for name, kind in KINDS.items() if kind.motors == "square"]


def drawn(case: str, base: Base, seed: int) -> tuple[Description, Wrenches, States]:
    """Return a random mechanism or a shipped robot, wrenches, and states that motors can drive."""
    if case in KINDS:
        description = random_mechanism(seed, kind=case)
        wrenches = random_wrenches(description, seed)
        return description, wrenches, random_states(description, base, seed, 2, wrenches=wrenches)
    description, rng = shipped(case.removeprefix("shipped ")), np.random.default_rng(seed)
    q, v, a = states_near_home(description, base, seed, 1 if case == "shipped snake" else 3)
    links = [description.root, *rng.choice([x.name for x in description.links if x.mass > 0], 2)]
    wrenches = {str(link): 10 * rng.normal(size=6) for link in links}
    if base == "floating":
        oracle = Oracle(description, base)
        a = np.array([oracle.solve_passive(*s, wrenches) for s in zip(q, v, a, strict=True)])
    return description, wrenches, (q, v, a)


SHIPPED = [f"shipped {name}" for name in ROBOTS]
CASES = in_turn(
    [*KINDS, *SHIPPED], BASES, [*CHOSEN, "star_universal", *(name for name in SHIPPED if "snake" not in name)]
)
#: Motors that share efforts in N and N m need weights, which the written models do not take.
OF_WRITTEN = [case for case in CASES if "gough_eight_motors" not in str(case)]
OF_QUANTITIES = in_turn([*SQUARE, *SHIPPED], BASES, [*CHOSEN, "shipped rps3", "shipped scara_delta"])


@pytest.mark.parametrize("seed", [0, *map(slow, (1, 2, 3))])
@pytest.mark.parametrize(("engine", "case", "base"), [*each("general", CASES), *each("written", OF_WRITTEN)])
def test_both_models_against_the_oracle(engine: str, case: str, base: Base, seed: int) -> None:
    description, wrenches, (q, v, a) = drawn(case, base, seed)
    massless = case in KINDS and KINDS[case].massless
    oracle, on = Oracle(description, base), engine_of(engine, build_robot(description, base=base))
    tau, weights = efforts(description, len(q), seed), np.ones(len(description.motors))
    more: dict[str, Any] = {}
    if engine == "general":
        weights, more = np.linspace(1.0, 3.0, len(weights)), {"wrenches": wrenches}
    elif base == "floating" or (case in KINDS and KINDS[case].motors == "few"):
        a = np.array([oracle.solve_passive(*s) for s in zip(q, v, a, strict=True)])
    moving = {"base_acceleration": np.random.default_rng(seed).normal(size=6)} if base == "moving" else {}
    wanted = [oracle.idm(*s, weights=weights, **more) for s in zip(q, v, a, strict=True)]
    close_to(
        on.idm(q, v, a, **({"weights": weights} | more if more else {})), np.array(wanted), WITHIN[engine]
    )
    if massless and engine == "written":
        return  # the motion of a thin rod about itself is for the general path
    found = on.ddm(q, v, tau, **moving, **more)
    wanted = np.array([oracle.ddm(*s, **moving, **more) for s in zip(q, v, tau, strict=True)])
    if massless:
        found, wanted = (determined(oracle, q, x) for x in (found, wanted))
    close_to(found, wanted, ORACLE)


def determined(oracle: Oracle, q: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Take out of accelerations what moves no mass, of which each model chooses its own least norm."""
    out = a / oracle.unit
    for t in range(len(q)):
        basis = np.linalg.qr(oracle.massless(q[t]) / oracle.unit[:, None])[0]
        assert basis.shape[1] == 6, "six thin rods spin"
        out[t] -= basis @ (basis.T @ out[t])
    return out


@pytest.mark.parametrize(
    ("engine", "case", "base"),
    [
        *each("general", OF_QUANTITIES),
        ("compiled", "shipped five_bar", "fixed"),
        *(slow("compiled", name, base) for name in SHIPPED[:-1] for base in BASES),
    ],
)
def test_quantities_against_the_oracle(engine: str, case: str, base: Base) -> None:
    """The motion map with its drift, the mass matrix, the bias and its parts."""
    description, _, (q, v, _) = drawn(case, base, 0)
    on = engine_of(engine, build_robot(description, base=base))
    oracle = Oracle(description, base)
    columns = columns_of(oracle, on.robot.motors)
    (E, E_dot), M, force = on.motion_map(q, v), on.mass_matrix(q), on.bias(q, v)
    np.testing.assert_array_equal(M, np.swapaxes(M, 1, 2))
    close_to(on.coriolis(q, v) + on.gravity(q), force, BACKWARD)
    assert np.linalg.eigvalsh(M).min() > 0
    for t in range(len(q)):
        close_to(E[t], oracle_map(oracle, q[t], columns), SOLVED)
        close_to(M[t], oracle_mass(oracle, q[t], columns), SOLVED)
        close_to(force[t], oracle_bias(oracle, q[t], v[t], columns), SOLVED)
        drift = oracle_drift(oracle, q[t], v[t], columns)
        close_to(E_dot[t] @ v[t, columns], drift, SOLVED, np.abs(v[t]).max() ** 2)
    assert on.recomputed == 0


PASSIVE = [kind for kind, recipe in KINDS.items() if recipe.motors == "few" and not recipe.massless]


@pytest.mark.parametrize(
    ("kind", "base"),
    in_turn([*PASSIVE, "sps_thin", "five_bar_four_motors", "gough", "stack", "on_leg"], BASES, None),
)
def test_passive_motions_solved_against_the_oracle(kind: str, base: Base) -> None:
    """Passive accelerations are not read: wrong ones give the same efforts, those of the oracle."""
    description, wrenches, (q, v, a) = drawn(kind, base, 6)
    oracle, on = Oracle(description, base), engine_of("general", build_robot(description, base=base))
    passive = np.setdiff1d(np.arange(oracle.nv), oracle.motors + list(range(6 * (base == "moving"))))
    a[:, passive] += 7.0  # need not close the loops
    weights = np.ones(len(description.motors))
    actual = on.idm(q, v, a, wrenches=wrenches, passive="solved", weights=weights)
    expected = [oracle.idm(*s, wrenches, passive="solved") for s in zip(q, v, a, strict=True)]
    close_to(actual, np.array(expected), ORACLE)


#: Of the largest entry, besides rounding: NumPy sums batches in different order. The five-bar keeps its bits.
ALONE = {"five_bar": 0.0}


def of_map(found: Any) -> Any:
    """Return the arrays of a joint map."""
    return found.joint_positions, found.motor_positions, found.motors_per_joints, found.curvature


def with_reactions(found: Any) -> Any:
    """Return the wrenches of reactions that belong to samples."""
    return found[0], found[1].base, found[1].modules, found[1].closures


#: Functions of an engine and of q, v, a, tau.
MODELS: dict[str, Callable[..., Any]] = {
    "idm": lambda on, q, v, a, tau: on.idm(q, v, a),
    "ddm": lambda on, q, v, a, tau: on.ddm(q, v, tau),
    "kinematics": lambda on, q, v, a, tau: on.kinematics(q, v, a),
    "energy": lambda on, q, v, a, tau: on.energy(q, v),
}
QUANTITIES: dict[str, Callable[..., Any]] = {
    "mass_matrix": lambda on, q, v, a, tau: on.mass_matrix(q),
    "motion_map": lambda on, q, v, a, tau: on.motion_map(q),
    "rate": lambda on, q, v, a, tau: on.motion_map(q, v),
    "bias": lambda on, q, v, a, tau: on.bias(q, v),
    "coriolis": lambda on, q, v, a, tau: on.coriolis(q, v),
    "gravity": lambda on, q, v, a, tau: on.gravity(q),
    "coriolis_matrix": lambda on, q, v, a, tau: on.coriolis_matrix(q, v),
    "link_jacobian": lambda on, q, v, a, tau: on.link_jacobian(q, list(on.robot.bodies.place)[-1]),
    "delassus": lambda on, q, v, a, tau: on.delassus(q, on.robot.description.root),
    "joint_map": lambda on, q, v, a, tau: of_map(on.joint_map(q, on.robot.motors)),
}
GENERAL: dict[str, Callable[..., Any]] = {
    "idm with reactions": lambda on, q, v, a, tau: with_reactions(on.idm(q, v, a, reactions=True)),
    "ddm with reactions": lambda on, q, v, a, tau: with_reactions(on.ddm(q, v, tau, reactions=True)),
    "momentum": lambda on, q, v, a, tau: on.momentum(q, v),
    "centre_of_mass": lambda on, q, v, a, tau: on.centre_of_mass(q),
    "power": lambda on, q, v, a, tau: on.power(q, v, tau),
    "closure_residual": lambda on, q, v, a, tau: on.closure_residual(q),
}
EVERY = MODELS | QUANTITIES | GENERAL
OF_BATCHES = [
    *(("general", "stack", "fixed", name) for name in EVERY if name != "joint_map"),
    *(
        ("general", "five_bar", "fixed", name)
        for name in ("energy", "momentum", "centre_of_mass", *QUANTITIES)
    ),
    *(("general", "five_bar_four_motors", "fixed", name) for name in MODELS),
    *(("general", "serial_all", "floating", name) for name in MODELS),
    *(("general", "gough_gimbals", "moving", name) for name in [*MODELS, "ddm with reactions"]),
    *(("general", "sps_thin", "moving", name) for name in ("ddm", "ddm with reactions")),
    *(("compiled", "five_bar", "fixed", name) for name in [*MODELS, *QUANTITIES]),
    *(slow("compiled", "lx4", "fixed", name) for name in MODELS),
]


def prepared(engine: str, case: str, base: Any = "fixed", count: int = 6) -> tuple[Any, list[np.ndarray]]:
    """Return an engine and q, v, a, tau: samples that rest, that are slow and that are fast."""
    drawn = case in KINDS and case != "five_bar"
    description = random_mechanism(1, kind=case) if drawn else shipped(case)
    draw = random_states if drawn else states_near_home
    q, v, a = draw(description, base, 1, count)
    if base != "floating" and not (drawn and KINDS[case].motors == "few"):
        v = v * np.resize([1.0, 1e-6, 10.0, 1.0, 0.0, 1.0], len(v))[:, None]
        oracle = Oracle(description, base)
        a = np.array([oracle.consistent_acceleration(*s) for s in zip(q, v, a, strict=True)])
    return engine_of(engine, build_robot(description, base=base)), [q, v, a, efforts(description, count)]


@pytest.mark.parametrize(("engine", "case", "base", "name"), OF_BATCHES)
def test_a_sample_does_not_depend_on_its_batch(engine: str, case: str, base: str, name: str) -> None:
    """Fast, slow and resting samples side by side, in any order; no samples give no results."""
    on, states = prepared(engine, case, base)
    before = [x.copy() for x in states]
    whole = [*arrays(EVERY[name](on, *states))]
    within, least = ALONE.get(case, ROUNDING), 1e-300
    if "with reactions" in name or name == "closure_residual":
        within, least = BACKWARD, max(np.abs(x).max(initial=1.0) for x in whole)
    for t in (0, 4):
        one = tuple(arrays(EVERY[name](on, *(x[t] for x in states))))
        close_to(one, tuple(x[t] for x in whole), within, least)
        same_bits(EVERY[name](on, *(x[t : t + 1] for x in states)), tuple(x[None] for x in one))
    order = np.array([5, 2, 0, 4, 3, 1, 2, 2])
    other = EVERY[name](on, *(x[order] for x in states))
    close_to(tuple(arrays(other)), tuple(x[order] for x in whole), within, least)
    none = arrays(EVERY[name](on, *(x[:0] for x in states)))
    assert [x.shape for x in none] == [(0, *x.shape[1:]) for x in whole]
    assert on.recomputed == 0
    same_bits(tuple(states), tuple(before))


@pytest.mark.parametrize("engine", ["general", "compiled"])
@pytest.mark.parametrize("name", ["idm", "ddm"])
def test_wrong_arrays_are_refused_by_name(engine: str, name: str) -> None:
    on, (q, v, a, tau) = prepared(engine, "five_bar", count=3)
    given = {"q": q, "v": v} | ({"a": a} if name == "idm" else {"tau": tau})
    for wrong, x in given.items():
        n = x.shape[1]
        shape = rf"^{wrong} has shape \(.*\); wanted \({n},\) or \(T, {n}\)"
        bad = x.copy()
        bad[2, 0] = {"q": np.nan}.get(wrong, np.inf)
        for instead, words, data in (
            (x[:, 1:], shape, {}), (x[None], shape, {}), (np.array(0.0), shape, {}),
            (x[:2], f"{', '.join(given)} have [23], [23], [23] samples", {}),
            ("nonsense", f"^{wrong} is not an array of numbers", {}),
            (bad, f"^{wrong} is not finite at sample 2", {"row": None, "sample": 2}),
        ):  # fmt: skip
            arguments = [*(given | {wrong: instead}).values()]
            refused(lambda: getattr(on, name)(*arguments), TrajectoryError, words, **data)  # noqa: B023
        one = [y[0] for y in (given | {wrong: bad[::-1]}).values()]
        refused(lambda: getattr(on, name)(*one), TrajectoryError, f"{wrong} is not finite at sample 0")  # noqa: B023


@pytest.mark.parametrize(
    ("engine", "case"),
    [
        ("compiled", "five_bar"),
        *(("general", x) for x in ("four_bar", "gough_gimbals", "stack", "gear_two", "delta_bars")),
    ],
)
def test_states_that_do_not_close_are_refused(engine: str, case: str) -> None:
    """Positions, rates and accelerations each; a millionth of the size is the limit."""
    on, (q, v, a, tau) = prepared(engine, case, count=3)
    looped = next(m for m in on.robot.modules if m.closures)
    step = 1e-4 * np.eye(on.robot.nv)[int(looped.v_index[0])]
    moved, faster, harder = q.copy(), v.copy(), a.copy()
    moved[1] = pin.integrate(on.robot.model, q[1], step)
    faster[2] += 1e4 * step * max(np.abs(v).max(), 1.0)
    harder[0] += 1e4 * step * max(np.abs(a).max(), 1.0)
    open_by = r"closure '.*': the positions do not close the loops at sample 1: open by"
    for call, third in ((on.idm, a), (on.ddm, tau)):
        error = refused(lambda: call(moved, v, third), AssemblyError, open_by, module=looped.name, sample=1)  # noqa: B023
        assert 1e-6 < error.residual < 1e-2
        refused(lambda: call(q, faster, third), AssemblyError, r"rates .* loops at sample 2: opening by")  # noqa: B023
    refused(lambda: on.idm(q, v, harder), AssemblyError, r"accelerations do not close the loops at sample 0")
