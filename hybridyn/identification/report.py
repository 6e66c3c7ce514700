"""The result of an identification as Markdown: what is known now, how well, and what is not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..description.names import counted
from .judging import SIGNIFICANT, Residuals

if TYPE_CHECKING:
    from .identify import Identification

#: Relative standard deviation from which a parameter counts as badly known.
BAD = 0.3
#: Names that a sentence lists.
MOST = 12


def report(found: Identification) -> str:
    """Return the report of an identification, in Markdown."""
    parts = [
        f"# Identification of {found.robot.name}",
        "\n".join(f"- {line}" for line in summary(found)),
        "## Motors",
        _table(*_motors(found)),
        "The probability is that of such a spectrum if the residual were white noise; below "
        f"{SIGNIFICANT / len(found.noise):.1g} the model leaves something out (a friction, a payload, a "
        "flexibility), or noise of the positions is not white in their band.",
        "## Base parameters",
        _table(*_parameters(found)),
        "## What is not known",
        "\n\n".join(unknown(found)),
        "## The robot with these parameters",
        _possible(found),
    ]
    return "\n\n".join(parts) + "\n"


def summary(found: Identification) -> list[str]:
    """Return what was done and how well it fits, a line each."""
    size, motors = found.fit.measured.shape
    lines = [
        f"{counted(len(found.values), 'base parameter')} from {counted(size, 'sample')} of "
        f"{counted(motors, 'motor')}, method {found.method}; condition {found.condition:.3g}",
        *found.remarks,
        f"residual: {_percent(found.fit)} of the efforts; {_verdict(found, found.fit)}",
    ]
    if found.validation is not None:
        lines.append(
            f"second motion: {_percent(found.validation)} of the efforts; {_verdict(found, found.validation)}"
        )
    if found.outliers:
        lines.append(f"outliers: {found.outliers:.2%} of the samples count less than half")
    return lines


def unknown(found: Identification) -> list[str]:
    """Return sentences about the parameters that are not known, and why."""
    bad = [name for name, x in zip(found.names, found.relative, strict=True) if x > BAD]
    out = [
        f"{counted(len(bad), 'base parameter')} with a standard deviation above {BAD:.0%}: the motion tells "
        f"little of them, or they are near zero. {_listed(bad)}".strip()
    ]
    if found.never:
        out.append(
            f"{counted(len(found.never), 'standard parameter')} on which no effort of a motor depends, "
            f"whatever the motion: they keep the numbers of the file. {_listed(found.never)}"
        )
    grouped = sum(" + " in name or " - " in name for name in found.names)
    out.append(
        f"{counted(grouped, 'base parameter')} are sums, whose terms no motion tells apart; how a "
        "sum is shared follows the file's numbers."
    )
    return out


def _percent(residuals: Residuals) -> str:
    low, high = residuals.relative.min(), residuals.relative.max()
    return f"{low:.2%} to {high:.2%}"


def _verdict(found: Identification, residuals: Residuals) -> str:
    wrong = [name for name, x in zip(found.robot.motors, residuals.coloured, strict=True) if x]
    return f"it is not white noise at {_listed(wrong)}" if wrong else "it looks like white noise"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST} more" if len(names) > MOST else ""
    return ", ".join(f"`{name}`" for name in names[:MOST]) + more


def _motors(found: Identification) -> tuple[list[str], Iterator[list[str]]]:
    """Return the head and the rows of the table of motors."""
    head = ["motor", "noise", "unit", "residual / effort", "probability"]
    head += ["second motion", "probability"] if found.validation else []
    head += ["effort per current"] if found.constants is not None else []

    def rows() -> Iterator[list[str]]:
        """Yield a row for each motor."""
        for i, motor in enumerate(found.robot.motors):
            row = [f"`{motor}`", f"{found.noise[i]:.3g}", found.robot.effort_units[i]]
            for judged in (found.fit, found.validation):
                if judged is not None:
                    row += [f"{judged.relative[i]:.2%}", f"{judged.probability[i]:.2g}"]
            if found.constants is not None:
                row.append(f"{found.constants[0, i]:.5g} ± {found.constants[1, i]:.1g}")
            yield row

    return head, rows()


def _parameters(found: Identification) -> tuple[list[str], Iterator[list[str]]]:
    """Return the head and the rows of the table of base parameters."""
    rows = (
        [f"`{name}`", f"{of_file:.5g}", f"{x:.5g}", f"{deviation:.2g}", f"{relative:.1%}", f"{of_robot:.5g}"]
        for name, of_file, x, deviation, relative, of_robot in zip(
            found.names, found.of_file, found.values, found.deviation, found.relative, found.of_robot,
            strict=True,
        )
    )  # fmt: skip
    return ["base parameter", "file", "estimate", "deviation", "relative", "possible robot"], rows


def _possible(found: Identification) -> str:
    """Return how the robot that can exist differs from the estimate."""
    away = np.abs(found.of_robot - found.values) / np.maximum(found.deviation, np.finfo(float).tiny)
    how = (
        "Some bodies would have been impossible; the conic program found the nearest that are not."
        if found.constrained
        else "All bodies are possible as they were estimated."
    )
    return (
        f"{how} Its base parameters differ from the estimates by at most {away.max():.2g} standard "
        f"deviations (`{found.names[int(away.argmax())]}`)."
    )


def _table(head: Sequence[str], rows: Iterator[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
