"""Robots with one feature each, for the table of what each format keeps: a name, an element, a robot.

The robot without any feature has two hinges in a row and a slide beside them; features stand at joint "two",
at motor "one", at link "tool" or at closure "loop", which closes at home.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from hybridyn.description import Closure, Coupling, Description, Joint, Link
from hybridyn.description.placement import inverse, placement_from, poses_at, turned
from hybridyn.description.records import Curve, JointKind, Load
from tests.robots.sketch import CLOSURES

AT = placement_from(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([0.1, 0.2, 0.3]))
INERTIA = np.array([[0.02, 0.001, 0.002], [0.001, 0.03, 0.003], [0.002, 0.003, 0.04]])
ZERO = np.zeros((3, 3))
WEIGHTLESS = {"mass": 0.0, "com": np.zeros(3), "inertia": ZERO}
#: Axes of a frame in those of its author: the same, in another order, and such that no words of rows say.
UPRIGHT = np.eye(3)
CYCLIC = np.eye(3)[:, [1, 2, 0]]
OBLIQUE = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
#: Home positions by kind of joint, with sines and cosines that lose no digit.
HOMES: dict[JointKind, tuple[float, ...]] = {
    "revolute": (0.4,), "continuous": (0.4,), "prismatic": (0.4,), "spherical": (0.0, 0.6, 0.0, 0.8),
    "planar": (0.5, -0.4, 0.6, 0.8), "floating": (0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8),
}  # fmt: skip
SEVERAL: tuple[JointKind, ...] = ("spherical", "planar", "floating")


def robot(**changes: Any) -> Description:
    """Return the robot without features, but for changes of its fields."""
    links = tuple(
        Link(name, 1.5, np.array([0.1, 0, 0.2]), INERTIA) for name in ("base", "arm", "tool", "cart")
    )
    joints = (
        Joint("one", "revolute", "base", "arm", AT, np.array([0.0, 0.6, 0.8])),
        Joint("two", "revolute", "arm", "tool", AT, np.array([0.0, 0.0, 1.0])),
        Joint("rail", "prismatic", "base", "cart", AT, np.array([1.0, 0.0, 0.0])),
    )
    home = {"one": (0.3,), "rail": (0.1,)}
    return replace(Description("robot", links, joints, motors=("one", "rail"), home=home), **changes)


def joint(name: str = "two", *, home: tuple[float, ...] = (), **numbers: Any) -> Description:
    """Return the robot with other numbers of a joint."""
    d = robot()
    joints = tuple(replace(one, **numbers) if one.name == name else one for one in d.joints)
    return replace(d, joints=joints, home=d.home | ({name: home} if home else {}))


def link(name: str = "tool", **numbers: Any) -> Description:
    """Return the robot with other numbers of a link."""
    d = robot()
    return replace(d, links=tuple(replace(one, **numbers) if one.name == name else one for one in d.links))


def effect(name: str, d: Description | None = None, **numbers: Any) -> Description:
    """Return a robot with an effect."""
    return replace(d or robot(), effects=((name, numbers),))


def closed(
    kind: str, a: str = "tool", b: str = "cart", *, turn: np.ndarray = UPRIGHT, d: Description | None = None
) -> Description:
    """Return a robot with a closure whose author's axes are turned."""
    d = d or robot()
    translations, rotation = CLOSURES.get(kind, ((), "free"))
    poses = poses_at(d, d.home)
    frame_b = inverse(poses[b]) @ poses[a] @ AT
    if rotation == "perpendicular":
        frame_b = turned(frame_b, np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
    word = kind if kind in ("revolute", "prismatic", "cylindrical", "universal", "planar") else "rows"
    loop = Closure("loop", word, a, AT, b, frame_b, translations, rotation, turn=turn)
    return replace(d, closures=(loop,))


def coupled(name: str, *terms: tuple[str, float], offset: float = 0.0) -> Description:
    """Return the robot with a coupling."""
    return robot(couplings=(Coupling(name, terms, offset),))


def renamed(d: Description, old: str, new: str) -> Description:
    """Return a robot with another name of a link, joint or closure."""
    names = {old: new}
    of = {one: names.get(one, one) for one in (*(x.name for x in d.links), *(x.name for x in d.joints))}
    return replace(
        d,
        links=tuple(replace(one, name=of[one.name]) for one in d.links),
        joints=tuple(
            replace(one, name=of[one.name], parent=of[one.parent], child=of[one.child]) for one in d.joints
        ),
        closures=tuple(
            replace(one, name=names.get(one.name, one.name), link_a=of[one.link_a], link_b=of[one.link_b])
            for one in d.closures
        ),
    )


def bent(*terms: tuple[str, float], of: tuple[tuple[str, float], ...], powers: int = 1) -> Description:
    """Return the robot with a coupling "gear" that a curve bends; `powers`: how many from the second."""
    curve = Curve(of, tuple(0.4 / n for n in range(1, powers + 1)), 0.2)
    return robot(couplings=(Coupling("gear", terms, 0.5, curve=curve),))


LEVEL = {"level": {"two": 5.0}}
SPRING = {"stiffness": {"two": 5.0}}
POWERS = {"coefficients": {"one": [1.0, -2.0, 3.0]}}
BALL_REST = {"two": [0.6, 0.0, 0.0, 0.8]}
TENDON: dict[str, Any] = {
    "arms": {"one": {"rope": 0.5}, "rail": {"rope": 2.0, "belt": -1.0}}, "stiffness": {"rope": 5.0},
    "damping": {"belt": 2.0}, "friction": {"rope": 0.5}, "lower": {"rope": -0.1}, "upper": {"rope": 0.2},
}  # fmt: skip
BALL_FIRST = replace(
    effect(
        "ball_spring", joint("one", kind="spherical", home=HOMES["spherical"]), stiffness={"one": 5.0},
        rest={"one": BALL_REST["two"]},
    ), links=link("arm", **WEIGHTLESS).links, motors=("two",),
)  # fmt: skip
SLIDE_NEXT = tuple(replace(one, kind="prismatic") if one.name == "two" else one for one in BALL_FIRST.joints)
OVER_PULLEYS: dict[str, Any] = {
    "ends": {"rope": ["base", "arm", "cart", "tool"]}, "stiffness": {"rope": 5.0},
    "shares": {"rope": [0.5, 0.0, 1.0]},
    "points": {"rope": [[0, 0, 0.4], [0.2, 0, 0], [0.1, 0.1, 0], [0.3, 0, 0.1]]},
}  # fmt: skip
BUSHING: dict[str, Any] = {
    "ends": {"mount": ["arm", "tool"]},
    "frames": {"mount": [[0.1, 0, 0.2, 0, 0.6, 0, 0.8], [0, 0, 0, 0, 0, 0, 1]]},
    "torque_stiffness": {"mount": [1.0, 2.0, 3.0]}, "force_damping": {"mount": [3.0, 2.0, 1.0]},
}  # fmt: skip
LINE: dict[str, Any] = {
    "ends": {"rope": ["base", "tool"], "wire": ["arm", "cart", "tool"]},
    "points": {"rope": [[0, 0, 0.4], [0.2, 0, 0]], "wire": [[0, 0, 0], [0.1, 0, 0.1], [0.1, 0.2, 0]]},
    "stiffness": {"rope": 5.0}, "damping": {"wire": 2.0}, "friction": {"rope": 0.5}, "upper": {"rope": 0.2},
}  # fmt: skip
#: By name: the element that a line on its loss has to name, and the robot.
FEATURES: dict[str, tuple[str, Description]] = {
    "nothing": ("", robot()),
    **{f"{kind} joint": ("two", joint(kind=kind)) for kind in HOMES},
    **{f"home of a {kind} joint": ("two", joint(kind=kind, home=HOMES[kind])) for kind in HOMES},
    "fixed joint": ("two", joint(kind="fixed")),
    "lower limit": ("two", joint(lower=-1.0)),
    "upper limit": ("two", joint(upper=1.0)),
    "limits of a slide": ("rail", joint("rail", lower=-1.0, upper=2.0)),
    "equal limits": ("two", joint(lower=0.5, upper=0.5)),
    "crossed limits": ("two", robot(crossed={"two": (1.0, -1.0)})),
    "speed limit": ("two", joint(velocity=2.0)),
    "speed limit of zero, none": ("two", joint(velocity=0.0)),
    "effort limit": ("two", joint(effort=3.0)),
    "effort limit of a motor": ("one", joint("one", effort=3.0)),
    "effort limit of zero, none": ("one", joint("one", effort=0.0)),
    "viscous friction": ("two", joint(damping=0.5)),
    "dry friction": ("two", joint(friction=0.5)),
    "rotor": ("two", joint(rotor_inertia=0.01)),
    "geared rotor": ("two", joint(rotor_inertia=0.01, gear_ratio=-20.0)),
    "gear without rotor": ("two", joint(gear_ratio=20.0)),
    **{f"viscous friction, {kind}": ("two", joint(kind=kind, damping=0.5)) for kind in SEVERAL},
    **{f"dry friction, {kind}": ("two", joint(kind=kind, friction=0.5)) for kind in SEVERAL},
    **{f"rotor, {kind}": ("two", joint(kind=kind, rotor_inertia=0.5)) for kind in SEVERAL},
    **{f"gear, {kind}": ("two", joint(kind=kind, gear_ratio=2.0)) for kind in SEVERAL},
    **{f"position limit, {kind}": ("two", joint(kind=kind, upper=0.5)) for kind in SEVERAL},
    **{f"speed limit, {kind}": ("two", joint(kind=kind, velocity=0.5)) for kind in SEVERAL},
    **{f"effort limit, {kind}": ("two", joint(kind=kind, effort=0.5)) for kind in SEVERAL},
    "spring": ("two", effect("spring", **SPRING)),
    "spring with a rest": ("two", effect("spring", **SPRING, rest={"two": 0.3})),
    "spring away from home": ("one", effect("spring", stiffness={"one": 5.0}, rest={"one": 0.5})),
    "spring of a slide": ("rail", effect("spring", stiffness={"rail": 5.0}, rest={"rail": 0.5})),
    "spring, continuous": ("two", effect("spring", joint(kind="continuous"), **SPRING)),
    "damper": ("two", effect("damper", coefficient={"two": 5.0})),
    "damper over friction": ("two", effect("damper", joint(damping=1.0), coefficient={"two": 5.0})),
    "coulomb level": ("two", effect("coulomb_friction", **LEVEL)),
    "coulomb width": ("two", effect("coulomb_friction", joint(friction=0.5), width=0.01)),
    "coulomb over friction": ("two", effect("coulomb_friction", joint(friction=0.5), **LEVEL)),
    "stribeck friction": (
        "two", effect("stribeck_friction", **LEVEL, static={"two": 6.0}, speed={"two": 0.1}, width=0.01),
    ),
    "directed friction": ("two", effect("directed_friction", forward={"two": 3.0}, backward={"two": 1.0})),
    "load friction": ("two", effect("load_friction", radial={"two": 0.01}, normal={"rail": 0.1}, width=0.02)),
    "gear efficiency": ("two", effect("gear_efficiency", efficiency={"one": 0.8}, back={"one": -0.1})),
    "DC motor": ("two", effect("dc_motors", torque_constant={"one": 0.1}, resistance={"one": 0.5})),
    "stop": (
        "two", effect("stop", stiffness={"two": 9.0}, damping=2.0, lower={"two": -1.0}, upper={"two": 1.0}),
    ),
    "ground contact": (
        "tool", effect("ground_contact", points={"tool": [[0.0, 0.0, -0.1]]}, stiffness=1e4, friction=0.5),
    ),
    **{
        f"damper, {kind}": ("two", effect("damper", joint(kind=kind), coefficient={"two": 5.0}))
        for kind in SEVERAL
    },
    "coulomb level, spherical": ("two", effect("coulomb_friction", joint(kind="spherical"), **LEVEL)),
    "polynomial spring": ("one", effect("polynomial_spring", **POWERS)),
    "polynomial spring with a rest": ("one", effect("polynomial_spring", **POWERS, rest={"one": 0.5})),
    "polynomial damper": ("one", effect("polynomial_damper", **POWERS)),
    "polynomial damper, spherical": (
        "two", effect("polynomial_damper", joint(kind="spherical"), coefficients={"two": [0.0, 2.0]}),
    ),
    "ball spring": ("two", effect("ball_spring", joint(kind="spherical"), **SPRING)),
    "ball spring with a rest": (
        "two", effect("ball_spring", joint(kind="spherical"), **SPRING, rest=BALL_REST),
    ),
    "ball spring away from home": (
        "two",
        effect(
            "ball_spring", joint(kind="spherical", home=HOMES["spherical"]), **SPRING, rest=BALL_REST,
        ),
    ),
    "tendons": ("rope", effect("tendons", **TENDON)),
    "tendons with a width": ("rope", effect("tendons", **TENDON, width=0.1)),
    "tendons named as joints": (
        "a::b",
        effect(
            "tendons", renamed(robot(), "two", "a::b"), arms={"rail": {"a::b": 2.0}, "one": {"two": 1.0}},
            stiffness={"a::b": 1.0, "two": 2.0},
        ),
    ),
    "gravity compensation": ("tool", effect("gravity_compensation", fraction={"tool": 0.5, "arm": 1.0})),
    "line springs": ("rope", effect("line_springs", **LINE)),
    "line springs over pulleys": ("rope", effect("line_springs", **OVER_PULLEYS)),
    "line springs with a width": ("rope", effect("line_springs", **LINE, width=0.1)),
    "line spring, massless link": (
        "arm", effect("line_springs", link("arm", **WEIGHTLESS), **LINE),
    ),
    "lines named as links": (
        "a::b",
        effect(
            "line_springs", renamed(robot(), "tool", "a::b"), ends={"a::b": ["base", "a::b"]},
            points={"a::b": [[0, 0, 0.4], [0.2, 0, 0]]}, stiffness={"a::b": 5.0},
        ),
    ),
    "gravity compensation in a loop": (
        "loop",
        closed("prismatic", d=effect("gravity_compensation", fraction={"tool": 0.5, "cart": 1.0})),
    ),
    "ball before a hinge": ("arm", replace(BALL_FIRST, effects=())),
    "ball spring in other axes": ("", replace(BALL_FIRST, joints=SLIDE_NEXT)),
    "bushings": ("mount", effect("bushings", **BUSHING)),
    "bushing, massless link": ("arm", effect("bushings", link("arm", **WEIGHTLESS), **BUSHING)),
    "payload": ("tool", effect("payload", link="tool", mass=1.0, com=[0.1, 0.0, 0.0])),
    "payload on a renamed link": (
        "a::b", effect("payload", renamed(robot(), "tool", "a::b"), link="a::b", mass=1.0),
    ),
    'line spring on the link "world"': (
        "world",
        effect(
            "line_springs", renamed(robot(), "tool", "world"), ends={"rope": ["base", "world"]},
            points={"rope": [[0, 0, 0.4], [0.2, 0, 0]]}, stiffness={"rope": 5.0},
        ),
    ),
    "bent coupling": ("gear", bent(("two", 2.0), ("one", 1.0), of=(("one", 1.5),), powers=3)),
    "bent coupling of two": ("gear", bent(("two", 2.0), of=(("one", 1.0), ("rail", 2.0)))),
    "bent coupling of its own": ("gear", bent(("two", 2.0), ("one", 1.0), of=(("two", 1.0),))),
    "bent coupling, order six": ("gear", bent(("two", 2.0), of=(("one", 1.0),), powers=5)),
    **{f"closure {kind}": ("loop", closed(kind)) for kind in CLOSURES},
    "closure without a row": ("loop", closed("none")),
    "closure from the base": ("loop", closed("revolute", "base", "tool")),
    "closure to the base": ("loop", closed("universal", "tool", "base")),
    "closure at a massless end": ("", closed("spherical", d=link(**WEIGHTLESS))),
    "massless end on the base": ("", closed("spherical", "base", "tool", d=link(**WEIGHTLESS))),
    **{
        f"author's axes, {kind}": ("loop", closed(kind, turn=CYCLIC))
        for kind in ("fixed", "spherical", "revolute", "prismatic", "universal", "rows_xz_parallel")
    },
    "oblique axes, revolute": ("loop", closed("revolute", turn=OBLIQUE)),
    "oblique axes, rows_x_fixed": ("loop", closed("rows_x_fixed", turn=OBLIQUE)),
    "mimic": ("two", coupled("two", ("two", 1.0), ("one", -2.0))),
    "mimic with an offset": ("two", coupled("two", ("two", 1.0), ("one", -2.0), offset=0.5)),
    "coupling with a name": ("gear", coupled("gear", ("two", 4.0), ("rail", -2.0), offset=0.5)),
    "coupling of three": ("gear", coupled("gear", ("two", 1.0), ("one", -2.0), ("rail", 3.0), offset=0.5)),
    "coupling of one": ("gear", coupled("gear", ("two", 2.0), offset=0.5)),
    "coupling with a zero": ("two", coupled("two", ("one", 0.0), ("two", 1.0), offset=0.5)),
    "limits in a loop": ("one", closed("spherical", d=joint("one", lower=-1.0, upper=2.0))),
    "spring in a loop": (
        "one", closed("spherical", d=effect("spring", stiffness={"one": 5.0}, rest={"one": 0.5})),
    ),
    "mimic in a loop": (
        "two", closed("spherical", d=coupled("two", ("two", 1.0), ("one", -2.0), offset=0.5)),
    ),
    "endless gear": (
        "two", replace(coupled("two", ("two", 1.0), ("one", -2.0)), home={"one": (3.5,), "two": (7.0,)}),
    ),
    "floating base": ("", robot(base="floating")),
    "home of a floating base": ("", robot(base="floating", base_home=(1.0, 2.0, 3.0, 0.0, 0.6, 0.0, 0.8))),
    "usual gravity": ("", robot(gravity=(0.0, 0.0, -9.81))),
    "other gravity": ("", robot(gravity=(1.0, 2.0, -1.62))),
    "no gravity": ("", robot(gravity=(0.0, 0.0, 0.0))),
    "no motor": ("", robot(motors=())),
    "motors in another order": ("", robot(motors=("two", "one"))),
    "link without mass": ("tool", link(**WEIGHTLESS)),
    "link without mass that carries": ("arm", link("arm", **WEIGHTLESS)),
    "base without mass": ("base", link("base", **WEIGHTLESS)),
    "point mass": ("tool", link(inertia=ZERO)),
    "inertia without mass": ("tool", link(mass=0.0)),
    "inertia that no body has": ("tool", link(inertia=np.diag([0.1, 0.1, 1.0]))),
    "added body": ("tool", robot(loads=(Load("tool", 0.5, np.zeros(3), ZERO, 1.0, np.zeros(3), INERTIA),))),
    "name with a colon": ("a::b", renamed(robot(), "tool", "a::b")),
    "name with other letters": ("Ä /", renamed(robot(), "tool", "Ä /")),
    "link named as a joint": ("one", renamed(robot(), "tool", "one")),
    "closure named as a joint": ("one", renamed(closed("revolute"), "loop", "one")),
    "link named world": ("world", renamed(robot(), "tool", "world")),
    "base named world": ("world", renamed(robot(), "base", "world")),
    "robot without a name": ("", robot(name="")),
}  # fmt: skip
