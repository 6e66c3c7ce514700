"""Friction that grows with load, against multipliers of all rows in long double (`Judge`)."""

from collections.abc import Callable

import numpy as np
import pytest

import hybridyn
from hybridyn.description.records import Description
from hybridyn.dynamics.reactions import Reactions
from hybridyn.effects import LoadFriction
from hybridyn.effects.load_friction import on_loads
from hybridyn.errors import ActuationError
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.judges.judging import BASES
from tests.oracle import Base, Judge, Long, Oracle
from tests.robots.mechanisms import KINDS, random_mechanism, random_states
from tests.support.comparing import close_to
from tests.support.samples import slow

JUDGED = 1e-9  # of the largest: the given motions are rounded, and closure rows have conditions to 100
SHARED = 1e-6  # part of a self-stress from which a load counts as shared
#: A loop in a plane, a coupling across loops, a module on a module: what runs by default.
FEW = [("four_bar", 1, "floating"), ("gear_across", 2, "fixed"), ("legged", 0, "moving")]
#: Of every recipe three, one on each base: arms of several modules among them.
ALL = [(k, seed, BASES[(i + seed) % 3]) for seed in range(3, 8) for i, k in enumerate(KINDS)]
CASES = [*FEW, *(slow(*case) for case in [one for one in ALL if not KINDS[one[0]].massless][:200])]

LOADS = ("radial", "axial", "tilt", "normal")
WORDS = (*LOADS, "static", "speed")
HINGE, BALL = {"radial": 2e-3, "axial": 1e-3, "tilt": 0.01}, {"radial": 2e-3}
SLIDE = {"normal": 0.02, "tilt": 0.02}
NEAR_REST = {"static": 1.5, "speed": 0.7}  # rates are near one


def effect(law: dict[str, dict[str, float]]) -> LoadFriction:
    by_word = {word: {j: own[word] for j, own in law.items() if word in own} for word in WORDS}
    return LoadFriction(**by_word)  # type: ignore[arg-type]


def law_of(robot: hybridyn.HybridRobot, reactions: Reactions) -> dict[str, dict[str, float]]:
    """Give every joint friction by each part of its load that closures do not share."""
    full: dict[str, dict[str, float]] = {}
    for name, kind in zip(robot.joints, robot.kinds, strict=True):
        own = BALL if kind == "spherical" else SLIDE if kind.slides else HINGE
        if name != "root_joint" and (kind.single or kind == "spherical"):
            full[name] = own
    placed = on_loads(effect(full), robot)
    law: dict[str, dict[str, float]] = {}
    for at, word, part in zip(placed.of_joint, placed.words, placed.part, strict=True) if placed else ():
        name = placed.joints[at]
        shared = np.einsum("ij,tjk->tik", part, reactions.joints_shared[name])
        if np.abs(shared).max(initial=0.0) < SHARED:
            law.setdefault(name, dict(NEAR_REST))[word] = full[name][word]
    return law


def drawn(
    kind: str, seed: int, base: Base, samples: int
) -> tuple[Description, hybridyn.HybridRobot, tuple[Array, Array, Array], Array, dict[str, dict[str, float]]]:
    """Draw a mechanism, its robot, states, their efforts without friction, and friction in every joint."""
    description = random_mechanism(seed, kind=kind)
    robot = build_robot(description, base=base)
    robot = build_robot(description, base=base, held=robot.cut_joints)
    state = random_states(description, base, seed, samples)
    weights = np.ones(len(robot.motors))
    tau, reactions = hybridyn.idm(robot, *state, weights=weights, reactions=True)
    return description, robot, state, tau, law_of(robot, reactions)


def loosened(law: dict[str, dict[str, float]], call: Callable[[LoadFriction], Array]) -> float:
    """Return the factor at which a random mechanism no longer jams."""
    try:
        call(effect(law))
    except ActuationError as error:
        if error.size is None or "may jam" not in str(error):
            raise
        return 0.3 / error.size
    return 1.0


@pytest.mark.parametrize(("kind", "seed", "base"), CASES)
def test_friction_of_every_joint_is_that_of_the_multipliers(kind: str, seed: int, base: Base) -> None:
    """`ddm` inverts `idm`; motors give as much more as friction takes at the joints."""
    description, robot, ((q,), (v,), (a,)), tau, law = drawn(kind, seed, base, 1)
    weights, prescribed = np.ones(len(robot.motors)), a[:6] if base == "moving" else None
    for call in (
        lambda law: hybridyn.idm(robot, q, v, a, effects=["default", law], passive="solved", weights=weights),
        lambda law: hybridyn.ddm(robot, q, v, tau[0], effects=["default", law]),
    ):
        factor = loosened(law, call)
        law = {
            name: {word: (factor if word in LOADS else 1) * x for word, x in own.items()}
            for name, own in law.items()
        }
    effects = ["default", effect(law)]
    judge = Judge(Oracle(description, base, arithmetic=Long()), law, effects[1].width)
    tau = tau[0]
    if KINDS[kind].motors != "few":  # else friction would need an effort where there is no motor
        wanted, plain = judge.idm(q, v, a), tau
        tau = hybridyn.idm(robot, q, v, a, effects=effects, weights=weights)
        close_to(tau, wanted.result.astype(float), JUDGED)
        lost = -float(
            v @ judge.directions(np.asarray(v, np.longdouble)) @ np.array([*wanted.friction.values()])
        )
        rates = v[[robot.v_slices[robot.joint_index[motor]].start for motor in robot.motors]]
        given = (tau - plain) @ rates
        assert given >= 0
        assert abs(given - lost) <= JUDGED * np.abs(tau * rates).sum()
    found = hybridyn.ddm(robot, q, v, tau, base_acceleration=prescribed, effects=effects)
    close_to(found, judge.ddm(q, v, tau, prescribed).result.astype(float), JUDGED)
    if KINDS[kind].motors != "few":
        close_to(found, a, JUDGED)
