"""The tree of modules as text."""

from __future__ import annotations

import sys
import textwrap
from collections import Counter
from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING

from .text import NARROWEST, counted

if TYPE_CHECKING:
    from ...structure.module import Module
    from ...structure.robot import HybridRobot

#: Width of a label such as "closures  " [characters].
LABEL = 10
#: A space at which lines are not broken.
NO_BREAK = "\u00a0"
#: Relative singular values above this that do not count in the rank show missing digits in the file.
MISSING_DIGITS = 1e-12
REMARKS = {
    "passive": " has no motor",
    "idle": " has no motor and moves no output and no centre of mass",
    "massless": " has no inertia",
}


def head(robot: HybridRobot) -> Iterator[str]:
    """Yield the lines above the tree: name, base, freedoms, joints and motors."""
    description = robot.description
    yield f"{robot.name} ({description.source})"
    free = counted(robot.mobility, "freedom")
    base = {"fixed": "fixed", "moving": "moving (prescribed)", "floating": "floating"}[robot.base]
    yield f"base '{description.root}' {base}; {counted(len(robot.modules), 'module')}; {free}"
    joints = sum(joint.kind != "fixed" for joint in description.joints)
    motors = counted(len(robot.motors), "motor")
    yield f"{counted(joints, 'movable joint')} (nq {robot.nq}, nv {robot.nv}), {motors}"
    rule = f" (from {description.motors_from})" if description.motors_from else ""
    yield f"motors{rule}: {', '.join(robot.motors) or 'none'}"


