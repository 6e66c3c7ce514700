"""What is wrong in a header whose columns are known one by one: what is missing or contradicts another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..description.names import did_you_mean, listed
from .layout import Layout

#: What is told of a free base without a pose.
FREE = (
    "; how a free base moves depends on what came before, 'hybridyn simulate' computes it; or hold it "
    "(base='fixed')"
)


def faults(
    layout: Layout, movable: Sequence[str], motors: Sequence[str], root: str, base: str, passive: int,
    efforts: bool,
) -> Iterator[tuple[str | None, str]]:  # fmt: skip
    """Yield column and message of what is wrong in columns that are known one by one."""
    if efforts:
        for name in [name for name in layout.efforts if name not in motors]:
            hint = did_you_mean(name, motors)
            yield f"{name}/effort", f"joint '{name}' is not driven{hint}; drop it, or name it as a motor"
        if absent := [name for name in motors if name not in layout.efforts]:
            left = listed(absent)
            yield (
                f"{absent[0]}/effort",
                f"is missing: every motor needs its effort ({left} left); write 0 for a free one",
            )
    signal = layout.poses.get(root)
    if base == "fixed" and signal is not None:
        yield (
            f"{root}/pose/{signal.components[0]}",
            f"'{root}' is the root link and the base is fixed; choose a moving base, or drop its pose",
        )
    lacking = "x" if signal is None else signal.lacks
    if base != "fixed" and lacking:
        message = f"is missing: with a {base} base the table gives the whole pose of '{root}' in the world"
        message += FREE if base == "floating" else ""
        yield f"{root}/pose/{lacking}", message
    yield from _input_faults(layout, movable, motors, root, passive)
    for signal in layout.signals if layout.time is None else ():
        if signal.missing:
            rate = f"{signal.name}/{signal.missing[0]}"
            yield "time", f"is missing, and so is '{rate}': without time no rates can be fitted"


def _input_faults(
    layout: Layout, movable: Sequence[str], motors: Sequence[str], root: str, most: int
) -> Iterator[tuple[str | None, str]]:
    """Yield what is wrong unless joints and poses are a full state, or a posture follows from them."""
    platforms = [key for key in layout.poses if key != root]
    if layout.full_state:
        if platforms:
            yield (
                f"{platforms[0]}/pose/{layout.poses[platforms[0]].components[0]}",
                f"every joint is given too; drop the poses of {listed(platforms)} or the passive joints",
            )
        return
    passive = [name for name in layout.joints if name not in motors]
    if passive and len(passive) > most:
        rest = [name for name in movable if name not in layout.joints]
        message = f"'{passive[0]}' is not a motor; drop it, or give every joint (missing: {listed(rest)})"
        message += f"; for the motion of output joints, 'hybridyn idm --map {','.join(passive)}'"
        yield f"{passive[0]}/position", message
    absent = [name for name in motors if name not in layout.joints]
    if absent and not platforms:
        yield (
            f"{absent[0]}/position",
            f"is missing: give the motors ({listed(absent)} left) or the pose of a link",
        )
    if not motors and not platforms:
        yield None, "the robot has no motors; give the pose of a link, or every joint"
