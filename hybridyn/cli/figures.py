"""The option that names a figure's file, and the figure's way into it."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".png", ".svg", ".pdf")


def figure_file(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
    """Check the ending and the folder of a figure's file, before any work is done."""
    if value is None:
        return None
    if not value.lower().endswith(FORMATS):
        raise click.BadParameter(f"'{value}' must end in {', '.join(FORMATS)}", ctx, param)
    folder = os.path.dirname(value)
    if folder and not os.path.isdir(folder):
        raise click.BadParameter(f"there is no folder '{folder}'", ctx, param)
    return value


def takes_plot(what: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Give a command `plot`, the file of a figure or None.

    Args:
        what: What the figure shows.
    """
    text = f"Also draw {what}: .png, .svg or .pdf"
    return click.option("--plot", metavar="FILE", callback=figure_file, help=text)


def save(figure: Figure, target: str) -> None:
    """Write a figure; the file appears when it is complete.

    Args:
        figure: The figure.
        target: Its file.
    """
    partial = f"{target}.part{os.path.splitext(target)[1]}"
    try:
        figure.savefig(partial, dpi=120)
        os.replace(partial, target)
    finally:
        if os.path.exists(partial):
            os.unlink(partial)
