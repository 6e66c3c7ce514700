"""Wrenches on links in the sweeps of the models of forces: those that the caller gives, and the ground's."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from ...effects.bodies import GravityCompensation, LineSprings
from ...effects.bushings import Bushings
from ...effects.link_effect import LinkEffect
from ...effects.links import GroundContact
from ...spatial import cross, numpy_on_symbols, wrench_to_base
from ...structure.robot import HybridRobot
from ...symbols import Expression, dot
from ..equations.acting import Acting, along_path
from ..equations.arguments import ChosenNumbers
from ..equations.coefficients import with_arguments_in
from ..equations.expressions import numbers, pack, symbols, unpack, zeros
from ..equations.request import Request
from ..program import Shared, Source
from .general import WIDTH, motion_of
from .kinematics import write_motions
from .on_symbols import Watched, Written, bodies_of, moving, written_wrench
from .writer import Writer


class ActingWrenches:
    """Wrenches on links, which begin a program.

    Attributes:
        required: What each adds to what an output requires: numbers of the module and of its output, and the
            place of minus the wrench.
        along: Places of efforts along freedoms of modules' trees after the cuts, by module and freedom.
    """

    def __init__(self, request: Request, w: Writer) -> None:
        """Add the calls that compute them."""
        self._request, self._w = request, w
        self.required: list[tuple[int, int, Shared]] = []
        self.along: dict[tuple[int, int], list[Shared]] = {}
        self._count = 0
        for i, at in enumerate(request.given_wrenches):
            column, given = symbols("wrench", 6)
            in_body = pack(wrench_to_base(numbers(at.R), numbers(at.p), given))
            self._add(at, "wrench", [column], in_body, w.from_given("wrenches", 6 * i + np.arange(6)))
        if not request.contacts:
            return
        bodies = [w.shared(WIDTH) for _ in request.robot.bodies.bodies]
        write_motions(request, w, bodies, _carrying(request.robot, request.contacts), moved=False)
        for at, law in request.contacts:
            watched = {link: request.places[link] for link in law.watched(at.link)}
            if isinstance(chosen := request.arguments, ChosenNumbers):
                law = with_arguments_in(law, chosen.slots, unpack(chosen.column))
            columns, value = _of_law(request, at, law, watched)
            self._add(at, law.name, columns, value, *(bodies[body] for body, _, _ in watched.values()))

    def _add(self, at: Acting, name: str, columns: list[ca.SX], value: ca.SX, *sources: Source) -> None:
        """Add a wrench on a body, in the body's frame, and what follows from it.

        Args:
            at: Where it acts.
            name: Name of its law.
            columns: Symbols of what it depends on, beside the arguments of the robot.
            value: The wrench.
            sources: Sources of the columns.
        """
        w, robot, chosen = self._w, self._request.robot, self._request.arguments
        wrench, key, read = w.shared(6), (name, at.link, self._count), [*sources]
        self._count += 1
        if isinstance(chosen, ChosenNumbers):
            columns, read = (
                [*columns, chosen.column],
                [*read, w.from_given("parameters", np.arange(chosen.size))],
            )
        w.call(w.kernel(key, ca.Function(name, columns, [value]), "effects"), 1, read, [wrench])
        if at.output is not None:
            self.required.append((at.module, at.output, self._less(wrench)))
            return
        module = robot.modules[at.module]
        given = self._request.arguments
        own = None if given is None else given.of_modules[at.module]
        efforts, base = w.shared(len(at.path)), w.shared(6)
        given_to: list[Source] = [w.from_given("q", module.q_index), wrench]
        if own is not None:
            given_to.append(w.from_given("parameters", own.index))
        kernel = w.kernel((*key, "along"), along_path(module, at, own), "effects")
        w.call(kernel, 1, given_to, [efforts, base])
        for i, column in enumerate(at.path):
            self.along.setdefault((at.module, column), []).append(Shared(efforts.start + i, 1))
        if module.parent >= 0:
            self.required.append((module.parent, module.parent_output, self._less(base)))

    def _less(self, wrench: Shared) -> Shared:
        """Return the place of minus a wrench."""
        column = ca.SX.sym("wrench", 6)
        place = self._w.shared(6)
        kernel = self._w.kernel("less", ca.Function("less", [column], [-column]), "effects")
        self._w.call(kernel, 1, [wrench], [place])
        return place


def _carrying(robot: HybridRobot, contacts: Sequence[tuple[Acting, LinkEffect]]) -> set[int]:
    """Return the numbers of the modules that carry the links that laws watch."""
    out = set[int]()
    for at, law in contacts:
        for link in law.watched(at.link):
            k = robot.body_owner[robot.bodies.place[link][0]][0]
            while k >= 0 and k not in out:
                out.add(k)
                k = robot.modules[k].parent
    return out


def _of_law(request: Request, at: Acting, law: LinkEffect, watched: Watched) -> Written:
    """Write a law's wrench on a link, in its body's frame, from the motion of bodies."""
    with numpy_on_symbols():
        if isinstance(law, LineSprings):
            return _lines(at, law, watched)
        if isinstance(law, Bushings):
            return _bushings(at, law, watched)
        if isinstance(law, GravityCompensation):
            return _compensation(request, at, law)
        if isinstance(law, GroundContact):
            return _contact(at, law)
        return written_wrench(at.link, law, watched)


def _in_body(R: Expression, p: Expression, point: Expression) -> Expression:
    """Return a point of a link's frame in that of its body."""
    return numbers(p) + dot(numbers(R), numbers(np.asarray(point)))


