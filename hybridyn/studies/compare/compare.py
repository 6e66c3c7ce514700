"""`compare`: what other engines make of a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from os import PathLike

import numpy as np

from ...description.names import did_you_mean, listed
from ...dynamics.direct import ddm
from ...errors import HybridynError, ModelError, install_advice
from ...simulation.simulate import simulate
from ...simulation.solver import Solver
from ...spatial import Array
from ...structure.robot import HybridRobot
from ...threads import one_thread
from .judge_engine import judge_engine
from .judging import SECONDS, ClosureFate, Verdict, call_time
from .own_file import own_file
from .states import State, closure_names, draw_states, open_by, start_posture

#: Engines by name: package to import, package to ask for the version, extra.
ENGINES = {
    "pinocchio": ("pinocchio", "pin", ""),
    "mujoco": ("mujoco", "mujoco", "mjcf"),
    "drake": ("pydrake", "drake", "drake"),
    "newton": ("newton", "newton", "newton"),
}
#: Largest relative difference that counts as the same robot.
TOLERANCE = 1e-6
#: Tolerance of a step of hybridyn's own simulation, which is run for its closures alone.
OWN_ERROR = 1e-5
#: Number of closed states.
SAMPLES = 5


@dataclass(frozen=True)
class Comparison:
    """What engines make of a robot.

    Attributes:
        robot: Name of the robot.
        freedoms: Its freedoms.
        closures: Names of its closures and couplings.
        samples: Number of closed states.
        tolerance: Largest relative difference that counts as the same robot.
        verdicts: hybridyn itself, then each engine in each way.
        skipped: Engines that are not compared, with the reason.
    """

    robot: str
    freedoms: int
    closures: tuple[str, ...]
    samples: int
    tolerance: float
    verdicts: tuple[Verdict, ...]
    skipped: tuple[tuple[str, str], ...]

    @property
    def ignored(self) -> dict[str, list[str]]:
        """Names of the closures that each engine ignores, by engine and way; none that ignores nothing."""
        found = {f"{one.engine}, {one.way}": one.named("ignored") for one in self.verdicts}
        return {name: closures for name, closures in found.items() if closures}

    @property
    def different(self) -> list[str]:
        """Engines and ways that compute another robot, or the same less exactly than the tolerance."""
        return [
            f"{one.engine}, {one.way}"
            for one in self.verdicts
            if not one.refusal and not one.agrees(self.freedoms, self.tolerance)
        ]


@one_thread()
def compare(
    robot: HybridRobot,
    engines: Sequence[str] = ("pinocchio", "mujoco"),
    *,
    samples: int = SAMPLES,
    seed: int = 0,
    tolerance: float = TOLERANCE,
    drift: bool = True,
    postures: Array | None = None,
    xacro_args: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | PathLike[str]] = (),
) -> Comparison:
    """Compare what engines make of a robot with hybridyn.

    Args:
        engines: Names of `ENGINES`; those that are not installed are named in `Comparison.skipped`.
        samples: Number of closed states.
        seed: Seed of the states.
        tolerance: Largest relative difference that counts as the same robot.
        drift: Whether each engine simulates a second.
        postures: Closed postures to take the states from, shape (T, nq); None draws them near home.
        xacro_args: Arguments of the robot's xacro file, for engines that read the file themselves.
        package_dirs: Folders that hold packages.

    Raises:
        ModelError: An engine is unknown, or the robot has no closed states to compare at.
    """
    for name in engines:
        if name not in ENGINES:
            known = listed(ENGINES)
            raise ModelError(f"there is no engine '{name}'{did_you_mean(name, ENGINES)}; known: {known}")
    states = draw_states(robot, samples, seed, postures)
    own = own_file(robot, xacro_args, package_dirs)
    start = start_posture(robot) if drift else None
    verdicts, skipped = [_ourselves(robot, states, start)], []
    for name in dict.fromkeys(engines):
        reason = _absent(name)
        if reason:
            skipped.append((name, reason))
            continue
        names = (name, _version(name))
        verdicts += judge_engine(robot, own, states, names, tolerance, start)
    return Comparison(
        robot.name, robot.mobility, tuple(name for name, _ in closure_names(robot)), samples, tolerance,
        tuple(verdicts), tuple(skipped),
    )  # fmt: skip


def _ourselves(robot: HybridRobot, states: list[State], start: Array | None) -> Verdict:
    """Return hybridyn's own row."""
    first, opened = states[0], [0.0] * len(closure_names(robot))
    notes: tuple[str, ...] = ()
    if start is not None:
        efforts = np.zeros(len(robot.motors))
        times = np.linspace(0.0, SECONDS, 11)
        try:
            rates, solver = np.zeros(robot.nv), Solver(rtol=OWN_ERROR, atol=OWN_ERROR)
            postures = simulate(robot, start, rates, times, effort=lambda *_: efforts, solver=solver).q
        except HybridynError as error:  # a singular posture
            postures, notes = np.zeros((0, robot.nq)), (f"the simulation ended early: {error}",)
        for q in postures:
            opened = [max(a, b) for a, b in zip(opened, open_by(robot, q), strict=True)]
    fates = tuple(
        ClosureFate(name, 0.0, "held", opened[i] if start is not None else None)
        for i, (name, _) in enumerate(closure_names(robot))
    )
    own = version("hybridyn")
    return Verdict(
        "hybridyn", own, "ddm", freedoms=robot.mobility, closures=fates, acceleration=0.0, effort=0.0,
        drift=max(opened, default=0.0) if start is not None else None,
        seconds=call_time(lambda: ddm(robot, first.q, first.v, first.tau)), notes=notes,
    )  # fmt: skip


def _absent(name: str) -> str:
    """Return why an engine cannot be compared here, or ""."""
    package, _, extra = ENGINES[name]
    if find_spec(package) is None:
        return f"is not installed: {install_advice(extra)}"
    return ""


def _version(name: str) -> str:
    try:
        return version(ENGINES[name][1])
    except PackageNotFoundError:
        return ""
