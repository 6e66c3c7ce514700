"""Robots as SDF texts, and random robots written twice: as URDF and as SDF.

The two texts of a random robot are written from one list of frames by rules of their own: URDF places the
frame of a link at its joint, SDF anywhere.
"""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

INERTIAL = (
    "<inertial><pose>{x} .01 0 .1 .2 .3</pose><mass>{m}</mass><inertia><ixx>.02</ixx><ixy>.002</ixy>"
    "<ixz>-.003</ixz><iyy>.05</iyy><iyz>.004</iyz><izz>.06</izz></inertia></inertial>"
)
WORLD = '<joint name="hold" type="fixed"><parent>world</parent><child>base</child></joint>'

#: Kinds of joints that are drawn; only every fourth joint may be fixed.
KINDS = ("revolute", "prismatic", "continuous", "fixed")


def sdf(*parts: str, version: str = "1.9", name: str = "robot", more: str = "") -> str:
    """Return an SDF text with one model."""
    return (
        f'<sdf version="{version}"{more}>\n<model name="{name}">\n' + "\n".join(parts) + "\n</model>\n</sdf>"
    )


def link(name: str, *parts: str, x: float = 0.1, m: float = 1.0) -> str:
    """Return a link with an inertia."""
    return f'<link name="{name}">{"".join(parts)}{INERTIAL.format(x=x, m=m)}</link>'


def joint(name: str, kind: str, parent: str, child: str, *parts: str, axis: str = "0 0 1") -> str:
    """Return a joint; its axis has no more than a direction where it is a text, and "" leaves it out."""
    about = f"<axis><xyz>{axis}</xyz></axis>" if axis else ""
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f'<joint name="{name}" type="{kind}">{ends}{about}{"".join(parts)}</joint>'


@dataclass
class Twice:
    """A robot written as URDF and as SDF.

    Attributes:
        urdf: The URDF.
        sdf: The SDF.
        motors: Its driven joints.
    """

    urdf: list[str] = field(default_factory=list)
    sdf: list[str] = field(default_factory=list)
    motors: list[str] = field(default_factory=list)


def random_pair(seed: int, version: str) -> Twice:
    """Return a random tree with loops that close at zero, written as URDF and as SDF.

    Args:
        seed: Seed.
        version: Version of SDFormat.
    """
    draw = np.random.default_rng(seed)
    minor = int(version.partition(".")[2])
    links = {"base": pin.SE3.Identity()}  # in URDF, at their joints
    shifts = {"base": pin.SE3.Identity()}  # SDF's frame of the link in URDF's
    rigid = {"base": "base"}  # the body of each link
    texts = Twice()
    texts.urdf.append('<link name="base"/>')
    zero = "<inertial><mass>0</mass><inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia></inertial>"
    texts.sdf.append(f'<link name="base">{zero}</link>{WORLD}')
    for number in range(8):
        parent = str(draw.choice(list(links)))
        name, kind = f"l{number}", str(draw.choice(KINDS[:3] if number % 4 else KINDS))
        if kind == "continuous" and minor < 5:
            kind = "revolute"
        rigid[name] = rigid[parent] if kind == "fixed" else name
        links[name] = links[parent] * pin.SE3.Random()
        shifts[name] = pin.SE3.Random() if draw.random() < 0.6 else pin.SE3.Identity()
        texts.urdf.append(_urdf_link(name, draw, texts, shifts[name], links, shifts, minor))
        axis = draw.normal(size=3)
        axis /= np.linalg.norm(axis)
        numbers = draw.uniform(0.1, 1.0, size=6)
        texts.urdf.append(_urdf_joint(name, kind, parent, links, axis, numbers))
        texts.sdf.append(_sdf_joint(name, kind, parent, links, shifts, axis, numbers, minor, draw))
        if kind != "fixed":
            texts.motors.append(f"j{number}")
    loops = {"fixed": "fixed", "revolute": "revolute", "prismatic": "prismatic", "ball": "spherical"}
    kind = str(draw.choice(["revolute", "ball", "prismatic", "universal"]))
    first = list(links)[1]
    second = next(name for name in reversed(links) if rigid[name] != rigid[first])
    at = links[second] * pin.SE3.Random()
    axis = np.array([0.0, 0.0, 1.0])
    ends = []
    for tag, end in (("predecessor", first), ("successor", second)):
        ends.append(f'<{tag} link="{end}">{_origin(links[end].inverse() * at)}</{tag}>')
    two = '<axis2 xyz="1 0 0"/>' if kind == "universal" else ""
    about = f'<axis xyz="{_text(axis)}"/>' if kind != "ball" else ""
    texts.urdf.append(f'<loop name="loop" type="{loops.get(kind, kind)}">{"".join(ends)}{about}{two}</loop>')
    place = _pose((links[second] * shifts[second]).inverse() * at)
    turn = at.rotation if minor < 5 else np.eye(3)
    abouts = f"<axis><xyz>{_text(turn @ axis)}</xyz></axis>" if kind != "ball" else ""
    abouts += f"<axis2><xyz>{_text(turn[:, 0])}</xyz></axis2>" if kind == "universal" else ""
    cut = "<physics><simbody><must_be_loop_joint>true</must_be_loop_joint></simbody></physics>"
    texts.sdf.append(joint("loop", kind, first, second, f"<pose>{place}</pose>", abouts, cut, axis=""))
    return texts


