"""Every shipped robot and a random mechanism of every kind, to be identified."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

import hybridyn
from hybridyn.description.records import Description
from hybridyn.identification.base_parameters import BaseParameters
from hybridyn.identification.signals import fourier
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import joint_position
from tests.oracle import Base
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.robots.shipped import ROBOTS
from tests.support.samples import CHOSEN, slow

#: A shipped robot (seed -1), or a kind of random mechanism and its seed.
EVERY = [*((name, -1) for name in ROBOTS), *((kind, seed) for seed, kind in enumerate(KINDS))]
#: Those that are tried by default, and those of which hundreds of runs take no second.
QUICK = (("five_bar", -1), ("rps3", -1), *((kind, seed) for kind, seed in EVERY if kind in CHOSEN))
SMALL = (
    ("five_bar", -1),
    *((kind, list(KINDS).index(kind)) for kind in ("four_bar_two_motors", "gear_three")),
)
#: Period [s] of the motions and their samples.
PERIOD, SAMPLES = 4.0, 512
#: Amplitude of the motors about home [rad, robot sizes], within reach of the loops.
AMPLITUDE = 0.1
OTHER_AMPLITUDES = {
    "loop_universal": 0.003, "loop_spherical": 0.006, "loop_rows_yz": 0.025, "loop_rows_x_fixed": 0.012,
    "loop_rows_parallel": 0.012, "six_bar": 0.4, "planar_rpr": 0.05, "gough": 0.05, "gough_floating": 0.05,
    "gough_eight_motors": 0.05, "gough_gimbals": 0.025, "gough_points": 0.05, "star_three": 0.006,
    "star_four": 0.025, "star_five": 0.05, "gear_across": 1.0, "lx4": 0.025, "tanev": 0.05, "snake": 0.05,
    "stack": 0.025, "stewart_arm": 0.05, "legged": 0.2,
}  # fmt: skip


def cases(without: Sequence[str] = (), quick: Sequence[tuple[str, int]] = QUICK) -> list[Any]:
    """Return the robots as parameters of tests, those that are not quick as slow ones."""
    every = [one for one in EVERY if one[1] < 0 or one[0] not in without]
    return [one if one in quick else slow(*one) for one in every]


def described(kind: str, seed: int, base: Base = "fixed") -> Description:
    """Return a random mechanism; motors of several units share their load by limits of their efforts."""
    found = random_mechanism(seed, kind=kind, base=base)
    if kind != "gough_eight_motors":
        return found
    return replace(found, joints=tuple(replace(joint, effort=10.0) for joint in found.joints))


@lru_cache(maxsize=4)
def robot_of(kind: str, seed: int) -> hybridyn.HybridRobot:
    """Return a robot; a shipped one has friction and rotors in its files."""
    return hybridyn.load(kind) if seed < 0 else build_robot(described(kind, seed))


def effects_of(seed: int) -> str | None:
    """Return the effects of the model: a random mechanism has numbers of bodies only."""
    return "model" if seed < 0 else None


def base_of(kind: str, seed: int, symmetric: bool = False) -> BaseParameters:
    """Return the base parameters."""
    return hybridyn.base_parameters(robot_of(kind, seed), effects=effects_of(seed), symmetric=symmetric)


def other_values(base: BaseParameters, seed: int) -> np.ndarray:
    """Return standard parameters of a robot whose bodies are up to 30 % heavier or lighter."""
    rng, out = np.random.default_rng(seed + 1), base.standard.values.copy()
    for at in base.standard.tens:
        out[at] *= rng.uniform(0.7, 1.3)
    return out


@lru_cache(maxsize=4)
def flight(kind: str, seed: int) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return times and states of a motion about home; of redundant motors, the others follow."""
    robot, rng = robot_of(kind, seed), np.random.default_rng(seed + 1)
    motors = [name for module in robot.modules for name in module.motors[: module.mobility]]
    home = np.array([float(joint_position(robot, robot.home, name)) for name in motors])
    size = [robot.bodies.size if robot.records[name].kind == "prismatic" else 1.0 for name in motors]
    each = OTHER_AMPLITUDES.get(kind, AMPLITUDE) * np.array(size) / np.arange(1, 6)[:, None]
    cosine, sine = each * rng.normal(size=(2, *each.shape))
    time = np.arange(SAMPLES) / SAMPLES * PERIOD
    x = fourier(home - cosine.sum(axis=0), cosine, sine, PERIOD, time)
    given = {name: tuple(level[:, i] for level in x) for i, name in enumerate(motors)}
    return time, hybridyn.assemble(robot, motors=given)
