"""Cards of the tree of modules: the contents of a structure drawing as plain data.

Consecutive joints in series share one card, and so do consecutive equal modules.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

from ..colours import GROUND, module_colour
from ..description.names import counted
from ..linkage.joints import LETTERS
from ..structure.module import Module
from ..structure.robot import HybridRobot

#: Largest number of kinds of legs on a card.
MOST_LEGS = 6
#: From this number of consecutive equal modules on, all but the first share one card.
FOLD = 3


class Sign(NamedTuple):
    """One joint of a chain.

    Attributes:
        letter: Its kind, one of `LETTERS`.
        driven: Whether it is a motor.
    """

    letter: str
    driven: bool


class Leg(NamedTuple):
    """A group of equal legs.

    Attributes:
        number: Number of legs.
        joints: The joints of each leg, starting at its base.
    """

    number: int
    joints: tuple[Sign, ...]


@dataclass(frozen=True)
class Card:
    """One card of the drawing.

    Attributes:
        title: Name of the module, or names of the first and the last of several.
        lines: Lines of text below the title.
        legs: Its legs; joints in series form one leg.
        colour: Its module's colour, "#rrggbb".
        modules: Numbers of the modules on the card; empty for the ground.
        parent: Number of the parent card, None for the ground.
        folded: Whether the modules are equal to that of the parent card.
    """

    title: str
    lines: tuple[str, ...]
    legs: tuple[Leg, ...]
    colour: str
    modules: tuple[int, ...]
    parent: int | None
    folded: bool = False


def cards(robot: HybridRobot) -> list[Card]:
    """Build the cards of a robot in depth-first order, each after its parent."""
    return _Deck(robot).cards


class _Deck:
    """Builds the cards in depth-first order."""

    def __init__(self, robot: HybridRobot) -> None:
        self.robot = robot
        self.kinds = {name: joint.kind for name, joint in robot.records.items()}
        self.children = robot.children
        self.cards = [self._ground()]
        # A stack instead of recursion: chains of modules may exceed Python's recursion limit.
        stack = [(number, 0) for number in reversed(self.children.get(-1, []))]
        while stack:
            number, parent = stack.pop()
            last = self._lay(number, parent)
            below = self.children.get(last, [])
            stack += [(child, len(self.cards) - 1) for child in reversed(below)]

    def _ground(self) -> Card:
        robot = self.robot
        base = {"fixed": "fixed", "moving": "moving as prescribed", "floating": "floating freely"}[robot.base]
        parts = ((len(robot.modules), "module"), (robot.mobility, "freedom"), (len(robot.motors), "motor"))
        text = ", ".join(counted(*part) for part in parts)
        return Card(robot.description.root, (f"base, {base}", f"{robot.name}: {text}"), (), GROUND, (), None)

    def _lay(self, number: int, parent: int) -> int:
        """Append the card of a module or of several that share one; return the last module's number."""
        chain = self._chain(number)
        modules = self.robot.modules
        if self._is_serial(modules[number]):
            self.cards.append(self._serial(chain, parent))
        elif len(chain) >= FOLD:
            self.cards.append(self._parallel(number, parent))
            self.cards.append(self._folded(chain[1:], number, len(self.cards) - 1))
        else:
            chain = chain[:1]
            self.cards.append(self._parallel(number, parent))
        return chain[-1]

    def _chain(self, number: int) -> list[int]:
        """Return a module and the modules that continue it: joints in series, or equal modules."""
        modules, chain = self.robot.modules, [number]
        serial = self._is_serial(modules[number])
        while len(below := self.children.get(chain[-1], [])) == 1:
            above = modules[below[0]]
            same = self._is_serial(above) if serial else above.mechanism is modules[number].mechanism
            if not same:
                break
            chain += below
        return chain

    def _is_serial(self, module: Module) -> bool:
        return not module.closures and len(module.joints) == 1

    def _serial(self, chain: list[int], parent: int) -> Card:
        modules = [self.robot.modules[number] for number in chain]
        signs = tuple(self._sign(module.joints[0]) for module in modules)
        first, last = modules[0].label, modules[-1].label
        motors = sum(len(module.motors) for module in modules)
        if len(modules) == 1:
            kind = self.kinds.get(modules[0].joints[0], "free base")
            line = f"{kind} joint {modules[0].joints[0]}" if kind != "free base" else "free base, 6 freedoms"
        else:
            line = f"{len(modules)} joints in series, {counted(motors, 'motor')}"
        title = first if len(modules) == 1 else f"{first} ... {last}"
        return Card(title, (line,), (Leg(1, signs),), module_colour(chain[0]), tuple(chain), parent)

    def _parallel(self, number: int, parent: int) -> Card:
        module = self.robot.modules[number]
        freedoms, motors = counted(module.mobility, "freedom"), counted(len(module.motors), "motor")
        lines = [f"module {number + 1}: {freedoms}, {motors}"]
        spare = len(module.motors) - module.mobility
        if spare:
            lines.append(f"{spare} more motors than freedoms" if spare > 0 else f"{-spare} freedoms passive")
        found = Counter(self.robot.closure_kinds.get(name, "closure") for name in module.closures)
        closed = [f"{count} {kind}" for kind, count in found.items()]
        if wrists := len(module.mechanism.spec.wrists):
            closed.append(counted(wrists, "wrist") + " cut")
        if closed:
            lines.append(f"loops closed by {', '.join(closed)}")
        alike = Counter(tuple(self._sign(joint) for joint in joints) for _, joints in module.legs)
        legs = [Leg(count, signs) for signs, count in alike.items()]
        if len(legs) > MOST_LEGS:
            rest = sum(leg.number for leg in legs[MOST_LEGS:])
            lines.append(f"and {counted(rest, 'more leg')} of other kinds")
        colour = module_colour(number)
        return Card(module.label, tuple(lines), tuple(legs[:MOST_LEGS]), colour, (number,), parent)

    def _folded(self, chain: list[int], like: int, parent: int) -> Card:
        modules = self.robot.modules
        motors = sum(len(modules[number].motors) for number in chain)
        title = f"{modules[chain[0]].label} ... {modules[chain[-1]].label}"
        lines = (
            f"modules {chain[0] + 1} to {chain[-1] + 1}: {len(chain)} like {modules[like].label}",
            f"one on the other, {counted(motors, 'motor')} in all",
        )
        return Card(title, lines, (), module_colour(like), tuple(chain), parent, folded=True)

    def _sign(self, joint: str) -> Sign:
        return Sign(LETTERS.get(self.kinds.get(joint, "floating"), "F"), joint in self.robot.motors)


def dot_of_cards(drawn: list[Card]) -> str:
    """Return the cards as a graph in the DOT language of Graphviz."""

    def quoted(text: str) -> str:
        """Return a text in quotes of DOT."""
        return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'

    lines = ["digraph robot {", "  rankdir=BT; node [shape=box, style=rounded, fontname=sans];"]
    for number, card in enumerate(drawn):
        legs = [f"{leg.number} x {leg_text(leg)}" for leg in card.legs]
        text = quoted("\n".join([card.title, *card.lines, *legs]))
        lines.append(f"  {number} [label={text}, color={quoted(card.colour)}];")
        if card.parent is not None:
            lines.append(f"  {card.parent} -> {number};")
    return "\n".join([*lines, "}", ""])


def leg_text(leg: Leg) -> str:
    """Return a leg's joints as letters, motors with a star: "R R P*"."""
    return " ".join(f"{sign.letter}{'*' if sign.driven else ''}" for sign in leg.joints) or "no joints"