class Tree:
    """The tree of modules as lines of text."""

    def __init__(self, robot: HybridRobot, home: list[float], singular: Collection[str], width: int) -> None:
        """Start at the root link.

        Args:
            home: Closure residual of each module at home.
            singular: Names of the modules that are singular at home.
            width: Width of a line [characters].
        """
        self.singular = singular
        self.robot, self.home, self.width = robot, home, width
        self.kinds = {name: joint.kind for name, joint in robot.records.items()}
        self.children = robot.children
        self.first: dict[int, str] = {}  # the first module of each kind, by its mechanism
        self.number = {module.name: number for number, module in enumerate(robot.modules)}
        fancy = "utf" in (sys.stdout.encoding or "").lower()
        self.branch, self.last, self.bar = ("├─ ", "└─ ", "│  ") if fancy else ("|- ", "`- ", "|  ")

    def lines(self) -> Iterator[str]:
        """Yield every line, from the root link outwards."""
        yield "world" if self.robot.base == "floating" else self.robot.description.root
        # A stack instead of recursion: chains of modules may exceed Python's recursion limit.
        stack = [(number, "") for number in reversed(self.children.get(-1, []))]
        while stack:
            number, indent = stack.pop()
            module = self.robot.modules[number]
            chain = self._equal_chain(number)
            below = self.children.get(chain[-1], [])
            is_last = number == self.children[module.parent][-1]
            title = self._title(module) if len(chain) == 1 else self._folded(chain)
            inner = indent + ("   " if is_last else self.bar)
            first, *rest = self._wrapped("", "", title)
            yield f"{indent}{self.last if is_last else self.branch}{first}"
            yield from (f"{inner}{line}" for line in rest)
            if len(chain) == 1:
                for label, text in self._facts(module, self.home[number]):
                    yield from self._wrapped(inner + (self.bar if below else "   "), label, text)
            stack += [(child, inner) for child in reversed(below)]

    def _equal_chain(self, number: int) -> list[int]:
        """Return a module and the chain of modules on it that are equal to one already shown."""
        modules = self.robot.modules
        chain = [number]
        if not modules[number].closures or id(modules[number].mechanism) not in self.first:
            return chain
        while len(below := self.children.get(chain[-1], [])) == 1:
            if modules[below[0]].mechanism is not modules[number].mechanism:
                break
            chain += below
        return chain

    def _folded(self, chain: list[int]) -> str:
        first, last = self.robot.modules[chain[0]], self.robot.modules[chain[-1]]
        like = self.first[id(first.mechanism)]
        names = f"{first.label} ... {last.label}"
        worst = max(self.home[number] for number in chain)
        closed = "" if worst <= self.robot.closure_tolerance else ", some OPEN at home"
        motors = sum(len(self.robot.modules[number].motors) for number in chain)
        return (
            f"{names}  modules {chain[0] + 1}-{chain[-1] + 1}, one on the other, like module "
            f"{self.number[like] + 1} ({like}); {counted(motors, 'motor')} in all{closed}"
        )

    def _wrapped(self, indent: str, label: str, text: str) -> list[str]:
        room = max(self.width - len(indent), NARROWEST)
        lines = textwrap.wrap(
            text,
            room + len(indent),
            initial_indent=indent + (label.ljust(LABEL) if indent else ""),
            subsequent_indent=indent + " " * LABEL,
            break_long_words=False,
            break_on_hyphens=False,
        )
        return [line.replace(NO_BREAK, " ") for line in lines]

    def _title(self, module: Module) -> str:
        name = module.label
        if len(module.joints) == 1 and module.joints[0] in self.kinds:
            joint = module.joints[0]
            role = "" if module.motors else ", passive"
            return f"{name}  {self.kinds[joint]} joint {self._joint(joint)}{role}"
        if not module.closures and module.joints == ("root_joint",):
            return f"{name}  free base, 6 freedoms"
        motors = counted(len(module.motors), "motor")
        number = self.number[module.name] + 1
        return f"{name}  module {number}, {counted(module.mobility, 'freedom')}, {motors}"

    def _facts(self, module: Module, open_by: float) -> Iterator[tuple[str, str]]:
        if len(module.joints) == 1 and not module.closures:
            return
        like = self.first.setdefault(id(module.mechanism), module.name)
        yield "base", module.base
        if len(module.outputs) > 1:
            yield "outputs", ", ".join(module.outputs)
        if like != module.name:
            number = self.number[like] + 1
            yield "like", f"module {number} ({like}); motors {', '.join(module.motors) or 'none'}"
            return
        for number, (name, joints) in enumerate(module.legs):
            chain = ", ".join(f"{self._letter(joint)}{NO_BREAK}{self._joint(joint)}" for joint in joints)
            yield "" if number else "legs", f"{name}: {chain or 'no joints of its own'}"
        yield from self._closure_facts(module, open_by)
        spare = len(module.motors) - module.mobility
        if spare > 0:
            yield "motors", f"{counted(spare, 'motor')} more than freedoms: efforts are shared"
        elif spare < 0:
            yield "motors", f"{-spare} fewer than freedoms: some motion is passive"
        from ...assembly.free_motions import free_motions

        free = free_motions(module)
        for label, names in (
            ("passive", free.uncontrolled),
            ("idle", free.idle),
            ("massless", free.massless),
        ):
            if names:
                yield label, f"the motion of {', '.join(dict.fromkeys(names))}{REMARKS[label]}"

    def _closure_facts(self, module: Module, open_by: float) -> Iterator[tuple[str, str]]:
        if not module.closures:
            return
        mechanism = module.mechanism
        kinds = Counter(self.robot.closure_kinds.get(name, "closure") for name in module.closures)
        parts = [f"{count} {kind}" for kind, count in kinds.items()]
        if mechanism.spec.wrists:
            parts.append(f"{counted(len(mechanism.spec.wrists), 'wrist')} cut")
        report = mechanism.reduction.report
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
        closed = open_by <= self.robot.closure_tolerance
        how = f"{'closed' if closed else 'OPEN'} to {open_by:.1e} of the module's size"
        yield "at home", f"{how}; SINGULAR" if module.name in self.singular else how

    def _joint(self, name: str) -> str:
        return f"{name}*" if name in self.robot.motors else name

    def _letter(self, name: str) -> str:
        from ...linkage.joints import LETTERS

        return LETTERS.get(self.kinds.get(name, "floating"), "")  # only a moving base has no kind of its own
