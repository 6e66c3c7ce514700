"""The calls of a chain of modules in the programs that close rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ....structure.robot import HybridRobot
from ...equations.arguments import ModuleArguments
from ...equations.expressions import pack
from ...equations.factors import Handed
from ...program import Add, Constants, Each, Shared, Source, Target, Worst
from ..loop_kernels import Kernel
from ..writer import ModuleWriter, alike
from .chain_kernels import ChainKernels, Ports
from .chain_targets import ChainTargets
from .coupled import Coupled
from .measure import measure_kernel
from .module_parts import Part
from .rows import Places

#: Sources of each group's posture, and of what is prescribed there.
Near = list[list[Source]]
#: What chains give for comparisons that bounds leave open: none of them is passed.
NOT_TOLD = 1e30


@dataclass(eq=False)
class Group:
    """Modules of one shape in a chain.

    Attributes:
        key: What they have in common.
        members: Their numbers in the chain.
        parts: Their numbers among the parts of the program.
        kernels: Their kernels.
    """

    key: Any
    members: list[int]
    parts: list[int]
    kernels: ChainKernels


class ChainWriter:
    """Writes the calls of one chain."""

    def __init__(
        self,
        robot: HybridRobot,
        parts: Sequence[Part],
        coupled: Coupled,
        number: int,
        places: tuple[Places, Places],
        arguments: Sequence[ModuleArguments | None] = (),
    ) -> None:
        """Write the kernels.

        Args:
            number: Number of the chain; what it prescribes stands behind the parts' numbers.
            places: Frames of the robot's links, and the same as functions of the arguments.
            arguments: Arguments of each part, or None; nothing where no number is an argument.
        """
        self._coupled, self._number, self._targets = coupled, len(parts) + number, ChainTargets(coupled)
        self._couple, maps = self._targets.couple()
        own = [parts[k] for k in coupled.parts]

        def key(k: int) -> tuple[object, ...]:
            """Return what modules with the same kernels have in common."""
            mask = tuple(one.tobytes() for one in maps[k])
            return *own[k].shape, coupled.problem.parts[k].rank, self._targets.bodies[k], mask

        self.groups = []
        for shape, members in alike(range(len(own)), key).items():
            first = own[members[0]]
            alike_modules = [own[k].module for k in members]
            numbers = [arguments[coupled.parts[k]] for k in members] if arguments else []
            own_rows = coupled.problem.parts[members[0]].rank or 0
            kernels = ChainKernels(
                alike_modules, first.given, (), numbers, places, first.idle_freedoms, own_rows
            )
            ports = Ports(self._targets.bodies[members[0]], maps[members[0]])
            ease = [coupled.problem.ease[k] for k in members]
            kernels.join(ease, ports)
            at = [coupled.parts[k] for k in members]
            self.groups.append(Group(("chain", number, shape), members, at, kernels))

    @property
    def kept(self) -> dict[int, int]:
        """How many numbers tell how the rows turn, for each part."""
        return {k: group.kernels.kept for group in self.groups for k in group.parts}

    def write(self, w: Mapping[str, ModuleWriter]) -> None:
        """Add the calls to the programs."""
        self._newton(_Calls(w["newton"], self, "newton"))
        self._settle(_Calls(w["settle"], self, "settle"))
        _Calls(w["branch"], self, "branch").results(
            off=Constants(np.array([[NOT_TOLD]])), turned=Constants(np.array([[NOT_TOLD]]))
        )

    def measure(self, w: ModuleWriter) -> None:
        """Add the calls of the program "measure", see `given_step`."""
        c = _Calls(w, self, "measure")
        placed, _ = c.placed("q_0", "p_0", "joints")
        numbers = [w.result(name, w.places(name, [self._number])) for name in ("now", "next")]
        c.one(
            "measure",
            measure_kernel(self._targets),
            [*placed, c.given_of_chain("wanted")],
            [*numbers, Worst()],
        )

    def _newton(self, c: _Calls) -> None:
        m = self._targets.rows
        placed, near = c.placed("q_0", "p_0", "g")
        residual, T = c.coupled(placed, "g")
        S, e, open_by = c.sum(m * (m + 1) // 2), c.sum(m), c.sum(1)
        motions = []
        for group, here, own in zip(self.groups, near, T, strict=True):
            kernel, handed = c.once(("project", group.key), group.kernels.project)
            motion = c.each(group, handed.size)
            motions.append((handed, motion))
            kept = c.result("kept", group)
            c.call(
                group,
                "project",
                kernel,
                [*here, own],
                [S, e, open_by, kept, motion, Worst(), Worst(), Worst()],
            )
        multipliers = c.shared(m)
        c.one("meet", self._targets.meet(), [c.read(S), c.read(e), residual], [multipliers, Worst()])
        sizes = []
        for group, here, (handed, motion) in zip(self.groups, near, motions, strict=True):
            step, wrist = c.each(group, 1), c.each(group, 1)
            sizes.append((group, step, wrist))
            moved = [c.result("q", group), c.result("p", group)]
            c.call(
                group,
                "move",
                group.kernels.move(handed, m),
                [*here, motion, multipliers],
                [*moved, step, wrist],
            )
        steps, wrists = ([c.whole(group, x[i]) for group, *x in sizes] for i in (0, 1))
        c.results(step=c.largest(steps), wrist=c.largest(wrists), open=c.squares(c.read(open_by), residual))

    def _settle(self, c: _Calls) -> None:
        placed, near = c.placed("q_0", "p_0", "g")
        before, far = c.placed("q_1", "p_1", "g_0")
        (residual, T), (_, T_0) = c.coupled(placed, "g"), c.coupled(before, "g_0")
        asked = c.shared(self._targets.rows)
        sources = [*placed, c.given_of_chain("g"), c.given_of_chain("g_dot")]
        c.one("asked", self._targets.asked(), sources, [asked])
        step = self._last_step(c, (residual, asked), (near, T), (far, T_0))
        speeds, twists, steps = self._rates(c, near, step)
        self._accelerations(c, placed, near, T, step, speeds, twists)
        c.results(step=c.largest(steps), open=c.largest(step.opened), turning=c.largest(step.turned))

    def _last_step(
        self,
        c: _Calls,
        wanted: tuple[Shared, Shared],
        here: tuple[Near, list[Each]],
        there: tuple[Near, list[Each]],
    ) -> _ChainStep:
        """Add the calls of the last step and the rates: each module's, then the targets' small system.

        Args:
            c: The calls.
            wanted: Places of the targets' residual, and of their prescribed rates.
            here: Postures, and places of the targets' maps there.
            there: Those of the row before.
        """
        m = self._targets.rows
        n = m * (m + 1) // 2
        S, e, S_0, F = c.sum(n), c.sum(2 * m), c.sum(n), c.sum(n)
        handed, turned, opened = list[_Parts](), list[Shared](), list[Shared]()
        for group, near, own, far, own_0 in zip(self.groups, *here, *there, strict=True):
            kernel, motion, factors = group.kernels.settle()
            room = c.each(group, motion.size), c.each(group, factors.size)
            own_turn, own_open = c.each(group, 1), c.each(group, 1)
            turned.append(c.whole(group, own_turn))
            opened.append(c.whole(group, own_open))
            handed.append(_Parts(motion, factors, *room))
            sources = [*near, own, *far, own_0, c.given("kept", group), c.given("g_dot", group)]
            targets: list[Target] = [S, e, S_0, F, own_turn, own_open, *room, *[Worst()] * 3]
            c.call(group, "settle", kernel, sources, targets)
        function, known = self._targets.settle()
        multipliers, open_by, turn, factors_of = (c.shared(k) for k in (2 * m, 1, 1, known.size))
        sources = [c.read(S), c.read(e), *wanted, c.read(S_0), c.read(F)]
        c.one("meet", function, sources, [multipliers, open_by, turn, factors_of, Worst()])
        return _ChainStep(handed, multipliers, known, factors_of, [*opened, open_by], [*turned, turn])

    def _rates(self, c: _Calls, near: Near, step: _ChainStep) -> tuple[list[Each], list[Each], list[Shared]]:
        """Add the calls of each module's motion by the multipliers; return rates, twists and step sizes."""
        speeds, twists, steps = list[Each](), list[Each](), list[Shared]()
        for group, here, part in zip(self.groups, near, step.parts, strict=True):
            sizes = group.kernels.e.tree.nv, 6 * len(group.kernels.ports.bodies), 1
            speed, twist, size = (c.each(group, k) for k in sizes)
            speeds.append(speed)
            twists.append(twist)
            steps.append(c.whole(group, size))
            moved = [c.result("q", group), c.result("p", group)]
            sources = [*here, part.motion_at, step.multipliers]
            c.call(group, "rate", group.kernels.rate(part.motion), sources, [*moved, speed, twist, size])
        return speeds, twists, steps

    def _accelerations(
        self, c: _Calls, placed: Sequence[Shared], near: Near, T: Sequence[Each], step: _ChainStep,
        speeds: Sequence[Each], twists: Sequence[Each],
    ) -> None:  # fmt: skip
        """Add the calls of the accelerations of the rule, by the factors of the last step."""
        m = self._targets.rows
        of_rates = Shared(step.multipliers.start + m, m)
        asked = c.shared(m)
        changes = [c.each(group, 6 * len(group.kernels.ports.bodies)) for group in self.groups]
        given = [c.given_of_chain(name) for name in ("g", "g_dot", "g_ddot")]
        sources = [*placed, *given, *c.by_part(twists), of_rates]
        c.one("change", self._targets.change(), sources, [asked, *c.by_part(changes)])
        again, last = c.sum(m), []
        each = zip(self.groups, near, T, speeds, step.parts, changes, strict=True)
        for group, here, own, speed, part, change in each:
            kernel, motion = group.kernels.turn(part.factors)
            place = c.each(group, motion.size)
            last.append((motion, place))
            given = [*here, own, speed, part.factors_at, of_rates, change, c.given("g_ddot", group)]
            c.call(group, "turn", kernel, given, [again, place])
        multipliers = c.shared(m)
        sources = [step.factors_at, c.read(again), asked]
        c.one("meet_again", self._targets.meet_again(step.factors), sources, [multipliers])
        for group, here, speed, part, (motion, place) in zip(
            self.groups, near, speeds, step.parts, last, strict=True
        ):
            kernel = group.kernels.accelerate(motion, part.motion)
            results = [c.result("v", group), c.result("a", group), Worst()]
            c.call(group, "accelerate", kernel, [*here, part.motion_at, place, speed, multipliers], results)


