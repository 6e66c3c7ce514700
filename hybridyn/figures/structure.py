"""The drawing of a robot's structure: cards from the ground up the page's columns, drawn by matplotlib."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..colours import MOTOR, towards
from .blank import empty_figure
from .structure_cards import Card, Leg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# All lengths in inches.
WIDTH, INDENT, GUTTER, GAP = 4.2, 0.35, 0.55, 0.28
TITLE, LINE, LEG, PAD = 0.30, 0.21, 0.30, 0.12
#: Of a column, as long as there are few.
TALLEST = 9.0
MOST_COLUMNS = 4
MARGIN, KEY = 0.3, 0.45
#: From card to card of a pile.
PILE = 0.07
STEP, SIGN = 0.33, 0.10  # from joint to joint, half a joint's size
#: Of one row; a longer chain is told by its ends.
MOST_SIGNS = 10
INK, FAINT = "#22262b", "#5b6068"


@dataclass(frozen=True)
class Place:
    """Where a card is, from the upper left corner of the page, downwards.

    Attributes:
        x: Its left edge [inch].
        y: Its upper edge [inch].
        width: Its width [inch].
        height: Its height [inch].
        column: Number of its column.
    """

    x: float
    y: float
    width: float
    height: float
    column: int

    @property
    def middle(self) -> float:
        """Height of its title's middle [inch]."""
        return self.y + PAD + TITLE / 2


def layout(cards: list[Card]) -> tuple[list[Place], float, float]:
    """Give every card a place in as many columns as it takes.

    Args:
        cards: The cards.

    Returns:
        Their places, and width and height of the page [inch].
    """
    heights = [_height(card) for card in cards]
    lanes = _lanes(cards)
    whole = sum(heights) + GAP * len(cards)
    columns = min(MOST_COLUMNS, max(1, round(whole / TALLEST + 0.35)))
    goal = whole / columns
    indent = max(lanes, default=0) * INDENT
    places: list[Place] = []
    y, column = MARGIN, 0
    for card, height, lane in zip(cards, heights, lanes, strict=True):
        if column + 1 < columns and y - MARGIN + height / 2 > goal and places:
            y, column = MARGIN, column + 1
        x = MARGIN + column * (WIDTH + indent + GUTTER) + lane * INDENT
        places.append(Place(x, y, WIDTH, height, column))
        y += height + GAP + (2 * PILE if card.folded else 0.0)
    width = 2 * MARGIN + (column + 1) * (WIDTH + indent + GUTTER) - GUTTER
    bottom = max(place.y + place.height for place in places)
    return places, width, bottom + MARGIN + KEY


def figure_of_cards(cards: list[Card]) -> Figure:
    """Draw the cards.

    Args:
        cards: The cards.

    Raises:
        HybridynError: matplotlib is missing.
    """
    places, width, height = layout(cards)
    figure = empty_figure(width, height)
    figure.set_layout_engine("none")
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_xlim(0, width)
    ax.set_ylim(height, 0)
    ax.set_axis_off()
    for card, place in zip(cards, places, strict=True):
        if card.parent is not None:
            _edge(ax, places[card.parent], place, towards(card.colour, "#ffffff", 0.25))
    for card, place in zip(cards, places, strict=True):
        _card(ax, card, place)
    _key(ax, cards, height)
    return figure


def _height(card: Card) -> float:
    return 2 * PAD + TITLE + LINE * len(card.lines) + LEG * len(card.legs)


def _lanes(cards: list[Card]) -> list[int]:
    """Return how far each card is set in: one more wherever the tree branches."""
    below = [0] * len(cards)
    for card in cards:
        if card.parent is not None:
            below[card.parent] += 1
    lanes: list[int] = []
    for card in cards:
        if card.parent is None:
            lanes.append(0)
        else:
            lanes.append(lanes[card.parent] + (1 if below[card.parent] > 1 else 0))
    return lanes


