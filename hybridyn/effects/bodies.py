"""Effects on links that follow from where they are: compensated weight, and springs along lines of points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from ..description.names import did_you_mean
from ..errors import ModelError
from ..linkage.motion import Motion
from ..spatial import LARGEST, Array, cross, rotate, rotate_back
from ..structure.forms import check_form
from ..structure.robot import HybridRobot
from .joints import WIDTH, Numbers, positive
from .lengths import WORDS, check_numbers, stretch, tension
from .link_effect import LinkEffect

#: Shortest length by which is divided [m]; points closer than this have no direction between them.
SHORTEST_LINE = 1e-150


@dataclass(frozen=True, eq=False)
class GravityCompensation(LinkEffect):
    """A force against the weight of links, at their centres of mass: a part of it, 1 for a weightless link.

    `fraction`: the part by link. The force stays if the effect gravity is left out.
    Source: MuJoCo's `gravcomp`.
    """

    fraction: Mapping[str, float]
    forces: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    name: ClassVar[str] = "gravity_compensation"

    @property
    def links(self) -> tuple[str, ...]:
        """The links."""
        return tuple(self.fraction)

    def bound(self, robot: HybridRobot) -> GravityCompensation:
        """Return the law with the force [N], world axes, and the centre of mass [m] of each link of a robot.

        Raises:
            ModelError: A link is unknown, or a number is not finite.
        """
        known = {link.name: link for link in robot.description.links}
        forces = {}
        for link, part in self.fraction.items():
            if link not in known:
                raise ModelError(
                    f"{self.name}: no such link '{link}'{did_you_mean(link, known)}", element=link
                )
            if not abs(part) <= LARGEST:
                raise ModelError(f"{self.name}: '{link}' has {part:g}; it must be finite", element=link)
            force = np.array(self.against(link, known[link].mass, robot.gravity))
            forces[link] = force, np.asarray(known[link].com)
        return replace(self, forces=forces)

    def against(self, link: str, mass: Any, gravity: Array) -> list[Any]:
        """Compute the force against a link's weight [N], world axes, three numbers.

        Args:
            mass: Mass of the link [kg], a number or an expression.
            gravity: Acceleration of gravity [m/s^2], shape (3,).
        """
        return [-self.fraction[link] * float(g) * mass for g in gravity]

    def watched(self, link: str) -> tuple[str, ...]:
        """Return the links whose motion the wrench on a link depends on."""
        return (link,)

    def wrenches(self, time: Array | None, motions: Mapping[str, Motion], samples: int) -> dict[str, Array]:
        """Compute the wrench on each link."""
        out = {}
        for link, (force, com) in self.forces.items():
            own = rotate_back(motions[link].R, np.tile(force, (samples, 1)))
            out[link] = np.concatenate([own, cross(np.broadcast_to(com, own.shape), own)], axis=1)
        return out

    def energy(self, motions: Mapping[str, Motion]) -> Array:
        """Compute minus force times height of the centres of mass."""
        stored = np.zeros(())
        for link, (force, com) in self.forces.items():
            m = motions[link]
            stored = stored - (m.p + rotate(m.R, np.broadcast_to(com, m.p.shape))) @ force
        return stored


@dataclass(frozen=True)
class LineSprings(LinkEffect):
    """Springs, dampers and dry friction along straight lines through points of links.

    The tension of a line of length l is k (l - upper) above `upper` and k (l - lower) below `lower`, plus
    c l_dot and f tanh(l_dot / width). It pulls each point towards its neighbours; l is the sum of share x
    distance between neighbours, and the pull along a stretch is share x tension.

    `ends`: the links of a line's points, two or more; `points`: each in the frame of its link [m];
    `stiffness`: k, `damping`: c, `friction`: f, `lower` and `upper`: lengths between which the spring is
    slack [m], 0 by default; `shares`: of each stretch, 1 by default: 1 / divisor behind a pulley, 0 for a
    gap; all by line; `width` [m/s].
    Source: MuJoCo's spatial tendons through sites, with smoothed friction.
    """

    ends: Mapping[str, Sequence[str]]
    points: Mapping[str, Sequence[Sequence[float]]]
    stiffness: Numbers = field(default_factory=dict)
    damping: Numbers = field(default_factory=dict)
    friction: Numbers = field(default_factory=dict)
    lower: Numbers = field(default_factory=dict)
    upper: Numbers = field(default_factory=dict)
    width: float = WIDTH
    shares: Mapping[str, Sequence[float]] = field(default_factory=dict)
    name: ClassVar[str] = "line_springs"

    def __post_init__(self) -> None:
        check_form(self)
        positive(self.name, "width", self.width)
        for line, links in self.ends.items():
            points = np.asarray(self.points.get(line, ()), dtype=float)
            if len(links) < 2 or points.shape != (len(links), 3) or not np.isfinite(points).all():
                raise ModelError(
                    f"{self.name}: line '{line}' needs two links or more in 'ends', and for each a triple of "
                    "finite numbers in 'points'", element=line,
                )  # fmt: skip
            shares = np.asarray(self._shares(line), dtype=float)
            right = shares.shape == (len(links) - 1,) and np.isfinite(shares).all() and shares.min() >= 0
            if not (right and shares.any()):
                raise ModelError(
                    f"{self.name}: 'shares' of line '{line}' needs {len(links) - 1} finite numbers, one for "
                    "each stretch between neighbours, none below 0 and one above", element=line,
                )  # fmt: skip
        tables = {what: getattr(self, what) for what in WORDS}
        named = {what: dict.fromkeys(getattr(self, what), 0.0) for what in ("points", "shares")}
        check_numbers(self.name, "line", self.ends, "ends", named | tables)

    def _shares(self, line: str) -> Sequence[float]:
        """Return the share of each stretch of a line."""
        return self.shares.get(line, (1.0,) * (len(self.ends[line]) - 1))

    @property
    def links(self) -> tuple[str, ...]:
        """The links with points."""
        return tuple(dict.fromkeys(link for links in self.ends.values() for link in links))

    def lines_at(self, link: str) -> Iterable[str]:
        """Return the lines with points on a link."""
        return (line for line, links in self.ends.items() if link in links)

    def watched(self, link: str) -> tuple[str, ...]:
        """Return the links whose motion the wrench on a link depends on."""
        return tuple(dict.fromkeys(other for line in self.lines_at(link) for other in self.ends[line]))

    def pulls(self, line: str, points: Sequence[Any], rates: Sequence[Any]) -> tuple[list[Any], Any, Any]:
        """Compute the forces on the points of a line, its length, and its rate.

        Args:
            points: Each as three numbers, arrays or expressions, world axes [m].
            rates: Their velocities [m/s].
        """
        ways, length, rate = [], 0.0, 0.0
        stretches = zip(pairwise(points), pairwise(rates), self._shares(line), strict=True)
        for (a, b), (va, vb), share in stretches:
            r = [y - x for x, y in zip(a, b, strict=True)]
            size = np.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + SHORTEST_LINE**2)
            ways.append([share * x / size for x in r])
            length = length + share * size
            rate = rate + sum(u * (y - x) for u, x, y in zip(ways[-1], va, vb, strict=True))
        tension = self.tension(line, length, rate)
        none = [[0.0, 0.0, 0.0]]
        forces = [
            [tension * (after - before) for before, after in zip(one, two, strict=True)]
            for one, two in zip(none + ways, ways + none, strict=True)
        ]
        return forces, length, rate

    def tension(self, line: str, length: Any, rate: Any) -> Any:
        """Compute the tension of a line [N]."""
        return tension(self._numbers(line), self.width, length, rate)

    def _numbers(self, line: str) -> list[float]:
        """Return the numbers of a line, those of `WORDS`."""
        return [getattr(self, word).get(line, 0.0) for word in WORDS]

    def _moving(self, line: str, motions: Mapping[str, Motion]) -> tuple[list[Any], list[Any]]:
        """Compute positions and velocities of a line's points, each of shape (3, T)."""
        at, rates = [], []
        for link, point in zip(self.ends[line], self.points[line], strict=True):
            m = motions[link]
            arm = rotate(m.R, np.broadcast_to(np.asarray(point, dtype=float), m.p.shape))
            at.append((m.p + arm).T)
            rates.append((m.p_dot + cross(m.w, arm)).T)
        return at, rates

    def wrenches(self, time: Array | None, motions: Mapping[str, Motion], samples: int) -> dict[str, Array]:
        """Compute the wrench of all lines on each link."""
        out = {link: np.zeros((samples, 6)) for link in self.links}
        for line, links in self.ends.items():
            forces, _, _ = self.pulls(line, *self._moving(line, motions))
            for link, point, force in zip(links, self.points[line], forces, strict=True):
                own = rotate_back(motions[link].R, np.stack(force, axis=1))
                out[link][:, :3] += own
                out[link][:, 3:] += cross(np.broadcast_to(np.asarray(point, dtype=float), own.shape), own)
        return out

    def energy(self, motions: Mapping[str, Motion]) -> Array:
        """Compute the sum of k stretch^2 / 2."""
        stored = np.zeros(())
        for line in self.ends:
            _, length, _ = self.pulls(line, *self._moving(line, motions))
            k, _, _, lower, upper = self._numbers(line)
            stored = stored + 0.5 * k * stretch(lower, upper, length) ** 2
        return stored

    def power(self, motions: Mapping[str, Motion]) -> Array:
        """Compute the power that dampers and friction dissipate."""
        lost = np.zeros(())
        for line in self.ends:
            _, length, rate = self.pulls(line, *self._moving(line, motions))
            lost = lost + (self.tension(line, length, rate) - self.tension(line, length, 0.0 * rate)) * rate
        return lost
