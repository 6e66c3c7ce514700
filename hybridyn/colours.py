"""Colours of modules and of markings, shared by figures, drawings and the 3-D page."""

from __future__ import annotations

#: Colours of the modules in order, repeated for robots with more modules than colours.
MODULES = (
    "#3b7dd8", "#e8743b", "#2a9d8f", "#b5489c", "#7a9e2e",
    "#d1495b", "#6f5fc6", "#00a5c8", "#b8862b", "#5b7083",
)  # fmt: skip

GROUND = "#9aa2ab"
MOTOR = "#30353c"
JOINT = "#d5d9de"
CLOSURE = "#ffc21a"
WARNING = "#e08a00"
ALARM = "#d02f2f"
GOOD = "#2e9e5b"

Colour = tuple[int, int, int]


def module_colour(number: int) -> str:
    """Return the colour of a module as "#rrggbb"; the ground is number -1."""
    return GROUND if number < 0 else MODULES[number % len(MODULES)]


def rgb(colour: str) -> Colour:
    """Return red, green and blue, 0 to 255, of "#rrggbb"."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def lighter(colour: str, part: float) -> str:
    """Mix a colour with a part of white, 0 to 1."""
    mixed = (round(a + part * (255 - a)) for a in rgb(colour))
    return "#" + "".join(f"{x:02x}" for x in mixed)
