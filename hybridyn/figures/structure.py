"""Draw the tree of modules with matplotlib, as cards in columns, starting from the ground."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..colours import MOTOR, lighter, module_colour
from ..joints.kinds import JointKind
from .as_matplotlib import empty_figure
from .module_tree import Card, Leg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# All lengths in inches.
WIDTH, INDENT, GUTTER, GAP = 4.2, 0.35, 0.55, 0.28
TITLE, LINE, LEG, PAD = 0.30, 0.21, 0.30, 0.12
#: Target height of a column while there are few columns.
TALLEST = 9.0
MOST_COLUMNS = 4
MARGIN, KEY = 0.3, 0.45
#: Largest distance between neighbouring joints of a leg.
STEP = 0.33
#: Facts that are written on a card; the text tells them all.
FACTS = ("like", "closures", "motors")
INK, FAINT = "#22262b", "#5b6068"


class CardPlace(NamedTuple):
    """Position and size of a card; the origin is the upper left corner of the page, y points down.

    Attributes:
        x: Its left edge [inch].
        y: Its upper edge [inch].
        width: Its width [inch].
        height: Its height [inch].
    """

    x: float
    y: float
    width: float
    height: float


def layout(cards: Sequence[Card]) -> tuple[list[CardPlace], float, float]:
    """Compute the place of every card in columns; cards are indented where the tree branches.

    Returns:
        The places of the cards, and the width and height of the page [inch].
    """
    parents = [card.parent for card in cards]
    lanes: list[int] = []
    for parent in parents:
        lanes.append(0 if parent is None else lanes[parent] + (parents.count(parent) > 1))
    heights = [
        2 * PAD + TITLE + LINE * len(_lines(card)) + LEG * len(Counter(map(_signs, card.legs)))
        for card in cards
    ]
    whole = sum(heights) + GAP * len(cards)
    columns = min(MOST_COLUMNS, max(1, round(whole / TALLEST + 0.35)))
    across = WIDTH + max(lanes) * INDENT + GUTTER
    places: list[CardPlace] = []
    y, column = MARGIN, 0
    for height, lane in zip(heights, lanes, strict=True):
        if column + 1 < columns and y - MARGIN + height / 2 > whole / columns and places:
            y, column = MARGIN, column + 1
        places.append(CardPlace(MARGIN + column * across + lane * INDENT, y, WIDTH, height))
        y += height + GAP
    bottom = max(place.y + place.height for place in places)
    return places, 2 * MARGIN + (column + 1) * across - GUTTER, bottom + MARGIN + KEY


def figure_of_cards(cards: Sequence[Card]) -> Figure:
    """Draw cards as a matplotlib figure.

    Raises:
        HybridynError: matplotlib is missing.
    """
    places, width, height = layout(cards)
    figure = empty_figure(width, height)
    figure.set_layout_engine("none")
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set(xlim=(0, width), ylim=(height, 0))
    ax.set_axis_off()
    for card, place in zip(cards, places, strict=True):
        _card(ax, card, place, None if card.parent is None else places[card.parent])
    used = {letter for card in cards for leg in card.legs for letter, _ in leg}
    kinds = [f"{one} {kind}" for kind in JointKind if (one := kind.letter) in used and not kind.endless]
    ax.text(MARGIN, height - MARGIN, ", ".join(["dark: motor", *kinds]), fontsize=8, color=FAINT, va="center")
    return figure


def _card(ax: Axes, card: Card, place: CardPlace, below: CardPlace | None) -> None:
    """Draw a card, and an edge to the card below it, whose ends the cards cover."""
    from matplotlib.patches import FancyBboxPatch

    colour = module_colour(card.modules[0] if card.modules else -1)
    middle = PAD + TITLE / 2
    if below is not None:
        right = below.x + WIDTH
        start, bend = (below.x + 0.17,) * 2 if right > place.x else (right - 0.2, place.x - 0.3)
        across, down = [start, bend, bend, place.x + 0.2], [below.y, below.y, place.y, place.y]
        ax.plot(across, np.array(down) + middle, color=lighter(colour, 0.25), linewidth=2.2, zorder=1)
    style: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.09", "linewidth": 1.3, "zorder": 2}
    style |= {"edgecolor": colour, "facecolor": lighter(colour, 0.9)}
    ax.add_patch(FancyBboxPatch((place.x, place.y), WIDTH, place.height, **style))
    x, y = place.x + 0.16, place.y + PAD
    look: dict[str, Any] = {"va": "center", "zorder": 3}
    ax.text(x, place.y + middle, card.title[:38], fontsize=11, weight="bold", color=INK, **look)
    y += TITLE
    for line in _lines(card):
        ax.text(
            x, y + LINE / 2, textwrap.shorten(line, 60, placeholder=" ..."), fontsize=8.5, color=FAINT, **look
        )
        y += LINE
    for signs, count in Counter(map(_signs, card.legs)).items():
        _leg(ax, signs, count, x, y + LEG / 2, lighter(colour, 0.35))
        y += LEG


def _lines(card: Card) -> list[str]:
    """Return the lines of text below a card's title."""
    return [card.what, *(f"{label}: {text}" for label, text in card.facts if label in FACTS)]


def _signs(leg: Leg) -> tuple[str, ...]:
    """Return the letters of a leg's joints, "*" behind those of motors: equal legs have the same."""
    return tuple(letter + "*" * name.endswith("*") for letter, name in leg)


def _leg(ax: Axes, signs: Sequence[str], count: int, x: float, y: float, colour: str) -> None:
    """Draw equal legs as a line with its joints."""
    step = min(STEP, 3.4 / max(len(signs), 1))
    ax.text(x, y, f"{count} x", fontsize=9.5, color=INK, va="center", zorder=3)
    ax.plot([x + 0.35, x + 0.4 + step * len(signs)], [y, y], color=colour, linewidth=2, zorder=2.5)
    for number, sign in enumerate(signs):
        ink, paper = ("#ffffff", MOTOR) if sign.endswith("*") else (INK, "#ffffff")
        box = {"boxstyle": "circle,pad=0.25", "facecolor": paper, "edgecolor": MOTOR, "linewidth": 1.1}
        at = x + 0.55 + step * number
        ax.text(at, y, sign[:1], fontsize=7.5, color=ink, ha="center", va="center", zorder=4, bbox=box)
