"""`KINDS`: the robots that can be drawn, each a recipe with what is known of its mobility."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from hybridyn.description.records import JointKind
from tests.robots.parts import (
    arm,
    central,
    delta,
    five_bar,
    four_bar,
    planar_rpr,
    rps3,
    rssr,
    six_bar,
    slider_crank,
    spatial_loop,
    star,
)
from tests.robots.sketch import CLOSURES, Place, Sketch


@dataclass(frozen=True)
class Kind:
    """A recipe and what is known of every robot it draws.

    Attributes:
        recipe: Lays the robot out.
        loops: Mobility of each module that holds a loop or a coupling, in no order.
        serial: Freedoms of the joints that are in no loop.
        motors: Against the mobility: as many ("square"), "redundant", or too "few" (passive motion is left).
        massless: Whether some allowed motion moves no mass (its acceleration has no answer).
    """

    recipe: Callable[[Sketch], None]
    loops: tuple[int, ...] = ()
    serial: int = 0
    motors: Literal["square", "redundant", "few"] = "square"
    massless: bool = False

    @property
    def mobility(self) -> int:
        """Freedoms of the whole, without those of a base."""
        return sum(self.loops) + self.serial


def on(s: Sketch, link: str) -> Place:
    """Return a place on a link for the next part."""
    return s.place(s.poses[link][:3, 3] + s.rng.uniform(-0.15, 0.15, 3))


def serial(s: Sketch) -> None:
    tip = arm(s, "base", np.zeros(3), ["revolute", "continuous", "prismatic", "revolute"])
    arm(s, tip, s.poses[tip][:3, 3] + 0.2, ["revolute", "prismatic"])
    arm(s, tip, s.poses[tip][:3, 3] - 0.2, ["continuous"])


def serial_all(s: Sketch) -> None:
    arm(
        s,
        "base",
        np.zeros(3),
        ["revolute", "spherical", "prismatic", "planar", "continuous", "floating", "revolute"],
    )


def loop(s: Sketch, closure: str) -> None:
    links = spatial_loop(s, "base", closure)
    arm(s, links[0], s.poses[links[0]][:3, 3], ["revolute"])


def one(s: Sketch, part: Callable[..., object], **options: object) -> None:
    part(s, "base", s.place(), **options)


def sps_thin(s: Sketch) -> None:
    s.fixed_links = 0.0
    _, rods = star(s, "base", s.place(), "SSSSSS", wrists=["point"], carried=False)
    for rod in rods:
        slide = next(joint for joint in s.joints if joint.child == rod)
        along = s.poses[rod][:3, :3] @ slide.axis
        s.thin(rod, along)
        s.thin(slide.parent, along)


def coupled_arm(s: Sketch, ratios: Sequence[float], kinds: Sequence[JointKind]) -> None:
    link, links, at = "base", [], np.zeros(3)
    for i, kind in enumerate(kinds):
        link = s.joint(kind, link, at, motor=i != 1)
        links.append(link)
        at = at + 0.3 * s.direction()
    s.couple(links[: len(ratios)], ratios)


def gear_across(s: Sketch) -> None:
    crank, coupler, _ = four_bar(s, "base", s.place())
    tool = s.joint("revolute", coupler, s.poses[coupler][:3, 3] + 0.2)
    s.couple([crank, tool], [1.0, 0.7])
    arm(s, tool, s.poses[tool][:3, 3], ["revolute"])


def gear_inside(s: Sketch) -> None:
    left, right, *_ = five_bar(s, "base", s.place(), motors=1)
    s.couple([left, right], [1.0, -1.5])


def chain_of_bars(s: Sketch) -> None:
    link = "base"
    for i in range(3):
        link = five_bar(s, link, on(s, link))[2] if i == 1 else four_bar(s, link, on(s, link))[1]
        link = arm(s, link, s.poses[link][:3, 3], ["revolute"])


def stack(s: Sketch) -> None:
    platform, _ = star(s, "base", s.place(), "UUUUUU")
    second, _ = rps3(s, platform, on(s, platform))
    arm(s, second, s.poses[second][:3, 3], ["revolute", "prismatic"])


def branched(s: Sketch) -> None:
    trunk = arm(s, "base", np.zeros(3), ["revolute"])
    _, first, second = six_bar(s, trunk, on(s, trunk))
    four_bar(s, first, on(s, first))
    rps3(s, second, on(s, second))


def on_leg(s: Sketch) -> None:
    platform, rods = rps3(s, "base", s.place())
    four_bar(s, rods[1], on(s, rods[1]))
    arm(s, rods[2], s.poses[rods[2]][:3, 3], ["revolute"])
    arm(s, platform, s.poses[platform][:3, 3], ["revolute"])


def legged(s: Sketch) -> None:
    for side in (-0.4, 0.4):
        hip = s.joint("revolute", "base", np.array([0.0, side, 0.0]), motor=True)
        _, knee, _ = four_bar(s, hip, on(s, hip))
        arm(s, knee, s.poses[knee][:3, 3], ["revolute"])


def stewart_arm(s: Sketch) -> None:
    platform, _ = star(s, "base", s.place(), "UUUUUU", carried=False)
    arm(s, platform, s.poses[platform][:3, 3], ["revolute"] * 3)


def scara_delta(s: Sketch) -> None:
    tip = arm(s, "base", np.zeros(3), ["revolute", "revolute"])
    delta(s, tip, on(s, tip), bars=True)


KINDS: dict[str, Kind] = {
    "serial": Kind(serial, serial=7),
    "serial_all": Kind(serial_all, serial=16, motors="few"),
    **{f"loop_{name}": Kind(partial(loop, closure=name), loops=(2,), serial=1) for name in CLOSURES},
    "four_bar": Kind(partial(one, part=four_bar), loops=(1,)),
    "four_bar_two_motors": Kind(partial(one, part=four_bar, motors=2), loops=(1,), motors="redundant"),
    "four_bar_point": Kind(partial(one, part=four_bar, closure="spherical"), loops=(1,)),
    "slider_crank": Kind(partial(one, part=slider_crank), loops=(1,)),
    "five_bar": Kind(partial(one, part=five_bar), loops=(2,)),
    "five_bar_four_motors": Kind(partial(one, part=five_bar, motors=4), loops=(2,), motors="redundant"),
    "five_bar_one_motor": Kind(partial(one, part=five_bar, motors=1), loops=(2,), motors="few"),
    "six_bar": Kind(partial(one, part=six_bar), loops=(1,)),
    "rssr": Kind(partial(one, part=rssr), loops=(2,), motors="few"),
    "planar_rpr": Kind(partial(one, part=planar_rpr), loops=(3,)),
    "gough": Kind(partial(one, part=star, feet="UUUUUU"), loops=(6,)),
    "gough_floating": Kind(partial(one, part=star, feet="UUUUUU", carried=False), loops=(6,)),
    "gough_eight_motors": Kind(
        partial(one, part=star, feet="UUUUUU", turned=2), loops=(6,), motors="redundant"
    ),
    "gough_gimbals": Kind(partial(one, part=star, feet="UUUUUU", wrists=["gimbal", "crossing"]), loops=(6,)),
    "gough_points": Kind(partial(one, part=star, feet="UUUUUU", wrists=["point"]), loops=(6,)),
    "star_three": Kind(partial(one, part=star, feet="UUU", turned=3), loops=(6,)),
    "star_four": Kind(partial(one, part=star, feet="UUUR", turned=1), loops=(5,)),
    "star_five": Kind(partial(one, part=star, feet="UUUUU", turned=1), loops=(6,)),
    "star_few": Kind(partial(one, part=star, feet="UUUU"), loops=(6,), motors="few"),
    "sps": Kind(partial(one, part=star, feet="SSSSSS"), loops=(12,), motors="few"),
    "sps_thin": Kind(sps_thin, loops=(12,), motors="few", massless=True),
    "star_universal": Kind(
        partial(one, part=star, feet="UUUU", wrists=["universal", "two", "two"], turned=0),
        loops=(2,),
        motors="redundant",
    ),
    "star_two_axes": Kind(partial(one, part=star, feet="UUU", wrists=["universal", "two"]), loops=(3,)),
    "rps3": Kind(partial(one, part=rps3), loops=(3,)),
    "central": Kind(partial(one, part=central), loops=(3,)),
    "delta_rods": Kind(partial(one, part=delta, bars=False), loops=(3,)),
    "delta_bars": Kind(partial(one, part=delta, bars=True), loops=(3,)),
    "gear_two": Kind(partial(coupled_arm, ratios=[1.0, -2.0], kinds=["revolute"] * 3), loops=(1,), serial=1),
    "gear_three": Kind(
        partial(
            coupled_arm, ratios=[1.0, -0.5, 0.8], kinds=["revolute", "revolute", "revolute", "prismatic"]
        ),
        loops=(2,),
        serial=1,
    ),
    "gear_rack": Kind(
        partial(coupled_arm, ratios=[0.3, 1.0], kinds=["continuous", "prismatic", "revolute"]),
        loops=(1,),
        serial=1,
    ),
    "gear_across": Kind(gear_across, loops=(1,), serial=1),
    "gear_inside": Kind(gear_inside, loops=(1,)),
    "chain_of_bars": Kind(chain_of_bars, loops=(1, 1, 2), serial=3),
    "stack": Kind(stack, loops=(3, 6), serial=2),
    "stewart_arm": Kind(stewart_arm, loops=(6,), serial=3),
    "scara_delta": Kind(scara_delta, loops=(3,), serial=2),
    "branched": Kind(branched, loops=(1, 1, 3), serial=1),
    "on_leg": Kind(on_leg, loops=(1, 3), serial=2),
    "legged": Kind(legged, loops=(1, 1), serial=4),
}
