"""The header of a trajectory: which columns describe which joint, link and wrench.

    time                                     [s], strictly increasing
    <joint>/position|velocity|acceleration   a joint with one freedom [m or rad, per s, per s^2]
    <joint>/effort                           [N or N m], of every motor, for the direct model
    <joint>/position/qx ...                  other joints, by their `JointKind.places` and `rates`
    <link>/pose/x|y|z                        some or all: the origin of a link in the root link's frame
    <link>/pose/qx|qy|qz|qw                  its orientation, all components,
    <link>/pose/rx|ry|rz                     or all of these: a unit axis times the angle about it,
    <link>/pose/roll|pitch|yaw               or any of these: fixed-axis angles, as in URDF's rpy
    <link>/pose/zx|zy|zz                     or all of these: where its z axis points; xx .., yx ..
    <link>/pose/distance                     of its origin from that of the root link, or from
    <link>/pose/cx|cy|cz                     this point in the root link's frame
    <link>/velocity/x|y|z|wx|wy|wz           of the link's origin, and angular, in the root link's axes
    <link>/acceleration/x|y|z|wx|wy|wz       classical: the time derivative of that velocity
    <link>@<other>/...                       the same relative to another link and in its axes, or, with
                                             `world`, in the world in which a moving or floating base moves
    <link>/wrench/fx|fy|fz|mx|my|mz          acts on the link, at its origin and in its axes [N, N m]

The rates of roll, pitch and yaw are the rates of the same angles. On a moving or floating base,
the pose of the root link is the pose of the base in the world. A table that names every joint is a *full
state*; other tables name motors, platforms or a mixture, from which the posture is assembled. With efforts,
the only acceleration that is read is that of a moving base, whose motion is prescribed.

Tables of simulations hold a full state, and `<motor>/effort`, `energy/kinetic|potential|total` [J] and
`residual`. The reader skips the latter three, so that a run can be read back.

Tables of results hold `<motor>/effort` (inverse model; of DC motors `<motor>/current` and `<motor>/voltage`
beside it, which the reader skips, too), or `<joint>/acceleration` of every joint
(`<joint>/acceleration/wx` ... by components) and `<root>/acceleration/x` .. `wz` of a floating base (direct
model). Reactions, forces [N] and moments [N m]:

    <root>/reaction/fx|fy|fz|mx|my|mz        of the ground on the root body, about its origin, in its axes
    <module>/reaction/fx ... mz              of a module's base body on the module, about the origin of that
                                             body, in its axes; a module has the name of its first output
    <closure>/wrench/fx ... mz               of a closure on its successor (opposite on its predecessor),
                                             about the origin of the successor's closure frame, in the axes of
                                             the predecessor's
    <coupling>/multiplier                    multiplier of a coupling's equation as written in the file
    <joint>/transmitted/fx ... mz            of a joint on its child, at the joint, in the child's axes
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from ..description.names import did_you_mean
from ..description.records import Description, Joint
from ..errors import TrajectoryError
from .header_faults import faults
from .layout import Layout
from .signals import POSE, RATES, TWIST, WORLD, WRENCH, joint_columns, picked, read_signal

_FORM = re.compile(
    r"(?P<owner>.+)/(?P<quantity>position|velocity|acceleration|effort|pose|wrench)(/(?P<component>\w+))?"
)
_FORMS_ADVICE = (
    "columns are 'time', '<joint>/position|velocity|acceleration', '<link>/pose|velocity|acceleration/...' "
    "and '<link>/wrench/fx' .. 'mz'"
)

ENERGIES = ("energy/kinetic", "energy/potential", "energy/total")
#: Column of a simulated run for its closure residual.
RESIDUAL = "residual"
#: Columns of hybridyn's tables that belong to no joint and no link.
OTHERS = ("time", *ENERGIES, RESIDUAL)
#: What `idm` writes of DC motors beside their efforts, from which it follows.
SUPPLY = ("current", "voltage")


_Columns = dict[str, dict[str, dict[str, int]]]  # owner, quantity, component: column


def read_layout(
    columns: Sequence[str], description: Description, *, motors: Sequence[str], base: str = "fixed",
    file: str | None = None, efforts: bool = False, passive: int = 0,
) -> Layout:  # fmt: skip
    """Determine the meaning of each column, and check that none is missing.

    Args:
        columns: Header of the table.
        motors: Names of its driven joints.
        base: "fixed", "moving" or "floating".
        file: Path of the table, for messages.
        efforts: Whether the caller reads `<motor>/effort` of every motor, and no accelerations; if not,
            columns of efforts are an error.
        passive: Number of joints without a motor that may be given, too, since motors leave freedoms open.

    Raises:
        TrajectoryError: A column is unknown, a needed one is missing, or columns contradict each other.
    """
    layout = _layout_of(columns, description, base, file, efforts)
    if layout.efforts and not efforts:
        joint = next(iter(layout.efforts))
        raise TrajectoryError("efforts are not an input here", file=file, column=f"{joint}/effort")
    movable = [joint.name for joint in description.joints if joint.kind != "fixed"]
    for column, message in faults(layout, movable, motors, description.root, base, passive, efforts):
        raise TrajectoryError(message, file=file, column=column)
    return layout


def _layout_of(
    columns: Sequence[str], description: Description, base: str, file: str | None, efforts: bool
) -> Layout:
    """Determine the meaning of each column, one by one."""
    joints = {joint.name: joint for joint in description.joints}
    of_joints, of_links = _sorted_columns(columns, joints, description, file)
    wanted = RATES[:1] if efforts else RATES
    of_base = RATES if base == "moving" else wanted
    return Layout(
        file=file,
        time=columns.index("time") if "time" in columns else None,
        joints={
            name: read_signal(
                name, joints[name], given, file, wanted, endless=name in description.endless_gears
            )
            for name, given in of_joints.items()
            if given.keys() - {"effort"}
        },
        poses={
            key: read_signal(key, None, given, file, of_base if key == description.root else wanted)
            for key, given in of_links.items()
            if given.keys() - {"wrench"}
        },
        wrenches={
            link: picked(given["wrench"], WRENCH, f"{link}/wrench", f"a wrench on '{link}'", file)
            for link, given in of_links.items()
            if "wrench" in given
        },
        efforts={
            name: given["effort"][""]
            for name, given in of_joints.items()
            if "effort" in given
            and (efforts or RESIDUAL not in columns)  # those of simulated runs are outputs
        },
        full_state=all(
            of_joints.get(joint.name, {}).keys() - {"effort"}
            for joint in description.joints
            if joint.kind != "fixed"
        ),
    )


def acceleration_columns(description: Description, joints: Iterable[str], base: str) -> list[str]:
    """Return the columns of accelerations, in the order of the spanning tree; a prescribed base has none.

    Args:
        joints: Names of the movable joints in order; a name that is no joint's is that of the base.
        base: "fixed", "moving" or "floating".
    """
    kinds = {joint.name: joint.kind for joint in description.joints}
    out = [f"{description.root}/acceleration/{name}" for name in TWIST] if base == "floating" else []
    for joint in joints:
        if joint in kinds:
            out += joint_columns(joint, kinds[joint], "acceleration")
    return out


def _sorted_columns(
    columns: Sequence[str], joints: dict[str, Joint], description: Description, file: str | None
) -> tuple[_Columns, _Columns]:
    """Sort columns by owner: joint, quantity, component; and link, quantity, component."""
    links = {link.name for link in description.links}
    base_in_world = f"{description.root}@{WORLD}" if WORLD not in links else ""
    of_joints: _Columns = {}
    of_links: _Columns = {}
    written = {*OTHERS, *(f"{joint}/{what}" for joint in joints for what in SUPPLY)}
    forms = {column: _FORM.fullmatch(column) for column in columns if column not in written}
    at = {column: index for index, column in enumerate(columns)}
    in_parts = {m["owner"] for m in forms.values() if m and m["quantity"] == "position" and m["component"]}
    for column, match in forms.items():
        if match is None or (match["quantity"] == "effort" and match["component"]):
            hint = _meant(column, joints)
            raise TrajectoryError(f"is not known{hint}; {_FORMS_ADVICE}", file=file, column=column)
        owner, quantity, component = match["owner"], match["quantity"], match["component"] or ""
        of_joint = not component or quantity == "position" or (quantity in RATES and owner in in_parts)
        if wrong := (_wrong_joint if of_joint else _wrong_link)(owner, quantity, joints, links):
            raise TrajectoryError(wrong, file=file, column=column)
        owners = of_joints if of_joint else of_links
        owner = description.root if owner == base_in_world else owner
        if component in owners.setdefault(owner, {}).setdefault(quantity, {}):
            raise TrajectoryError(f"is given twice, as '{owner}/...', too", file=file, column=column)
        owners[owner][quantity][component] = at[column]
    return of_joints, of_links


def _meant(column: str, joints: Iterable[str]) -> str:
    """Return a hint at the column that a letter for the time, a name alone or a wrong word probably means."""
    if column == "t" or column in joints:
        return f" (did you mean '{'time' if column == 't' else f'{column}/position'}'?)"
    ends = (*RATES, "position", "effort")
    return did_you_mean(column, ["time", *(f"{joint}/{end}" for joint in joints for end in ends)])


def _wrong_joint(owner: str, quantity: str, joints: dict[str, Joint], links: set[str]) -> str:
    """Return what is wrong with a column of a joint, or ""."""
    if quantity in ("pose", "wrench"):
        return f"lacks its component: '{owner}/{quantity}/{'|'.join(POSE if quantity == 'pose' else WRENCH)}'"
    if owner not in joints:
        hint = did_you_mean(owner, joints) or (f" ('{owner}' is a link)" if owner in links else "")
        return f"the robot has no joint '{owner}'{hint}"
    return f"joint '{owner}' is fixed" if joints[owner].kind == "fixed" else ""


def _wrong_link(owner: str, quantity: str, joints: dict[str, Joint], links: set[str]) -> str:
    """Return what is wrong with a column of a link, or of a link relative to another one, or ""."""
    link, *others = owner.split("@")
    for name, known in ((link, links), *((other, {*links, WORLD}) for other in others)):
        if name not in known:
            hint = did_you_mean(name, known) or (f" ('{name}' is a joint)" if name in joints else "")
            return f"the robot has no link '{name}'{hint}"
    relative = "@" in owner and quantity == "wrench"
    return (
        f"a wrench acts on one link, in its own axes: '{owner.split('@')[0]}/wrench/...'" if relative else ""
    )
