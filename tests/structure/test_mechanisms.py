"""The drawn mechanisms are what their recipes say."""

import numpy as np
import pytest

from tests.mechanisms import KINDS, random_mechanism, random_states
from tests.oracle import Oracle
from tests.samples import some
from tests.sketch import CLOSURES, ROW_COUNT


@pytest.mark.parametrize("kind", some(KINDS))
def test_recipes_are_what_they_say(kind: str) -> None:
    """Joints that share closure rows form the modules; mobility is what the rows leave to each."""
    recipe, description = KINDS[kind], random_mechanism(2, kind=kind)
    oracle = Oracle(description)
    q, _, _ = random_states(description, "fixed", 2, 1)
    K = oracle.rows(q[0])
    groups = [{i} for i in range(oracle.nv)]
    for row in K:
        met = {int(i) for i in np.flatnonzero(np.abs(row) > 1e-9)}
        met |= set().union(*(g for g in groups if g & met))
        groups = [g for g in groups if not g & met] + [met]
    looped = [sorted(g) for g in groups if np.abs(K[:, sorted(g)]).max(initial=0.0) > 1e-9]
    left = [len(g) - np.linalg.matrix_rank(K[:, g], tol=1e-9) for g in looped]
    assert sorted(left) == sorted(recipe.loops)
    assert oracle.nv - sum(map(len, looped)) == recipe.serial
    rank = np.linalg.matrix_rank(oracle.motor_map(oracle.posture(q[0])), tol=1e-9)
    assert (rank < recipe.mobility) == (recipe.motors == "few")
    assert (len(oracle.motors) > rank) == (recipe.motors == "redundant")
    assert (oracle.massless(q[0]).shape[1] > 0) == recipe.massless


def test_draws_are_repeatable_and_differ_by_seed() -> None:
    first, same, other = (random_mechanism.__wrapped__(seed, kind="gough") for seed in (0, 0, 1))
    assert [link.name for link in first.links] == [link.name for link in same.links]
    assert all((a.placement == b.placement).all() for a, b in zip(first.joints, same.joints, strict=True))
    assert [link.name for link in first.links] != [link.name for link in other.links]


def test_every_kind_of_closure_is_drawn() -> None:
    drawn_kinds = {closure.kind for kind in KINDS for closure in random_mechanism(0, kind=kind).closures}
    assert drawn_kinds == set(CLOSURES)
    assert all(count > 0 for count in ROW_COUNT.values())
