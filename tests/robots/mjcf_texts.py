"""Robots as MJCF texts, one for each way in which MJCF states something."""

import random

HEAD = '<compiler angle="radian"/><option><flag contact="disable" limit="disable"/></option>'


def mjcf(*parts: str, world: str = "", head: str = HEAD) -> str:
    """Return an MJCF text: settings, bodies, other sections."""
    return (
        f'<mujoco model="robot">\n{head}\n<worldbody>\n{world}\n</worldbody>\n'
        + "\n".join(parts)
        + "\n</mujoco>"
    )


BAR = '<inertial pos="{x} .01 0" mass="{m}" fullinertia=".02 .05 .06 .002 -.003 .004"/>'

CHAIN = """<body name="a" pos=".1 .2 .3" quat=".8 .1 -.3 .2"><joint name="a1" axis="1 2 3" ref=".4"/>
<joint name="a2" type="slide" axis="0 1 1" ref="-.2"/><joint name="a3" axis="0 0 1" pos=".1 0 .05" ref=".3"/>
<inertial pos=".1 .01 0" quat=".9 .1 .2 .3" mass="1.5" diaginertia=".02 .05 .06"/>
<body name="b" pos=".3 0 0"><joint name="b1" type="slide" axis="1 0 1"/>
<joint name="b2" axis="1 0 0" pos="0 .1 .2"/>
<joint name="b3" axis="0 1 0" pos="0 .1 .2"/><inertial pos="0 0 .1" mass=".7" diaginertia=".01 .02 .02"/>
<body name="tool" pos="0 .1 .3" euler=".1 .2 .3">
<inertial pos="0 .1 0" mass=".2" diaginertia=".001 .002 .002"/></body>
<body name="c" pos=".2 .1 0"><joint name="c1" axis="0 1 1" pos=".05 0 0"/>
<geom type="box" size=".05 .1 .2" pos=".1 0 0"/>
</body></body></body>"""

DEFAULTS = """<body name="a" pos="0 0 1" euler="30 -20 10"><joint name="a1"/><geom fromto="0 0 0 .3 0 0"/>
<body name="b" pos=".3 0 0" axisangle="0 1 1 25"><joint name="b1" class="wrist" range="-40 60"/>
<geom fromto="0 0 0 .3 .1 0"/>
<frame pos=".3 .1 0" euler="0 0 45"><body name="c" childclass="wrist"><joint name="c1"/>
<geom fromto="0 0 0 .2 0 0"/>
<body name="d" xyaxes="0 1 0 -1 0 0"><joint name="d1" axis="0 1 0" armature=".5"/>
<geom type="sphere" mass="2" pos=".1 0 0"/>
</body></body></frame></body></body>"""

BALLS = (
    """<body name="a" pos="0 0 1"><joint name="a1" type="ball" pos=".1 0 0" damping=".3"/>"""
    + BAR.format(x=0.2, m=2)
    + """
<body name="b" pos=".3 0 0"><joint name="b0" axis="0 0 1" pos="0 .4 0"/><joint name="b1" type="ball"/>"""
    + BAR.format(x=0.1, m=1)
    + """
</body></body>"""
)

FLOATING = (
    '<body name="trunk" pos="0 0 1" euler=".1 .2 .3"><freejoint name="free"/>'
    + BAR.format(x=0.1, m=4)
    + """
<site name="s" pos=".1 0 0"/><body name="leg" pos=".2 0 0"><joint name="hip" axis="0 1 0"/>
<joint name="roll" axis="1 0 0"/>
"""
    + BAR.format(x=0.1, m=1)
    + '<body name="foot" pos="0 0 -.4"><joint name="knee" axis="0 1 0"/>'
    + BAR.format(x=0, m=0.5)
    + """
<site name="f" pos="0 .1 -.2"/></body></body></body>"""
)

TWO_FLOAT = (
    FLOATING
    + '<body name="box" pos="1 0 0"><freejoint name="free2"/><geom type="box" size=".1 .2 .3"/></body>'
)

LOOPS = (
    """<body name="a" pos="0 0 0"><joint name="a1" axis="0 1 0" ref=".2"/>"""
    + BAR.format(x=0.1, m=1)
    + """
<site name="sa" pos=".3 .05 .1" euler=".1 .2 .3"/><body name="b" pos=".4 0 0" euler="0 .3 0">
<joint name="b1" axis="0 1 0"/>
"""
    + BAR.format(x=0.2, m=1)
    + """<joint name="b2" axis="1 0 0" pos=".1 0 0"/></body></body>
<body name="c" pos="1 0 0" euler="0 0 1"><joint name="c1" axis="0 1 0" ref="-.3"/>"""
    + BAR.format(x=0.1, m=1)
    + """
<body name="d" pos=".2 .3 0" euler="1 0 0"><joint name="d1" type="ball" pos="0 .1 0"/>"""
    + BAR.format(x=0.1, m=1)
    + """
<site name="sd" pos=".1 .2 .1" euler=".5 0 .3"/><body name="e" pos="0 .2 0">
<joint name="e1" type="slide" axis="1 1 0" ref=".1"/>
"""
    + BAR.format(x=0.1, m=1)
    + "</body></body></body>"
)

