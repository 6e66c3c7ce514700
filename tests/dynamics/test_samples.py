"""Functions take one sample or many: none depends on its batch, and wrong arrays are refused.

For each function of states, and for each engine that has it.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.errors import AssemblyError, TrajectoryError
from hybridyn.structure.building import build_robot
from tests.comparing import ROUNDING, arrays, close_to, refused, same_bits
from tests.engines import engine_of
from tests.judging import BACKWARD, efforts
from tests.mechanisms import KINDS, random_mechanism, random_states
from tests.oracle import Oracle
from tests.samples import slow
from tests.shipped import shipped, states_near_home

#: Of the largest entry, besides rounding: NumPy sums batches in different order. The five-bar keeps its bits.
ALONE = {"five_bar": 0.0}
States = list[np.ndarray]


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
CASES = [
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


def prepared(engine: str, case: str, base: Any = "fixed", count: int = 6) -> tuple[Any, States]:
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


@pytest.mark.parametrize(("engine", "case", "base", "name"), CASES)
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
