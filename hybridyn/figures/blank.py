"""Create an empty matplotlib figure without pyplot, so that no window opens and no figure stays in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import HybridynError, install_advice

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def empty_figure(width: float, height: float) -> Figure:
    """Return an empty figure.

    Args:
        width: Its width [inch].
        height: Its height [inch].

    Raises:
        HybridynError: matplotlib is missing.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        message = f"figures need matplotlib: {install_advice('plot')}"
        raise HybridynError(message) from error
    return Figure(figsize=(width, height), layout="constrained")
