"""Effects on links: wrenches that depend on where links are and how they move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ..linkage.motion import Motion
from ..spatial import Array, rotate_back
from ..structure.robot import HybridRobot

#: Three scalars: numbers, arrays or expressions.
Three = Sequence[Any] | NDArray[Any]


class Moving(NamedTuple):
    """A frame and its motion in the world, as scalars, arrays or expressions.

    Attributes:
        R: Its axes, shape (3, 3, ...).
        p: Its origin, shape (3, ...), [m].
        v: The velocity of its origin, shape (3, ...), [m/s].
        w: Its angular velocity, shape (3, ...), [rad/s].
    """

    R: NDArray[Any]
    p: NDArray[Any]
    v: NDArray[Any]
    w: NDArray[Any]


class LinkEffect:
    """A law of wrenches on links; by default, it stores no energy and dissipates none.

    A law has a `name`, its `links`, and `wrench_on`, which runs on numbers and on symbols alike.

    Attributes:
        name: Name of the effect.
        of_motion: Whether wrenches depend on nothing but the motion of links; a law over time has `wrenches`
            in place of `wrench_on`.
        acts_on: What its numbers in files are by: "link".
    """

    name: ClassVar[str]
    of_motion: ClassVar[bool] = True
    acts_on: ClassVar[str] = "link"

    @property
    def links(self) -> tuple[str, ...]:
        """The links on which wrenches act or whose motion the law needs."""
        raise NotImplementedError

    @property
    def needs_motion(self) -> bool:
        """Whether wrenches depend on the motion of the links."""
        return True

    def watched(self, link: str) -> tuple[str, ...]:
        """Return the links whose motion the wrench on a link depends on; by default, all."""
        return self.links

    def bound(self, robot: HybridRobot) -> Self:
        """Return the law with the numbers that it takes from a robot; by default, it takes none.

        Raises:
            ModelError: They are invalid.
        """
        return self

    def wrench_on(self, link: str, motions: Mapping[str, Moving]) -> tuple[Three, Three]:
        """Compute the force [N] on a link at its frame's origin, and the moment [N m], in world axes.

        Args:
            link: The link.
            motions: Motion of the links in `watched(link)`, as arrays of shape (..., T) or expressions.
        """
        raise NotImplementedError

    def stored(self, motions: Mapping[str, Moving]) -> Any:
        """Compute the stored energy, shape (T,), [J]. `motions`: those of all links."""
        return 0.0

    def lost(self, motions: Mapping[str, Moving]) -> Any:
        """Compute the dissipated power, shape (T,), [W]. `motions`: those of all links."""
        return 0.0

    def wrenches(self, time: Array | None, motions: Mapping[str, Motion], samples: int) -> dict[str, Array]:
        """Compute the wrench on each link, shape (T, 6), [N, N m], in its frame at its origin.

        Args:
            time: Times, shape (T,), [s], or None.
            motions: Motion of the links in the world.
            samples: Number of samples T.
        """
        every, out = self._own(motions), {}
        for link in self.links:
            parts = self.wrench_on(link, {name: every[name] for name in self.watched(link)})
            own = (np.stack([np.broadcast_to(x, samples) for x in part], axis=1) for part in parts)
            out[link] = np.concatenate([rotate_back(motions[link].R, x) for x in own], axis=1)
        return out

    def energy(self, motions: Mapping[str, Motion]) -> Array:
        """Compute the stored energy, shape (T,) or (), [J]."""
        return np.asarray(self.stored(self._own(motions)))

    def power(self, motions: Mapping[str, Motion]) -> Array:
        """Compute the dissipated power, shape (T,) or (), [W]."""
        return np.asarray(self.lost(self._own(motions)))

    def _own(self, motions: Mapping[str, Motion]) -> dict[str, Moving]:
        """Return the motions of the law's links."""
        return {link: _moving(motions[link]) for link in self.links if link in motions}


def _moving(m: Motion) -> Moving:
    """Return the motion of a frame with the samples as the last axis."""
    return Moving(np.moveaxis(m.R, 0, -1), m.p.T, m.p_dot.T, m.w.T)
