"""No wrong number or joint in a Pinocchio model ends in a traceback, a crash or a robot that lost a loop.

Each changed model is read, or refused with a `HybridynError` of one line.
"""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.errors import HybridynError
from tests.description.reading import finite
from tests.pin_models import JOINTS, Drawn, drawn
from tests.samples import slow
from tests.waiting import must_end

CASES = 10  # per seed

BAD = (float("nan"), float("inf"), -1.0, 0.0, 1e300, -1e-3, 1e-320)
NUMBERS = (
    "armature", "damping", "friction", "rotorInertia", "rotorGearRatio", "effortLimit", "velocityLimit",
    "lowerPositionLimit", "upperPositionLimit",
)  # fmt: skip
Rng = np.random.Generator


def _joint(case: Drawn, rng: Rng) -> int:
    return int(rng.integers(1, case.model.njoints))


def _number(case: Drawn, rng: Rng, bad: float) -> None:
    word = str(rng.choice(NUMBERS))
    values = np.array(getattr(case.model, word))
    values[rng.integers(len(values))] = bad
    setattr(case.model, word, values)


def _mass(case: Drawn, rng: Rng, bad: float) -> None:
    case.model.inertias[_joint(case, rng)].mass = bad


def _lever(case: Drawn, rng: Rng, bad: float) -> None:
    case.model.inertias[_joint(case, rng)].lever = np.array([bad, 0.0, 0.1])


def _placement(case: Drawn, rng: Rng, bad: float) -> None:
    case.model.jointPlacements[_joint(case, rng)].translation = np.array([bad, 0.0, 0.1])


def _rotation(case: Drawn, rng: Rng, bad: float) -> None:
    placement = case.model.jointPlacements[_joint(case, rng)]
    placement.rotation = placement.rotation * np.where(np.eye(3)[0] == 1, bad, 1.0)


def _name(case: Drawn, rng: Rng, bad: float) -> None:
    case.model.names[_joint(case, rng)] = str(
        rng.choice(["", case.model.names[1], "universe", "a\nb", "x" * 300])
    )


def _frame(case: Drawn, rng: Rng, bad: float) -> None:
    frames = case.model.frames
    frames[int(rng.integers(len(frames)))].name = str(rng.choice(["", frames[0].name, frames[1].name]))


def _parent(case: Drawn, rng: Rng, bad: float) -> None:
    case.model.parents[_joint(case, rng)] = int(rng.integers(case.model.njoints + 1))


def _gravity(case: Drawn, rng: Rng, bad: float) -> None:
    case.model.gravity.linear = np.array([0.0, bad, -9.81])


def _home(case: Drawn, rng: Rng, bad: float) -> None:
    case.model.referenceConfigurations["home"] = np.full(case.model.nq + int(rng.integers(-1, 2)), bad)


def _end(case: Drawn, rng: Rng, bad: float) -> None:
    case.constraints[0].joint1_id = int(rng.integers(case.model.njoints + 1))


def _end_placement(case: Drawn, rng: Rng, bad: float) -> None:
    case.constraints[0].joint2_placement = pin.SE3(np.eye(3), np.array([0.0, bad, 0.0]))


MUTATIONS: tuple[Callable[[Drawn, Rng, float], None], ...] = (
    _number, _mass, _lever, _placement, _rotation, _name, _frame, _parent, _gravity, _home, _end,
    _end_placement,
)  # fmt: skip


@pytest.mark.filterwarnings("ignore")  # of overflow
@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 30))])
def test_mutations(seed: int) -> None:
    rng = np.random.default_rng([seed, 3])
    pin.seed(seed)
    refused = 0
    for _ in range(CASES):
        kinds = [str(kind) for kind in rng.choice([*JOINTS], size=2)]
        case = drawn(
            rng, [*kinds, "R", "S", "RX"], ["3D"], floating=bool(rng.integers(2)), branch=2, armature=0.1
        )
        mutation, bad = MUTATIONS[rng.integers(len(MUTATIONS))], float(rng.choice(BAD))
        what = f"{mutation.__name__} {bad}"
        mutation(case, rng, bad)
        try:
            with must_end(what.encode()):
                found = hybridyn.from_pinocchio(case.model, case.constraints).description
        except HybridynError as error:
            message = str(error)
            assert "\n" not in message, what
            refused += 1
            continue
        assert len(found.closures) == 1, what
        floats = found.base == "floating"
        assert sum(joint.kind != "fixed" for joint in found.joints) >= case.model.njoints - 1 - floats, what
        finite(found, what)
    assert 0 < refused < CASES
