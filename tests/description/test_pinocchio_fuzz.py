"""No wrong number or joint in a Pinocchio model ends in a traceback, a crash or a robot that lost a loop.

Each changed model is read, or refused with a `HybridynError` of one line.
"""

from collections.abc import Callable
from operator import setitem

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.errors import HybridynError
from tests.description.pin_models import JOINTS, Drawn, drawn, seeded
from tests.description.reading import finite
from tests.support.samples import slow
from tests.support.waiting import must_end

CASES = 10  # per seed

BAD = (float("nan"), float("inf"), -1.0, 0.0, 1e300, -1e-3, 1e-320)
NUMBERS = (
    "armature", "damping", "friction", "rotorInertia", "rotorGearRatio", "effortLimit", "velocityLimit",
    "lowerPositionLimit", "upperPositionLimit",
)  # fmt: skip
Rng = np.random.Generator


def _number(case: Drawn, rng: Rng, joint: int, bad: float) -> None:
    word = str(rng.choice(NUMBERS))
    values = np.array(getattr(case.model, word))
    values[rng.integers(len(values))] = bad
    setattr(case.model, word, values)


#: Changes of a model, given a joint of it and a bad number.
MUTATIONS: dict[str, Callable[[Drawn, Rng, int, float], object]] = {
    "number": _number,
    "mass": lambda case, rng, joint, bad: setattr(case.model.inertias[joint], "mass", bad),
    "lever": lambda case, rng, joint, bad: setattr(
        case.model.inertias[joint], "lever", np.array([bad, 0.0, 0.1])
    ),
    "placement": lambda case, rng, joint, bad: setattr(
        case.model.jointPlacements[joint], "translation", np.array([bad, 0.0, 0.1])
    ),
    "rotation": lambda case, rng, joint, bad: setattr(
        case.model.jointPlacements[joint], "rotation",
        case.model.jointPlacements[joint].rotation * np.array([bad, 1.0, 1.0]),
    ),
    "name": lambda case, rng, joint, bad: setitem(
        case.model.names, joint, str(rng.choice(["", case.model.names[1], "universe", "a\nb", "x" * 300]))
    ),
    "frame": lambda case, rng, joint, bad: setattr(
        case.model.frames[int(rng.integers(len(case.model.frames)))], "name",
        str(rng.choice(["", case.model.frames[0].name, case.model.frames[1].name])),
    ),
    "parent": lambda case, rng, joint, bad: setitem(
        case.model.parents, joint, int(rng.integers(case.model.njoints + 1))
    ),
    "gravity": lambda case, rng, joint, bad: setattr(
        case.model.gravity, "linear", np.array([0.0, bad, -9.81])
    ),
    "home": lambda case, rng, joint, bad: setitem(
        case.model.referenceConfigurations, "home", np.full(case.model.nq + int(rng.integers(-1, 2)), bad)
    ),
    "end": lambda case, rng, joint, bad: setattr(
        case.constraints[0], "joint1_id", int(rng.integers(case.model.njoints + 1))
    ),
    "placement of an end": lambda case, rng, joint, bad: setattr(
        case.constraints[0], "joint2_placement", pin.SE3(np.eye(3), np.array([0.0, bad, 0.0]))
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore")  # of overflow
@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 30))])
def test_mutations(seed: int) -> None:
    rng, refused = seeded(seed, 3), 0
    for _ in range(CASES):
        kinds = [str(kind) for kind in rng.choice([*JOINTS], size=2)]
        case = drawn(
            rng, [*kinds, "R", "S", "RX"], ["3D"], floating=bool(rng.integers(2)), branch=2, armature=0.1
        )
        word, bad = str(rng.choice([*MUTATIONS])), float(rng.choice(BAD))
        MUTATIONS[word](case, rng, int(rng.integers(1, case.model.njoints)), bad)
        what = f"{word} {bad}"
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