def _urdf_link(name, draw, texts, shift, links, shifts, minor) -> str:
    """Write a link: its inertia is stated in each format's own frame of the link."""
    at, mass = pin.SE3.Random(), draw.uniform(0.5, 2)
    a, b, c = draw.uniform(0.03, 0.05, size=3)
    moments = f'ixx="{a}" ixy="0.001" ixz="0.002" iyy="{b}" iyz="-0.003" izz="{c}"'
    tensor = "".join(
        f"<{key}>{value}</{key}>"
        for key, value in (pair.split("=") for pair in moments.replace('"', "").split())
    )
    body = f"<mass>{mass}</mass><pose>{_pose(shift.inverse() * at)}</pose><inertia>{tensor}</inertia>"
    world = links[name] * shifts[name]
    pose = f"<pose>{_pose(world)}</pose>"
    if minor >= 7 and draw.random() < 0.5:
        other = str(draw.choice([other for other in links if other != name]))
        pose = f'<pose relative_to="{other}">{_pose((links[other] * shifts[other]).inverse() * world)}</pose>'
    if minor >= 9 and draw.random() < 0.5:
        quaternion = pin.Quaternion(world.rotation).coeffs()
        pose = f'<pose rotation_format="quat_xyzw">{_text(world.translation)} {_text(quaternion)}</pose>'
    texts.sdf.append(f'<link name="{name}">{pose}<inertial>{body}</inertial></link>')
    inertial = f'{_origin(at)}<mass value="{mass}"/><inertia {moments}/>'
    return f'<link name="{name}"><inertial>{inertial}</inertial></link>'


def _urdf_joint(name, kind, parent, links, axis, numbers) -> str:
    number = name[1:]
    limit, about = _numbers(kind, numbers)
    origin = _origin(links[parent].inverse() * links[name])
    ends = f'<parent link="{parent}"/><child link="{name}"/>'
    return (
        f'<joint name="j{number}" type="{kind}">{origin}{ends}<axis xyz="{_text(axis)}"/>'
        + (f"<limit {limit}/><dynamics {about}/>" if kind != "fixed" else "")
        + "</joint>"
    )


def _sdf_joint(name, kind, parent, links, shifts, axis, numbers, minor, draw) -> str:
    """Write a joint; how its pose and axis are expressed is drawn among what the version has."""
    at, number = links[name], name[1:]
    child = at * shifts[name]
    spun = at * pin.SE3(pin.exp3(draw.normal(size=3)), np.zeros(3))  # the frame of the joint, turned anyhow
    frame = spun.rotation.T @ at.rotation @ axis
    pose, expressed = f"<pose>{_pose(child.inverse() * spun)}</pose>", ""
    if minor >= 7 and draw.random() < 0.5:
        upper = links[parent] * shifts[parent]
        pose = f'<pose relative_to="{parent}">{_pose(upper.inverse() * spun)}</pose>'
    if minor < 5:
        frame = at.rotation @ axis
    elif minor < 7 and draw.random() < 0.5:
        frame, expressed = at.rotation @ axis, "<use_parent_model_frame>1</use_parent_model_frame>"
    about = f"<xyz>{_text(2 * frame)}</xyz>{expressed}"
    if minor >= 7 and draw.random() < 0.5:
        other = str(draw.choice(list(links)))
        frame = (links[other] * shifts[other]).rotation.T @ at.rotation @ axis
        about = f'<xyz expressed_in="{other}">{_text(frame)}</xyz>'
    limit, dynamics = (
        "".join(
            f"<{key}>{value}</{key}>"
            for key, value in (pair.split("=") for pair in text.replace('"', "").split())
        )
        for text in _numbers(kind, numbers)
    )
    if minor >= 5:
        dynamics += "<spring_reference>0</spring_reference><spring_stiffness>0</spring_stiffness>"
    about = (
        f"<axis>{about}<limit>{limit}</limit><dynamics>{dynamics}</dynamics></axis>"
        if kind != "fixed"
        else ""
    )
    return joint(f"j{number}", kind, parent, name, pose, about, axis="")


def _numbers(kind: str, numbers: np.ndarray) -> tuple[str, str]:
    lower, upper, velocity, effort, damping, friction = numbers
    position = f'lower="{-lower}" upper="{upper}" ' if kind != "continuous" else ""
    return f'{position}velocity="{velocity}" effort="{effort}"', f'damping="{damping}" friction="{friction}"'


def _origin(at: pin.SE3) -> str:
    rpy = pin.rpy.matrixToRpy(at.rotation)
    return f'<origin xyz="{_text(at.translation)}" rpy="{_text(rpy)}"/>'


def _pose(at: pin.SE3) -> str:
    return f"{_text(at.translation)} {_text(pin.rpy.matrixToRpy(at.rotation))}"


def _text(numbers: np.ndarray) -> str:
    return " ".join(repr(float(x)) for x in numbers)
