"""The tree of modules as plain data: a card for each module, which `hybridyn info` prints and draws.

A chain of modules that are equal to one already shown shares one card.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from ..assembly.free_motions import free_motions
from ..description.names import counted
from ..joints.kinds import JointKind
from ..structure.module import Module
from ..structure.robot import HybridRobot

#: Relative singular values above this that do not count in the rank show missing digits in the file.
MISSING_DIGITS = 1e-12
#: A space at which lines are not broken.
NO_BREAK = "\u00a0"
REMARKS = {
    "passive": " has no motor",
    "idle": " has no motor and moves no output and no centre of mass",
    "massless": " has no inertia",
}

#: The joints of a leg from its base: letter of the kind, and name with "*" behind a motor's.
Leg = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Card:
    """A module, or several equal ones on each other.

    Attributes:
        modules: Their numbers; empty for the ground.
        parent: Number of the card below, None for the ground.
        title: Name of the module, or of the first and the last.
        what: What it is.
        facts: Label and text of what is known of it; legs have one each.
        legs: The joints of each leg.
    """

    modules: Sequence[int]
    parent: int | None
    title: str
    what: str
    facts: Sequence[tuple[str, str]] = ()
    legs: Sequence[Leg] = ()


def cards(robot: HybridRobot, home: Sequence[float], singular: Collection[str]) -> list[Card]:
    """Build the cards of a robot in depth-first order, each after its parent.

    Args:
        home: Closure residual of each module at home.
        singular: Names of the modules that are singular at home.
    """
    return _Walk(robot, home, singular).cards


class _Walk:
    """A walk through the modules, outwards."""

    def __init__(self, robot: HybridRobot, home: Sequence[float], singular: Collection[str]) -> None:
        self.robot, self.home, self.singular = robot, home, singular
        self.kinds = {name: joint.kind for name, joint in robot.records.items()}
        self.first: dict[int, int] = {}  # number of the first module of each kind, by its mechanism
        parts = ((len(robot.modules), "module"), (robot.mobility, "freedom"), (len(robot.motors), "motor"))
        whole = f"{robot.name}: {', '.join(counted(*part) for part in parts)}"
        ground = "world" if robot.base == "floating" else robot.description.root
        self.cards = [Card((), None, ground, whole)]
        # A stack instead of recursion: chains of modules may exceed Python's recursion limit.
        stack = [(number, 0) for number in reversed(robot.children.get(-1, []))]
        while stack:
            number, parent = stack.pop()
            chain = self._equal_chain(number)
            self.cards.append(self._card(number, parent) if len(chain) == 1 else self._folded(chain, parent))
            below = robot.children.get(chain[-1], [])
            stack += [(child, len(self.cards) - 1) for child in reversed(below)]

    def _equal_chain(self, number: int) -> list[int]:
        """Return a module and the chain of modules on it that are equal to one already shown."""
        modules, chain = self.robot.modules, [number]
        if not modules[number].closures or id(modules[number].mechanism) not in self.first:
            return chain
        while len(below := self.robot.children.get(chain[-1], [])) == 1:
            if modules[below[0]].mechanism is not modules[number].mechanism:
                break
            chain += below
        return chain

    def _folded(self, chain: list[int], parent: int) -> Card:
        """Return the card of equal modules."""
        modules = [self.robot.modules[number] for number in chain]
        like = self._like(modules[0])
        open_ = max(self.home[number] for number in chain) > self.robot.closure_tolerance
        motors = counted(sum(len(module.motors) for module in modules), "motor")
        what = (
            f"modules {chain[0] + 1}-{chain[-1] + 1}, one on the other, like {like}; {motors} in all"
            f"{', some OPEN at home' if open_ else ''}"
        )
        return Card(chain, parent, f"{modules[0].label} ... {modules[-1].label}", what)

    def _like(self, module: Module) -> str:
        """Name the module already shown that a module is equal to."""
        number = self.first[id(module.mechanism)]
        return f"module {number + 1} ({self.robot.modules[number].name})"

    def _card(self, number: int, parent: int) -> Card:
        """Return the card of a module."""
        module = self.robot.modules[number]
        motors = counted(len(module.motors), "motor")
        what = f"module {number + 1}, {counted(module.mobility, 'freedom')}, {motors}"
        legs = [tuple(map(self._joint, joints)) for _, joints in module.legs]
        if len(module.joints) == 1 and not module.closures:
            joint, kind = self._joint(module.joints[0]), self.kinds.get(module.joints[0])
            what = f"{kind} joint {joint[1]}{'' if module.motors else ', passive'}"
            what = what if kind else "free base, 6 freedoms"
            return Card([number], parent, module.label, what, (), [(joint,)])
        return Card([number], parent, module.label, what, [*self._facts(module, number)], legs)

    def _facts(self, module: Module, number: int) -> Iterator[tuple[str, str]]:
        """Yield label and text of what is known of a module."""
        yield "base", module.base
        if len(module.outputs) > 1:
            yield "outputs", ", ".join(module.outputs)
        if self.first.setdefault(id(module.mechanism), number) != number:
            yield "like", f"{self._like(module)}; motors {', '.join(module.motors) or 'none'}"
            return
        for at, (name, joints) in enumerate(module.legs):
            chain = ", ".join(f"{letter}{NO_BREAK}{joint}" for letter, joint in map(self._joint, joints))
            yield "" if at else "legs", f"{name}: {chain or 'no joints of its own'}"
        if module.closures:
            yield from self._closure_facts(module, self.home[number])
        spare = len(module.motors) - module.mobility
        if spare > 0:
            yield "motors", f"{counted(spare, 'motor')} more than freedoms: efforts are shared"
        elif spare < 0:
            yield "motors", f"{-spare} fewer than freedoms: some motion is passive"
        free = free_motions(module)
        for label, names in zip(REMARKS, (free.uncontrolled, free.idle, free.massless), strict=True):
            if names:
                yield label, f"the motion of {', '.join(dict.fromkeys(names))}{REMARKS[label]}"

    def _closure_facts(self, module: Module, open_by: float) -> Iterator[tuple[str, str]]:
        """Yield label and text of what is known of a module's closures."""
        mechanism, report = module.mechanism, module.mechanism.reduction.report
        kinds = Counter(self.robot.closure_kinds.get(name, "closure") for name in module.closures)
        parts = [f"{count} {kind}" for kind, count in kinds.items()]
        if mechanism.spec.wrists:
            parts.append(f"{counted(len(mechanism.spec.wrists), 'wrist')} cut")
        spare = report.rows - report.rank
        yield "closures", f"{', '.join(parts)}: {counted(report.rows, 'row')}, {spare or 'none'} redundant"
        if report.dropped > MISSING_DIGITS:
            yield (
                "rank",
                f"{report.rank}; relative singular values count from {report.kept:.1e} up, and not up to "
                f"{report.dropped:.1e}: the file is rounded",
            )
        elif mechanism.rank_decision:
            yield "rank", f"{report.rank}; {mechanism.rank_decision}"
        closed = "closed" if open_by <= self.robot.closure_tolerance else "OPEN"
        singular = "; SINGULAR" if module.name in self.singular else ""
        yield "at home", f"{closed} to {open_by:.1e} of the module's size{singular}"

    def _joint(self, name: str) -> tuple[str, str]:
        """Return letter and name of a joint; only a moving base has no kind of its own."""
        letter = self.kinds.get(name, JointKind.FLOATING).letter
        return letter, f"{name}*" if name in self.robot.motors else name