def _compensation(request: Request, at: Acting, law: GravityCompensation) -> Written:
    """Write the force against a link's weight."""
    column, motion = symbols("motion", WIDTH)
    mass, com = request.weight(at.link)
    force = np.array(law.against(at.link, mass, request.robot.gravity), dtype=object)
    own = dot(motion_of(motion).R.T, force)
    return [column], pack(np.concatenate([own, cross(_in_body(at.R, at.p, com), own)]))


def _lines(at: Acting, law: LineSprings, watched: Watched) -> Written:
    """Write the pull of lines on a link."""
    (columns, bodies), total = bodies_of(watched), zeros(6)
    for line in law.lines_at(at.link):
        ends = [
            (link, watched[link][1], _in_body(*watched[link][1:], np.asarray(point, dtype=float)))
            for link, point in zip(law.ends[line], law.points[line], strict=True)
        ]
        points = [moving(bodies[link], R, arm) for link, R, arm in ends]
        forces, _, _ = law.pulls(line, [x.p for x in points], [x.v for x in points])
        for (link, _, arm), force in zip(ends, forces, strict=True):
            if link == at.link:
                own = dot(bodies[link].R.T, np.array(force, dtype=object))
                total = total + np.concatenate([own, cross(arm, own)])
    return columns, pack(total)


def _bushings(at: Acting, law: Bushings, watched: Watched) -> Written:
    """Write the wrench of bushings on a link."""
    columns, bodies = bodies_of(watched)
    total, own = zeros(6), bodies[at.link]
    for one in law.at(at.link):
        frames = []
        for link, (R_frame, p_frame) in zip(law.ends[one], law.placements[one], strict=True):
            _, R, p = watched[link]
            in_body = dot(numbers(R), numbers(R_frame)), _in_body(R, p, p_frame)
            frames.append(moving(bodies[link], *in_body))
        load = law.load(one, *frames)
        sign = 1.0 if law.ends[one][1] == at.link else -1.0
        force = sign * np.array(load.force, dtype=object)
        arm = 0.5 * (frames[0].p + frames[1].p) - own.p
        moment = sign * np.array(load.torque, dtype=object) + cross(arm, force)
        total = total + np.concatenate([dot(own.R.T, x) for x in (force, moment)])
    return columns, pack(total)


def _contact(at: Acting, law: GroundContact) -> Written:
    """Write the ground's wrench on a link."""
    column, motion = symbols("motion", WIDTH)
    body, total = motion_of(motion), zeros(6)
    for point in law.points[at.link]:
        own = _in_body(at.R, at.p, np.asarray(point, dtype=float))
        there = moving(body, at.R, own)
        force = law.on_point(there.p[2], *there.v)[1:]
        in_body = dot(body.R.T, np.array(force, dtype=object))
        total = total + np.concatenate([in_body, cross(own, in_body)])
    return [column], pack(total)