TENDONS = """<tendon><fixed name="t1"><joint joint="a1" coef="2"/><joint joint="e1" coef="-.5"/></fixed>
<fixed name="t2"><joint joint="c1" coef="1.5"/><joint joint="b1" coef=".25"/></fixed></tendon>"""


def loops(equalities: str) -> str:
    """Return a robot with these equalities."""
    return mjcf(TENDONS, f"<equality>{equalities}</equality>", world=LOOPS)


ROBOTS = {
    "chain": mjcf(world=CHAIN),
    "defaults": mjcf(
        """<default><joint axis="0 0 1" damping=".2"/><geom type="capsule" size=".03" density="700"/>
        <default class="wrist"><joint axis="1 0 0" armature=".02" ref="15" frictionloss=".1"/>
</default></default>""",
        world=DEFAULTS,
        head=HEAD.replace("radian", "degree").replace("<compiler", '<compiler eulerseq="ZYx"'),
    ),
    "balls": mjcf(world=BALLS),
    "floating": mjcf(world=FLOATING),
    "two float": mjcf(world=TWO_FLOAT),
    "connect": loops('<connect name="x" body1="b" body2="d" anchor=".1 .2 .3"/>'),
    "connect to world": loops('<connect name="x" body1="b" anchor=".1 .2 .3"/>'),
    "connect of sites": loops('<connect name="x" site1="sa" site2="sd"/>'),
    "weld": loops('<weld name="x" body1="b" body2="e"/>'),
    "weld with a pose": loops(
        '<weld name="x" body1="e" body2="b" relpose=".1 .2 .3 .5 .5 .1 -.3" anchor=".3 .2 .1"/>'
    ),
    "weld of sites": loops('<weld name="x" site1="sd" site2="sa"/>'),
    "joints": loops(
        '<joint name="x" joint1="a1" joint2="c1" polycoef=".1 -2 0 0 0"/>'
        '<joint name="y" joint1="e1" polycoef=".3 0 0 0 0"/>'
    ),
    "tendons": loops(
        '<tendon name="x" tendon1="t1" tendon2="t2" polycoef=".1 3 0 0 0"/><tendon name="y" tendon1="t2"/>'
    ),
    "curves of joints": loops(
        '<joint name="x" joint1="a1" joint2="c1" polycoef=".1 -2 .3 .4 -.2"/>'
        '<joint name="y" joint1="e1" joint2="a1" polycoef=".3 0 0 .7 0"/>'
    ),
    "curves of tendons": loops(
        '<tendon name="x" tendon1="t1" tendon2="t2" polycoef=".1 3 -.5 0 .3"/><tendon name="y" tendon1="t2"/>'
    ),
    "a floating loop": mjcf('<equality><connect name="x" site1="s" site2="f"/></equality>', world=FLOATING),
    "a foot on the ground": mjcf(
        '<equality><connect name="x" body1="foot" anchor="0 0 -.1"/></equality>', world=FLOATING
    ),
}  # fmt: skip


def random_tree(seed: int) -> str:
    """Return a random tree: one to three joints a body, slides, balls, bodies without joints."""
    draw = random.Random(seed)
    count = 0

    def numbers(n: int, size: float = 1.0) -> str:
        return " ".join(f"{draw.uniform(-size, size):.6g}" for _ in range(n))

    def joint() -> str:
        nonlocal count
        count += 1
        kind = draw.choice(["hinge", "hinge", "slide"])
        position = draw.choice(["", f'pos="{numbers(3, 0.3)}"'])
        return f'<joint name="j{count}" type="{kind}" axis="{numbers(3)}" ref="{numbers(1)}" {position}/>'

    def body(depth: int) -> str:
        nonlocal count
        joints = [joint() for _ in range(draw.choice([0, 1, 1, 2, 3]))]
        if draw.random() < 0.15:
            count += 1
            joints.append(f'<joint name="j{count}" type="ball" pos="{numbers(3, 0.2)}"/>')
        shape = draw.choice(
            [
                BAR.format(x=0.1, m=draw.uniform(0.1, 3)),
                f'<geom type="box" size=".1 .2 .3" pos="{numbers(3)}"/>',
            ]
        )
        below = "".join(body(depth + 1) for _ in range(draw.choice([0, 1, 2]) if depth < 3 else 0))
        name = f"b{draw.getrandbits(40)}"
        inside = "".join([*joints, shape, below])
        return f'<body name="{name}" pos="{numbers(3)}" quat="{numbers(4)}">{inside}</body>\n'

    text = body(0)
    return mjcf(world=f'<body name="first" pos="{numbers(3)}">{joint()}{BAR.format(x=0.1, m=1)}{text}</body>')
