"""Robots written twice, as SDF and as URDF, have the same models."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import ddm, idm
from hybridyn.structure.robot import HybridRobot
from tests.comparing import close_to
from tests.conversion.judge import mapped, order
from tests.description.reading import holds
from tests.judging import efforts
from tests.oracle import Oracle
from tests.samples import slow
from tests.sdf_texts import random_pair, sdf
from tests.shipped import states_near_home

#: Two readers of the same numbers, whose rotations pass through angles on different ways.
TWO_READERS = 1e-11

VERSIONS = ("1.4", "1.5", "1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12")


def both(seed: int, version: str, folder: Path) -> tuple[HybridRobot, HybridRobot]:
    """Return a random robot, read from URDF and from SDF."""
    pin.seed(seed)
    texts = random_pair(seed, version)
    (folder / "one.urdf").write_text('<robot name="robot">' + "\n".join(texts.urdf) + "</robot>")
    (folder / "two.sdf").write_text(sdf(*texts.sdf, version=version))
    return tuple(hybridyn.load(folder / name, motors=texts.motors) for name in ("one.urdf", "two.sdf"))  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("seed", "version"),
    [
        (1, "1.4"), (2, "1.6"), (3, "1.9"),
        *(slow(seed, version) for version in VERSIONS for seed in range(4, 14)),
    ],
)  # fmt: skip
def test_both_models_are_those_of_the_urdf(seed: int, version: str, tmp_path: Path) -> None:
    urdf, read = both(seed, version, tmp_path)
    numbers = ("lower", "upper", "velocity", "effort", "damping", "friction")
    stated = {one.name: {word: getattr(one, word) for word in numbers} for one in urdf.description.joints}
    holds(read.description, {"joints": stated})
    endless = {
        name: (1.0, 0.0) for name, kind in zip(urdf.joints, urdf.kinds, strict=True) if kind == "continuous"
    }
    q, v, a = states_near_home(replace(urdf.description, home=endless), "fixed", seed, 2)
    theirs, at = mapped(urdf, read, q), order(urdf, read)
    tau = idm(urdf, q, v, a, effects="model")
    close_to(idm(read, theirs, v[:, at], a[:, at], effects="model"), tau, TWO_READERS)
    tau = efforts(urdf.description, len(q))
    expected = ddm(urdf, q, v, tau)[:, at]
    close_to(ddm(read, theirs, v[:, at], tau), expected, TWO_READERS)
    turn = np.random.default_rng(seed).uniform(-1, 1, size=20)
    close_to(open_loop(read, turn), open_loop(urdf, turn), TWO_READERS)


def open_loop(robot: HybridRobot, turn: np.ndarray) -> np.ndarray:
    """Return the oracle's closure rows [m, -] with its joints, by name, at drawn positions."""
    oracle = Oracle(robot.description)
    q = np.zeros(oracle.nq)
    for number, name in enumerate(sorted(oracle.coordinates)):
        kind, at, _ = oracle.coordinates[name]
        x = turn[number]
        q[at] = (np.cos(x), np.sin(x)) if kind == "continuous" else x
    return oracle.tree.values(oracle.posture(q), q)
