"""The sliders of the page: one per joint that can be moved, in a folder per module."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..spatial import Array
from .posing import Lever, Poser

#: Folders that are unfolded at first.
OPEN = 1
#: Of a slider, at the least.
STEPS = 500


class Sliders:
    """The sliders of a robot's motors, or of its independent joints where it has no motors."""

    def __init__(self, gui: Any, poser: Poser, q: Array, moved: Callable[[str, float], None]) -> None:
        """Add the sliders.

        Args:
            gui: The page's panel.
            poser: What moves the robot.
            q: The posture that is shown, shape (nq,).
            moved: Called with a joint's name and its position when the user moves its slider [m or rad].
        """
        self._poser = poser
        self._sliders: list[tuple[Lever, Any]] = []
        for count, group in enumerate(self._groups()):
            what = "motors" if group[0].is_motor else "joints"
            names = dict.fromkeys(poser.robot.modules[lever.module].name for lever in (group[0], group[-1]))
            with gui.add_folder(f"{what} of {' ... '.join(names)}", expand_by_default=count < OPEN):
                for lever in group:
                    self._add(gui, lever, q, moved)

    def _groups(self) -> list[list[Lever]]:
        """Return the levers module by module, joints in series together."""
        groups: list[list[Lever]] = []
        modules = self._poser.robot.modules
        for lever in sorted(self._poser.levers, key=lambda lever: lever.module):
            last = groups[-1][-1].module if groups else -1
            follows = modules[lever.module].parent == last and not modules[lever.module].closures
            if groups and (last == lever.module or (follows and not modules[last].closures)):
                groups[-1].append(lever)
            else:
                groups.append([lever])
        return groups

    def _add(self, gui: Any, lever: Lever, q: Array, moved: Callable[[str, float], None]) -> None:
        step = round_step(lever.high - lever.low)
        hint = f"{lever.joint} [{lever.unit}]"
        value = self._value(lever, q, step)
        slider = gui.add_slider(lever.joint, lever.low, lever.high, step, value, hint=hint)
        on_slide(slider, lambda value: moved(lever.joint, value))
        self._sliders.append((lever, slider))

    def _value(self, lever: Lever, q: Array, step: float) -> float:
        """Return a joint's position as its slider shows it: in steps, and within its range."""
        value = round(self._poser.value(q, lever.joint) / step) * step
        return float(np.clip(round(value, 9), lever.low, lever.high))

    def show(self, q: Array) -> None:
        """Bring all sliders where a posture, shape (nq,), has them."""
        for lever, slider in self._sliders:
            slider.value = self._value(lever, q, slider.step)


def on_slide(slider: Any, act: Callable[[float], None]) -> None:
    """Act when the user moves a slider, not when we do.

    Args:
        slider: The slider.
        act: Called with its new value.
    """

    def moved(event: Any) -> None:
        if event.client is not None:
            act(float(slider.value))

    slider.on_update(moved)


def round_step(span: float) -> float:
    """Return a round step for a slider over a span."""
    return float(10.0 ** np.floor(np.log10(span / STEPS))) if span > 0 else 1e-3
