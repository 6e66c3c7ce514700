"""Both models and the closed-loop quantities against the oracle, of every robot and by every engine."""

from typing import Any

import numpy as np
import pytest

from hybridyn.description import Description
from hybridyn.structure.building import build_robot
from tests.comparing import SOLVED, close_to
from tests.engines import engine_of
from tests.judging import BASES, ORACLE, Wrenches, efforts
from tests.mechanisms import KINDS, random_mechanism, random_states, random_wrenches
from tests.oracle import Base, Oracle
from tests.quantities.reduced import columns_of, oracle_bias, oracle_drift, oracle_map, oracle_mass
from tests.samples import CHOSEN, each, in_turn, slow
from tests.shipped import ROBOTS, States, shipped, states_near_home

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
    """The motion map with its drift, the mass matrix and the bias."""
    description, _, (q, v, _) = drawn(case, base, 0)
    on = engine_of(engine, build_robot(description, base=base))
    oracle = Oracle(description, base)
    columns = columns_of(oracle, on.robot.motors)
    (E, E_dot), M, force = on.motion_map(q, v), on.mass_matrix(q), on.bias(q, v)
    np.testing.assert_array_equal(M, np.swapaxes(M, 1, 2))
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
