"""The shipped robots as records, and states of them that the oracle has closed."""

import shutil
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from hybridyn.description import Description, read
from tests import ROOT
from tests.oracle import Base, Oracle
from tests.robots.mechanisms import home_posture, near
from tests.support import once

ROBOTS = (
    "gough_stewart", "lx4", "rps3", "five_bar", "delta", "tanev", "stewart_ur5", "scara_delta", "snake",
)  # fmt: skip
FROM_HOME = 0.1  # how far a state lies from home, in the oracle's scaled coordinates

States = tuple[np.ndarray, np.ndarray, np.ndarray]


@lru_cache(maxsize=64)
def shipped(name: str, **arguments: str) -> Description:
    """Read a shipped robot, with arguments of its xacro file."""
    path = ROOT / "urdf" / f"{name}.urdf.xacro"
    return read(path, xacro_args=arguments)


def changed_copy(name: str, folder: Path, changes: Mapping[str, tuple[str, str]]) -> Path:
    """Copy a shipped robot with other text in some of its files, and give its file.

    Args:
        folder: Where its folder "urdf" is written.
        changes: File in "urdf" to a text that stands in it, and what replaces this text.
    """
    copy = folder / "urdf"
    shutil.copytree(ROOT / "urdf", copy)
    for file, (before, after) in changes.items():
        text = (copy / file).read_text()
        assert before in text, f"{file} lacks {before}"
        (copy / file).write_text(text.replace(before, after))
    return copy / f"{name}.urdf.xacro"


def states_near_home(description: Description, base: Base, seed: int, count: int) -> States:
    """Draw closed postures near home, with rates and accelerations that the loops allow."""
    asked = ("states_near_home", description, base, seed, count)
    q, v, a = once.kept(lambda: _drawn(description, base, seed, count), *asked)
    return q.copy(), v.copy(), a.copy()


def _drawn(description: Description, base: Base, seed: int, count: int) -> States:
    oracle, rng = Oracle(description, base), np.random.default_rng(seed)
    home, states = home_posture(description, base), []
    for _ in range(count):
        q = near(oracle, home, rng, FROM_HOME)
        v = oracle.project_velocity(q, rng.normal(size=oracle.nv))
        states.append((q, v, oracle.consistent_acceleration(q, v, 3 * rng.normal(size=oracle.nv))))
    q, v, a = (np.array(part) for part in zip(*states, strict=True))
    return q, v, a
