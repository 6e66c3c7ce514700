"""Effects on links: wrenches as functions of time, positions and rates."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..errors import ModelError, TrajectoryError
from ..linkage.motion import Motion
from ..spatial import Array, cross, rotate, rotate_back
from ..structure.forms import check_form
from .joints import WIDTH, positive
from .link_effect import LinkEffect


def within(name: str, table_time: Array, time: Array | None) -> Array:
    """Return times, which are within a table.

    Raises:
        TrajectoryError: There is none, or one is before the first row or after the last.
    """
    if time is None:
        raise TrajectoryError(f"the effect '{name}' follows a table: pass time=")
    out = np.flatnonzero((time < table_time[0]) | (time > table_time[-1]))
    if len(out):
        raise TrajectoryError(
            f"{name}: its table runs from {table_time[0]:g} s to {table_time[-1]:g} s; "
            f"t = {time[out[0]]:g} s is outside"
        )
    return time


def table(name: str, time: Any, values: Any, width: int) -> tuple[Array, Array]:
    """Check a table over time.

    Returns:
        Times, shape (rows,), and values, shape (rows, width).

    Raises:
        ModelError: A shape is wrong, a number is not finite, or the times do not increase.
    """
    t, x = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    if t.ndim != 1 or len(t) < 2 or x.shape != (len(t), width):
        raise ModelError(
            f"{name}: a table needs two rows or more: times (rows,) and values (rows, {width}), "
            f"not {t.shape} and {x.shape}"
        )
    if not (np.isfinite(t).all() and np.isfinite(x).all() and (np.diff(t) > 0).all()):
        raise ModelError(f"{name}: a table's numbers must be finite and its times grow")
    return t, x


@dataclass(frozen=True, eq=False)
class Wrench(LinkEffect):
    """A wrench on a link, constant or interpolated linearly in a table.

    `wrench` [N, N m]: force and moment at the link's origin, shape (6,) or, with `time` [s], (rows, 6);
    `frame`: axes of the "link" or of the "world". Its work counts as supplied, not as stored energy.
    """

    link: str
    wrench: Array | Sequence[float]
    time: Array | Sequence[float] | None = None
    frame: str = "link"
    name: ClassVar[str] = "wrench"
    of_motion: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_form(self)
        if self.frame not in ("link", "world"):
            raise ModelError(
                f"{self.name}: frame must be 'link' or 'world', not {self.frame!r}", element=self.link
            )
        if self.time is not None:
            table(f"{self.name} on '{self.link}'", self.time, self.wrench, 6)
        elif np.shape(self.wrench) != (6,) or not np.isfinite(self.wrench).all():
            raise ModelError(f"{self.name} on '{self.link}': six finite numbers wanted", element=self.link)

    @property
    def links(self) -> tuple[str, ...]:
        """The link."""
        return (self.link,)

    @property
    def needs_motion(self) -> bool:
        """Whether the wrench is in world axes."""
        return self.frame == "world"

    def wrenches(self, time: Array | None, motions: Mapping[str, Motion], samples: int) -> dict[str, Array]:
        """Compute the wrench at each sample."""
        if self.time is None:
            W = np.tile(np.asarray(self.wrench, dtype=float), (samples, 1))
        else:
            rows_time, rows = np.asarray(self.time, dtype=float), np.asarray(self.wrench, dtype=float)
            time = within(f"{self.name} on '{self.link}'", rows_time, time)
            W = np.stack([np.interp(time, rows_time, column) for column in rows.T], axis=1)
        if self.frame == "world":
            R = motions[self.link].R
            W = np.concatenate([rotate_back(R, W[:, :3]), rotate_back(R, W[:, 3:])], axis=1)
        return {self.link: W}


#: Least speed of a sliding point by which is divided [m/s]; slower ones have no direction.
AT_REST = 1e-30


@dataclass(frozen=True)
class GroundContact(LinkEffect):
    """Points of links on compliant, unilateral ground, the plane z = height of the world.

    A point at depth d has the normal force N = k d max(0, 1 + c d_dot) >= 0 and the friction force
    -mu N tanh(|s| / width) s / |s| against its sliding velocity s. `points`: points in the link's frame by
    link [m]; `stiffness`: k [N/m]; `damping`: c [s/m]; `friction`: mu; `width` [m/s]; `height` [m].
    Penetration is part of the model: a weight W on one point rests at depth W / k, and loaded points creep
    (the friction is smoothed). Source: Hunt & Crossley (1975), J. Appl. Mech. 42, with exponent one.
    """

    points: Mapping[str, Sequence[Sequence[float]]]
    stiffness: float
    damping: float = 0.0
    friction: float = 0.0
    width: float = WIDTH
    height: float = 0.0
    name: ClassVar[str] = "ground_contact"

    def __post_init__(self) -> None:
        check_form(self)
        for what in ("stiffness", "damping", "friction"):
            positive(self.name, what, getattr(self, what), or_zero=True)
        positive(self.name, "width", self.width)
        if not np.isfinite(self.height):
            raise ModelError(f"{self.name}: height must be finite, not {self.height:g}")
        for link in self.points:
            if not np.isfinite(self._points[link]).all() or self._points[link].ndim != 2:
                raise ModelError(
                    f"{self.name}: points of '{link}' must be triples of finite numbers", element=link
                )

    @cached_property
    def _points(self) -> dict[str, Array]:
        return {
            link: np.asarray(points, dtype=float).reshape(len(points), -1)
            for link, points in self.points.items()
        }

    def watched(self, link: str) -> tuple[str, ...]:
        """Return the links whose motion the wrench on a link depends on."""
        return (link,)

    @property
    def links(self) -> tuple[str, ...]:
        """The links with points."""
        return tuple(self.points)

    def _touches(self, motions: Mapping[str, Motion]) -> Iterator[tuple[str, Array, Array, Array, Array]]:
        """Yield each point's link, arm, velocity and penetration, and the force on it, world axes."""
        for link, points in self._points.items():
            m = motions[link]
            for point in points:
                arm = rotate(m.R, np.tile(point, (len(m.p), 1)))
                velocity = m.p_dot + cross(m.w, arm)
                depth, *force = self.on_point(m.p[:, 2] + arm[:, 2], *velocity.T)
                yield link, arm, velocity, depth, np.stack(force, axis=1)

    def on_point(self, z: Any, x_dot: Any, y_dot: Any, z_dot: Any) -> tuple[Any, Any, Any, Any]:
        """Compute a point's penetration [m] and the ground's force on it [N] in world axes: x, y, z.

        Args:
            z: Its height [m]; numbers, arrays or expressions, as the others.
            x_dot, y_dot, z_dot: Its velocity [m/s].
        """
        depth = np.maximum(self.height - z, 0.0)
        normal = self.stiffness * depth * np.maximum(1.0 - self.damping * z_dot, 0.0)
        speed = np.sqrt(x_dot * x_dot + y_dot * y_dot)
        grip = self.friction * normal * np.tanh(speed / self.width) / np.maximum(speed, AT_REST)
        return depth, -grip * x_dot, -grip * y_dot, normal

    def wrenches(self, time: Array | None, motions: Mapping[str, Motion], samples: int) -> dict[str, Array]:
        """Compute the ground's wrench on each link."""
        out = {link: np.zeros((samples, 6)) for link in self.points}
        for link, arm, _, _, force in self._touches(motions):
            out[link][:, :3] += rotate_back(motions[link].R, force)
            out[link][:, 3:] += rotate_back(motions[link].R, cross(arm, force))
        return out

    def energy(self, motions: Mapping[str, Motion]) -> Array:
        """Compute the sum of k d^2 / 2."""
        stored = [0.5 * self.stiffness * depth**2 for _, _, _, depth, _ in self._touches(motions)]
        return np.asarray(np.sum(stored, axis=0))

    def power(self, motions: Mapping[str, Motion]) -> Array:
        """Compute the power dissipated: the power absorbed minus the rate of the stored energy."""
        lost = np.zeros(())
        for _, _, velocity, depth, force in self._touches(motions):
            lost = lost + self.stiffness * depth * velocity[:, 2] - np.sum(force * velocity, axis=1)
        return lost
