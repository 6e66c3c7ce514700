"""`compare`: what other engines make of a robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from os import PathLike
from typing import get_args

from ... import __version__
from ...description.names import counted, listed
from ...errors import install_advice
from ...structure.robot import HybridRobot
from ...threads import one_thread
from .judging import ClosureFate, Fate, Verdict, judge_way
from .methods import ENGINES, engine_file
from .peer_engine import own_file
from .states import closure_names, draw_states

#: Largest relative difference that counts as the same robot.
TOLERANCE = 1e-6
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
        """Names of the closures that each engine ignores, all or some of their rows, by engine and way."""
        found = {
            f"{one.engine}, {one.way}": one.named("ignored") + one.named("partial") for one in self.verdicts
        }
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
    xacro_args: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | PathLike[str]] = (),
) -> Comparison:
    """Compare what engines make of a robot with hybridyn.

    Args:
        engines: Names of `ENGINES`, of which those that are not installed are named in
            `Comparison.skipped`, or names that packages add.
        samples: Number of closed states.
        seed: Seed of the states.
        tolerance: Largest relative difference that counts as the same robot.
        xacro_args: Arguments of the robot's xacro file, for engines that read the file themselves.
        package_dirs: Folders that hold packages.

    Raises:
        ModelError: An engine is unknown, or the robot has no closed states to compare at.
    """
    files = {name: engine_file(name) for name in engines}
    states = draw_states(robot, samples, seed)
    own = own_file(robot, xacro_args, package_dirs)
    verdicts, skipped = [_ourselves(robot)], []
    for name, file in files.items():
        if name in ENGINES and find_spec(name) is None:
            skipped.append((name, f"is not installed: {install_advice(ENGINES[name])}"))
            continue
        names = name, (import_module(name) if name in ENGINES else file).__version__
        verdicts += [
            judge_way(way, build, robot, states, names, tolerance) for way, build in file.ways(robot, own)
        ]
    return Comparison(
        robot.name, robot.mobility, closure_names(robot), samples, tolerance,
        tuple(verdicts), tuple(skipped),
    )  # fmt: skip


def _ourselves(robot: HybridRobot) -> Verdict:
    """Return hybridyn's own row."""
    held = tuple(ClosureFate(name, 0.0, "held") for name in closure_names(robot))
    return Verdict(
        "hybridyn", __version__, "ddm", freedoms=robot.mobility, closures=held, acceleration=0.0,
        effort=0.0,
    )  # fmt: skip


HEADS = (
    "engine", "how the robot came in", "freedoms", "closures", "accelerations", "efforts",
)  # fmt: skip


def _row(comparison: Comparison, verdict: Verdict) -> list[str]:
    """Return the cells of an engine and way."""
    who = [f"{verdict.engine} {verdict.version}", verdict.way]
    if verdict.refusal:
        return [*who, "-", "not compared", "-", "-"]
    fates = {fate: len(verdict.named(fate)) for fate in get_args(Fate)}
    differs = " (!)" * (verdict.freedoms != comparison.freedoms)
    return [
        *who, f"{verdict.freedoms}{differs}",
        ", ".join(f"{count} {fate}" for fate, count in fates.items() if count) or "none",
        f"{verdict.acceleration:.1e}", f"{verdict.effort:.1e}",
    ]  # fmt: skip


def remarks(comparison: Comparison) -> list[str]:
    """Return what the table does not say: names of closures, refusals, engines that are skipped."""
    out = []
    for verdict in comparison.verdicts:
        who = f"{verdict.engine}, {verdict.way}"
        if verdict.refusal:
            out.append(f"{who}: {verdict.refusal}")
        if names := verdict.named("ignored"):
            out.append(f"{who}: ignores {listed(names)}")
        for closure in verdict.closures:
            if closure.fate == "partial":
                rows = f"{closure.lost} of its {counted(closure.rows, 'independent row')}"
                out.append(f"{who}: holds '{closure.name}' in part: it ignores {rows}")
        soft = [closure for closure in verdict.closures if closure.fate == "softened"]
        if soft:
            worst = max(closure.left for closure in soft)
            out.append(
                f"{who}: softens {listed(closure.name for closure in soft)}; up to {worst:.2g} of the free "
                "opening is left"
            )
        out += [f"{who}: {note}" for note in verdict.notes]
    out += [f"{name}: {reason}" for name, reason in comparison.skipped]
    return out


def head(comparison: Comparison) -> str:
    """Return the line above the table."""
    return (
        f"{comparison.robot}: {counted(comparison.freedoms, 'freedom')}, "
        f"{counted(len(comparison.closures), 'closure')}; {counted(comparison.samples, 'closed state')}, "
        f"differences relative to hybridyn's"
    )


def as_text(comparison: Comparison) -> str:
    """Write the comparison as lines of text with aligned columns."""
    rows = [HEADS, *(_row(comparison, verdict) for verdict in comparison.verdicts)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADS))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([head(comparison), *(line.rstrip() for line in lines), *remarks(comparison)])