def _edge(ax: Axes, parent: Place, child: Place, colour: str) -> None:
    """Draw the way from a card to one that stands on it."""
    if parent.column == child.column and child.x == parent.x:
        x, y = [parent.x + 0.3] * 2, [parent.y + parent.height, child.y]
    elif parent.column == child.column:
        spine = parent.x + 0.17
        x, y = [spine, spine, child.x], [parent.y + parent.height, child.middle, child.middle]
    else:
        spine = child.x - 0.3
        right = parent.x + parent.width
        x, y = [right, spine, spine, child.x], [parent.middle, parent.middle, child.middle, child.middle]
    ax.plot(x, y, color=colour, linewidth=2.2, solid_capstyle="round", zorder=1)


def _card(ax: Axes, card: Card, place: Place) -> None:
    from matplotlib.patches import FancyBboxPatch

    style: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.09", "linewidth": 1.3}
    style |= {"edgecolor": card.colour, "facecolor": towards(card.colour, "#ffffff", 0.9)}
    for shift in (2 * PILE, PILE) if card.folded else ():
        corner = (place.x + shift, place.y + shift)
        ax.add_patch(FancyBboxPatch(corner, place.width, place.height, **style))
    ax.add_patch(FancyBboxPatch((place.x, place.y), place.width, place.height, zorder=2, **style))
    x, y = place.x + 0.16, place.y + PAD
    title = _fitting(card.title, 38)
    ax.text(x, y + TITLE / 2, title, fontsize=11, weight="bold", color=INK, va="center", zorder=3)
    y += TITLE
    for line in card.lines:
        ax.text(x, y + LINE / 2, _fitting(line, 60), fontsize=8.5, color=FAINT, va="center", zorder=3)
        y += LINE
    for leg in card.legs:
        _leg(ax, leg, x, y + LEG / 2, card.colour)
        y += LEG


def _leg(ax: Axes, leg: Leg, x: float, y: float, colour: str) -> None:
    """Draw a leg as its joints on a line."""
    if leg.number > 1:
        ax.text(x, y, f"{leg.number} x", fontsize=9.5, color=INK, va="center", zorder=3)
    shown = leg.joints
    left = 0
    if len(shown) > MOST_SIGNS:
        left, shown = len(shown) - MOST_SIGNS, shown[:MOST_SIGNS]
    start = x + 0.55
    end = start + STEP * max(len(shown) - 1, 0)
    ax.plot([start - 0.2, end + 0.2], [y, y], color=towards(colour, "#ffffff", 0.35), linewidth=2, zorder=2.5)
    for number, sign in enumerate(shown):
        _sign(ax, start + STEP * number, y, sign.letter, driven=sign.driven)
    if left:
        ax.text(end + 0.28, y, f"and {left} more", fontsize=8.5, color=FAINT, va="center", zorder=3)


def _sign(ax: Axes, x: float, y: float, letter: str, *, driven: bool) -> None:
    from matplotlib.patches import Circle, Rectangle

    look: dict[str, Any] = {
        "facecolor": MOTOR if driven else "#ffffff",
        "edgecolor": MOTOR,
        "linewidth": 1.1,
        "zorder": 3,
    }
    if letter == "P":
        ax.add_patch(Rectangle((x - SIGN, y - SIGN), 2 * SIGN, 2 * SIGN, **look))
    else:
        ax.add_patch(Circle((x, y), SIGN * 1.1, **look))
    colour = "#ffffff" if driven else INK
    ax.text(x, y + 0.004, letter, fontsize=7.5, color=colour, ha="center", va="center", zorder=4)


def _key(ax: Axes, cards: list[Card], height: float) -> None:
    """Say what the signs mean."""
    y = height - MARGIN
    driven = any(sign.driven for card in cards for leg in card.legs for sign in leg.joints)
    x = MARGIN + 0.12
    if driven:
        _sign(ax, x, y, "", driven=True)
        ax.text(x + 0.2, y, "motor", fontsize=8, color=FAINT, va="center")
        x += 0.8
    names = {"R": "revolute", "P": "prismatic", "S": "spherical", "E": "planar", "F": "floating"}
    used = {sign.letter for card in cards for leg in card.legs for sign in leg.joints}
    text = ", ".join(f"{letter} {name}" for letter, name in names.items() if letter in used)
    ax.text(x, y, text, fontsize=8, color=FAINT, va="center")


def _fitting(text: str, letters: int) -> str:
    """Return a text, with its middle left out where it is too long."""
    if len(text) <= letters:
        return text
    half = (letters - 3) // 2
    return f"{text[:half]}...{text[-half:]}"
