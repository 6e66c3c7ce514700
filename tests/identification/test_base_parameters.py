"""Base parameters: the numerical count, the count of the grouping rules, and what the efforts depend on."""

import numpy as np
import pytest

import hybridyn
from hybridyn.identification.grouping import grouping
from hybridyn.identification.parameters import standard_parameters
from hybridyn.identification.robot_with import with_parameters
from hybridyn.structure.building import build_robot
from tests.identification.robots import described
from tests.robots.mechanisms import KINDS, random_states
from tests.robots.shipped import ROBOTS, shipped, states_near_home

#: Base parameters at the states of the tests, relative to the largest effort.
AGREE = 1e-11
#: The same on random mechanisms: some base columns have a condition of 1e7 (worst seen: 2e-11).
AGREE_RANDOM = 1e-9
EVERY = ["model", "offsets"]
#: Base parameters of each shipped robot: inertial ones, and with equal legs; both with rotors, friction and
#: offsets.
RANKS = {
    "gough_stewart": (82, 22, 106, 31),
    "lx4": (328, 52, 424, 79),
    "rps3": (25, 15, 37, 21),
    "five_bar": (11, 11, 17, 17),
    "delta": (34, 12, 43, 17),
    "tanev": (70, 36, 94, 48),
    "stewart_ur5": (124, 64, 172, 97),
    "scara_delta": (62, 28, 85, 47),
    "snake": (540, 120, 684, 159),
}
LARGE = ("lx4", "snake")
BY_DEFAULT = [pytest.param(name, marks=[pytest.mark.slow] if name in LARGE else []) for name in ROBOTS]
#: Recipes in which a planar loop or a rack ties vectors beyond the rules.
TIED = {
    "four_bar", "four_bar_two_motors", "five_bar", "five_bar_one_motor", "six_bar", "gear_rack",
    "gear_across", "gear_inside", "chain_of_bars", "branched", "on_leg", "legged",
}  # fmt: skip
QUICK = ("serial", "four_bar", "gear_rack", "loop_planar", "rssr")


@pytest.mark.parametrize("name", BY_DEFAULT)
def test_both_counts_agree_on_shipped_robots(name: str) -> None:
    robot = hybridyn.load(name)
    for choice, rank in zip(
        ((None, False), (None, True), (EVERY, False), (EVERY, True)), RANKS[name], strict=True
    ):
        found = grouping(robot, effects=choice[0], symmetric=choice[1])
        assert (found.rank, found.numerical, found.loops) == (rank, rank, "")


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        pytest.param(kind, seed, marks=[] if kind in QUICK else [pytest.mark.slow])
        for seed, kind in enumerate(KINDS)
    ],
)
def test_the_rules_count_at_least_the_numerical_rank_and_the_loops_explain_the_rest(
    kind: str, seed: int
) -> None:
    base = ("fixed", "moving", "floating")[seed % 3]
    description = described(kind, seed, base)
    robot = build_robot(description, base=base)
    for effects in (None, EVERY):
        found = grouping(robot, effects=effects)
        assert found.numerical <= found.rank
        assert bool(found.loops) == (found.rank > found.numerical)
        if found.loops:
            assert kind in TIED
            assert "closed by" in found.loops
    parameters = hybridyn.base_parameters(robot)
    q, v, a = random_states(description, base, seed, 3)
    rows = hybridyn.regressor(robot, q, v, a)
    want = rows.Y @ rows.values
    got = rows.Y[..., parameters.columns] @ parameters.values
    assert np.abs(got - want).max() <= AGREE_RANDOM * np.abs(want).max()


def test_random_postures_stay_on_the_branch_that_they_start_from() -> None:
    """One step of 1.5 rad crosses parallelograms of this Delta, whose rods then are not parallel: 38."""
    found = grouping(build_robot(described("delta_rods", 102)))
    assert found.numerical == found.rank == 35


@pytest.mark.parametrize("symmetric", [False, True])
def test_other_numbers_with_equal_base_parameters_give_equal_efforts(symmetric: bool) -> None:
    robot = hybridyn.load("rps3")
    base = hybridyn.base_parameters(robot, effects=EVERY, symmetric=symmetric)
    q, v, a = states_near_home(shipped("rps3"), "fixed", 1, 4)
    rows = hybridyn.regressor(robot, q, v, a, effects=EVERY, symmetric=symmetric)
    values = rows.values + np.random.default_rng(3).normal(size=len(rows.values))
    want, got = rows.Y @ values, rows.Y[..., base.columns] @ (base.combination @ values)
    assert np.abs(got - want).max() <= AGREE * np.abs(want).max()
    assert not rows.Y[..., [base.standard.names.index(name) for name in base.never]].any() or (
        np.abs(rows.Y[..., [base.standard.names.index(name) for name in base.never]]).max()
        <= AGREE * np.abs(rows.Y).max()
    )


def test_names_and_contributions_can_be_read() -> None:
    base = hybridyn.base_parameters(hybridyn.load("five_bar"))
    assert base.names[0].startswith("mx of m1_left_upper")
    assert all(name.count(" of ") >= 1 for name in base.names)
    lead = base.standard.names[base.columns[0]]
    assert base.contributions(lead) == {base.names[0]: 1.0}
    assert "Ixx of m1_left_upper" in base.never


@pytest.mark.parametrize("symmetric", [False, True])
def test_a_robot_with_other_parameters_has_their_efforts(symmetric: bool) -> None:
    robot = hybridyn.load("rps3")
    parameters = standard_parameters(robot, effects="model", symmetric=symmetric)
    factor = 1 + 0.1 * np.random.default_rng(5).random(len(parameters.values))
    changed = with_parameters(robot, factor * parameters.values, effects="model", symmetric=symmetric)
    q, v, a = states_near_home(shipped("rps3"), "fixed", 1, 4)
    rows = hybridyn.regressor(robot, q, v, a, effects="model", symmetric=symmetric)
    want = hybridyn.idm(changed, q, v, a, effects="model")
    assert np.abs(rows.Y @ (factor * rows.values) - want).max() <= 1e-12 * np.abs(want).max()


def test_a_payload_has_parameters_of_its_own() -> None:
    payload = hybridyn.effects.Payload(
        "m1_platform", 2.0, (0.1, 0.0, 0.05), ((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1))
    )
    robot = hybridyn.with_effects(hybridyn.load("rps3"), ["default", payload])
    q, v, a = states_near_home(shipped("rps3"), "fixed", 1, 4)
    rows = hybridyn.regressor(robot, q, v, a)
    assert rows.values[rows.names.index("m of payload on m1_platform")] == 2.0
    want = hybridyn.idm(robot, q, v, a)
    assert np.abs(rows.Y @ rows.values - want).max() <= 1e-12 * np.abs(want).max()
    heavier = with_parameters(robot, {"m of payload on m1_platform": 3.0})
    values = standard_parameters(robot).vector({"m of payload on m1_platform": 3.0})
    want = hybridyn.idm(heavier, q, v, a)
    assert np.abs(rows.Y @ values - want).max() <= 1e-12 * np.abs(want).max()
