"""Rows of closures in the axes of their author, in which hybridyn reports wrenches."""

from __future__ import annotations

import numpy as np

from ..description.closure_forms import PERPENDICULAR, ROWS, words_of_rows
from ..description.records import Array, Closure
from .losses import Losses


def rows_of(closure: Closure, losses: Losses) -> tuple[str, Array]:
    """Return the rows of a closure as words, and its own axes in those that the words are about.

    Args:
        losses: Receives a closure of which the words cannot be about the author's axes.

    Returns:
        The words, and a rotation, shape (3, 3): that of `Closure.turn`, or the identity.
    """
    order = closure.turn.argmax(axis=0)
    turn: Array = np.eye(3)[:, order]
    if closure.rotation == "perpendicular" or not np.array_equal(closure.turn, turn):
        if not np.array_equal(closure.turn, np.eye(3)):
            losses.add("axes in which hybridyn reports the wrenches of closures", closure.name)
        order, turn = np.arange(3), np.eye(3)
    own = {kind + "xyz"[i]: kind + "xyz"[axis] for kind in "tr" for i, axis in enumerate(order)}
    words = {own.get(word, word) for word in words_of_rows(closure.translations, closure.rotation)}
    return " ".join(word for word in (*ROWS, PERPENDICULAR) if word in words), turn
