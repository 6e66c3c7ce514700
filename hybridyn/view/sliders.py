"""Sliders of the page: one per movable joint, in one folder per module."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..spatial import Array
from .posing import Lever, Poser

#: Number of folders that are expanded initially.
OPEN = 1
#: Smallest number of steps of a slider.
STEPS = 500


class Sliders:
    """Sliders of a robot's motors, or of its independent joints if it has no motors."""

    def __init__(self, gui: Any, poser: Poser, q: Array, moved: Callable[[str, float], None]) -> None:
        """Add the sliders.

        Args:
            gui: The page's panel.
            poser: Moves the robot.
            q: The displayed posture, shape (nq,).
            moved: Called with a joint's name and its position [m or rad] when the user moves its slider.
        """
        self._poser = poser
        self._sliders: list[tuple[Lever, Any]] = []
        for count, group in enumerate(self._groups()):
            what = "motors" if poser.robot.motors else "joints"
            names = dict.fromkeys(poser.robot.modules[lever.module].name for lever in (group[0], group[-1]))
            with gui.add_folder(f"{what} of {' ... '.join(names)}", expand_by_default=count < OPEN):
                for lever in group:
                    self._add(gui, lever, q, moved)

    def _groups(self) -> list[list[Lever]]:
        """Group the levers by module; modules in series without closures share a group."""
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
        """Return a joint's position as shown by its slider: rounded to steps, within the range."""
        value = round(self._poser.value(q, lever.joint) / step) * step
        return float(np.clip(round(value, 9), lever.low, lever.high))

    def show(self, q: Array) -> None:
        """Set all sliders to a posture, shape (nq,)."""
        for lever, slider in self._sliders:
            slider.value = self._value(lever, q, slider.step)


def on_slide(slider: Any, act: Callable[[float], None]) -> None:
    """Register a function that is called when the user moves a slider, but not when the program does."""

    def moved(event: Any) -> None:
        """Call the function if a user has moved the slider."""
        if event.client is not None:
            act(float(slider.value))

    slider.on_update(moved)


def round_step(span: float) -> float:
    """Return a power of ten as the step of a slider over a span."""
    return float(10.0 ** np.floor(np.log10(span / STEPS))) if span > 0 else 1e-3