class _Parts(NamedTuple):
    """What the last step of a group hands on: a motion and factors, and where they are."""

    motion: Handed
    factors: Handed
    motion_at: Each
    factors_at: Each


class _ChainStep(NamedTuple):
    """The last step and the rates of a chain.

    Attributes:
        parts: What each group hands on.
        multipliers: Place of the targets' multipliers, of the step and then of the rates.
        factors, factors_at: Factors of the small system, and where they are.
        opened, turned: Places of what is left open, and of how far rows turned.
    """

    parts: list[_Parts]
    multipliers: Shared
    factors: Handed
    factors_at: Shared
    opened: list[Shared]
    turned: list[Shared]


class _Calls:
    """Adds the calls of a chain to one program."""

    def __init__(self, w: ModuleWriter, chain: ChainWriter, name: str) -> None:
        self._w, self._chain, self._name = w, chain, name
        self._at = chain._coupled.parts

    def once(self, key: Any, make: Any) -> Any:
        return self._w.once(key, make)

    def each(self, group: Group, size: int) -> Each:
        return self._w.each(len(group.members), size)

    def shared(self, size: int) -> Shared:
        return self._w.shared(size)

    def whole(self, group: Group, place: Each) -> Shared:
        """Return the numbers of all modules of a group."""
        return Shared(place.start, place.size * len(group.members))

    def sum(self, size: int) -> Add:
        return self._w.start(self._w.shared(size), np.zeros(size))

    def read(self, place: Add) -> Shared:
        return Shared(place.start, place.size)

    def by_part(self, places: Sequence[Each]) -> list[Any]:
        """Return the places of each module's numbers, in the order of the chain."""
        out = {}
        for group, place in zip(self._chain.groups, places, strict=True):
            for i, k in enumerate(group.members):
                out[k] = Shared(place.start + i * place.size, place.size)
        return [out[k] for k in range(len(out))]

    def given(self, name: str, group: Group) -> Source:
        return self._w.from_given(name, self._w.places(name, group.parts))

    def given_of_chain(self, name: str) -> Source:
        return self._w.from_given(name, self._w.places(name, [self._chain._number]))

    def result(self, name: str, group: Group) -> Target:
        return self._w.result(name, self._w.places(name, group.parts))

    def call(
        self, group: Group, name: str, kernel: Kernel, sources: Sequence[Source], targets: Sequence[Target]
    ) -> None:
        """Add the call of a kernel of modules."""
        function, table = kernel
        number = self._w.kernel((name, group.key), function, "closures")
        numbers = self._w.numbers(table, self._w.parameters)
        self._w.call(number, len(group.members), [*sources, numbers], list(targets))

    def one(
        self, name: str, function: ca.Function, sources: Sequence[Source], targets: Sequence[Target]
    ) -> None:
        """Add the call of a kernel of the targets."""
        number = self._w.kernel((name, self._chain._number), function, "closures")
        self._w.call(number, 1, list(sources), list(targets))

    def placed(self, *names: str) -> tuple[list[Shared], list[list[Source]]]:
        """Add the calls that place the ports at postures, each module's; return the sources of these, too."""
        places, sources = [], []
        for group in self._chain.groups:
            here = [self.given(name, group) for name in names]
            place = self.each(group, 12 * len(group.kernels.ports.bodies))
            self.call(group, "place", group.kernels.place(), here, [place])
            places.append(place)
            sources.append(here)
        return self.by_part(places), sources

    def coupled(self, placed: Sequence[Shared], given: str) -> tuple[Shared, list[Each]]:
        """Add the call that computes residuals and maps."""
        residual = self.shared(self._chain._targets.rows)
        maps = [self.each(group, group.kernels.ports.size) for group in self._chain.groups]
        targets: list[Target] = [residual, *self.by_part(maps), Worst()]
        self.one("couple", self._chain._couple, [*placed, self.given_of_chain(given)], targets)
        return residual, maps

    def largest(self, places: Sequence[Shared]) -> Shared:
        """Return the largest of some numbers."""
        columns = [ca.SX.sym("x", place.size) for place in places]
        entries = [x for column in columns for x in ca.vertsplit(column)]
        function = ca.Function("largest", columns, [reduce(ca.fmax, entries)])
        out = self.shared(1)
        number = self._w.kernel(("largest", *(place.size for place in places)), function, "closures")
        self._w.call(number, 1, list(places), [out])
        return out

    def squares(self, sum_yet: Shared, residual: Shared) -> Shared:
        """Return a sum of squares with those of a residual."""
        x, r = ca.SX.sym("x"), ca.SX.sym("r", residual.size)
        out = self.shared(1)
        function = ca.Function("squares", [x, r], [x + ca.sumsqr(r)])
        self._w.call(
            self._w.kernel(("squares", residual.size), function, "closures"), 1, [sum_yet, residual], [out]
        )
        return out

    def results(self, **values: Source) -> None:
        """Give numbers of the whole chain to each of its modules."""
        x, count = ca.SX.sym("x"), len(self._at)
        function = ca.Function("all", [x], [pack([x] * count)])
        number = self._w.kernel(("all", count), function, "closures")
        for name, value in values.items():
            self._w.call(
                number, 1, [value], [self._w.result(name, self._w.places(name, self._at).reshape(1, -1))]
            )
