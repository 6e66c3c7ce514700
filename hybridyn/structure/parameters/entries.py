"""Parameters by name: "mass:LINK", "position:JOINT", ..., and the numbers of a description that they set."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from ...description.names import did_you_mean
from ...description.records import Description
from ...errors import ModelError
from ...extensions import Extension, added, every_name, running
from ...spatial import Array
from .effect_numbers import EFFECT_NUMBERS, stated_numbers
from .slots import Slot, check_load, check_one, values_of

#: Numbers in slots of each design, shape (T, slots), and the errors of the designs that are not possible.
Numbers = tuple[Array, dict[int, ModelError]]


class Entry(NamedTuple):
    """A parameter: one or several numbers that set slots of a description.

    Attributes:
        name: Its name, such as "mass:upper".
        labels: Name of each of its numbers.
        slots: The slots that it sets.
        numbers: Computes the numbers in the slots, shape (T, slots), from the parameter's, shape (T, size):
            NaN for designs that are not possible, and the errors of these designs.
        own: Computes the parameter's numbers, shape (size,), from those in the slots, shape (slots,).
    """

    name: str
    labels: tuple[str, ...]
    slots: tuple[Slot, ...]
    numbers: Callable[[Array], Numbers]
    own: Callable[[Array], Array]

    @property
    def of_matrix(self) -> bool:
        """Whether it is an entry of a rotation matrix itself, which no other number may change alone."""
        framed = (slot for slot in self.slots if slot.field in ("placement", "frame_a", "frame_b"))
        return self.own is _same and any(slot.index[1] < 3 for slot in framed)

    @property
    def origin(self) -> bool:
        """Whether its first three numbers are the origin of a frame."""
        return [slot.index for slot in self.slots[:3]] == list(_ORIGIN) and self.numbers in (_copied, _placed)

    @property
    def analytic(self) -> bool:
        """Whether `numbers` takes complex parameters."""
        return self.numbers in (_copied, _rotation, _placed)

    @property
    def size(self) -> int:
        """Number of its numbers."""
        return len(self.labels)


def _same(values: Array) -> Array:
    """Return the numbers of a parameter that is its slots."""
    return values


def _copied(values: Array) -> Numbers:
    """Return the numbers in the slots that a parameter is."""
    return values, {}


def _rotation(rpy: Array) -> Numbers:
    """Compute the entries of rotation matrices from roll, pitch and yaw as in URDF, shape (T, 9)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy).T, np.sin(rpy).T
    rows = [
        cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,
        sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,
        -sp, cp * sr, cp * cr,
    ]  # fmt: skip
    return np.stack(rows, axis=1), {}


def _angles(entries: Array) -> Array:
    """Compute roll, pitch and yaw, shape (3,), from the entries of a rotation matrix, shape (9,).

    Roll is that of the matrix turned back by yaw: it is right for any yaw where the pitch is 90 degrees.
    """
    R = entries.reshape(3, 3)
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    yaw = np.arctan2(R[1, 0], R[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]), pitch, yaw])


def _placed(values: Array) -> Numbers:
    """Compute origin and rotation, shape (T, 12), from x, y, z, roll, pitch, yaw, shape (T, 6)."""
    return np.concatenate([values[:, :3], _rotation(values[:, 3:])[0]], axis=1), {}


def _unplaced(entries: Array) -> Array:
    """Compute x, y, z, roll, pitch, yaw, shape (6,), from origin and rotation, shape (12,)."""
    return np.concatenate([entries[:3], _angles(entries[3:])])


_XYZ, _RPY = ("x", "y", "z"), ("roll", "pitch", "yaw")
_UPPER = ("xx", "xy", "xz", "yy", "yz", "zz")
_ORIGIN = tuple((i, 3) for i in range(3))
_AXES = tuple((i, j) for i in range(3) for j in range(3))
_FRAMED = {
    "position": (_XYZ, _ORIGIN, _copied, _same),
    "rotation": (_RPY, _AXES, _rotation, _angles),
    "placement": (_XYZ + _RPY, _ORIGIN + _AXES, _placed, _unplaced),
}
_OF_LINKS = {
    "mass": ("mass", ("mass",), ((),)),
    "centre": ("com", _XYZ, tuple((i,) for i in range(3))),
    "inertia": ("inertia", _UPPER, tuple((i, j) for i in range(3) for j in range(i, 3))),
}
#: Prefix of the parameters of links that are those of the payload on a link.
PAYLOAD = "payload_"
#: Fields of joints, which count with the effect of that name.
OF_EFFECTS = {"viscous_friction": "damping", "coulomb_friction": "friction"}
#: For other kinds than `_FRAMED`: the table and its word in messages, then field, labels and places there.
_FIELDS = {
    **{kind: ("links", "link", *where) for kind, where in _OF_LINKS.items()},
    "offset": ("couplings", "coupling", "offset", ("offset",), ((),)),
    **{kind: ("joints", "joint", field, (kind,), ((),)) for kind, field in OF_EFFECTS.items()},
    **{PAYLOAD + kind: ("loads", "payload on the link", *where) for kind, where in _OF_LINKS.items()},
}
#: Names of efficiencies of gears.
_GEARS = {"gear_efficiency": ("gear_efficiency", "efficiency"), "gear_back": ("gear_efficiency", "back")}
#: Numbers of effects by joint or motor: the effect and its key.
_OF_EFFECTS = _GEARS | {
    f"{effect}_{word}": (effect, word)
    for effect, words in EFFECT_NUMBERS.items()
    for word, of in words.items()
    if not of.shared and effect != "gear_efficiency"
}
#: What has numbers by its own name, in messages, and labels of three numbers.
_NOUNS = {
    effect: f"number of the {noun}"
    for effect, noun in (("tendons", "tendon"), ("line_springs", "line"), ("bushings", "bushing"))
}
_OF_BUSHINGS = {"torque": _RPY, "force": _XYZ}
#: Numbers that all joints of an effect share, which go by its name.
_SHARED = dict.fromkeys(word for words in EFFECT_NUMBERS.values() for word, of in words.items() if of.shared)
#: What follows the name of a closure: its frame on the predecessor and on the successor.
_SIDES = {"predecessor": "frame_a", "successor": "frame_b"}
#: Kinds of parameters, before the colon.
KINDS = (*_FRAMED, *_FIELDS, *_OF_EFFECTS, *_SHARED)


def entry_of(description: Description, name: str) -> Entry:
    """Return the parameter of a name.

    Args:
        description: The robot's description.
        name: "mass:LINK", "centre:LINK" or "inertia:LINK" (about the centre of mass: xx, xy, xz, yy, yz,
            zz); "position:JOINT", "rotation:JOINT" (roll, pitch, yaw) or "placement:JOINT" (both), also of
            "CLOSURE/predecessor" and "CLOSURE/successor"; "offset:COUPLING"; "viscous_friction:JOINT" and
            "coulomb_friction:JOINT", the coefficients in the robot's files; "EFFECT_KEY:JOINT" for the
            numbers of `EFFECT_NUMBERS`, such as "spring_rest:JOINT", "load_friction_static:JOINT" or
            "polynomial_damper_coefficients:JOINT", and "gear_efficiency:MOTOR" and "gear_back:MOTOR";
            "width:EFFECT", "damping:stop" and "height:ground_contact"; "payload_mass:LINK",
            "payload_centre:LINK" and "payload_inertia:LINK", those of the payload on a link.

    Raises:
        ModelError: The name has another form, or there is no such link, joint, closure, coupling, payload or
            number of an effect.
    """
    kind, colon, of = name.partition(":")
    if colon and (made := added("parameters", kind)) is not None:
        out: Entry = made(description, name)
        return out
    if not colon or kind not in KINDS:
        known = every_name("parameters")
        raise ModelError(
            f"there is no parameter '{name}'{did_you_mean(kind, known)}; write KIND:NAME with a kind of "
            f"{', '.join(known)}, or the name of a xacro argument of the robot's file",
            element=name,
        )
    if kind in _OF_EFFECTS or kind in _SHARED:
        return _of_effect(description, name, kind, of)
    if kind in _FIELDS:
        table, what, field, labels, places = _FIELDS[kind]
        check_one(name, of, [record.name for record in getattr(description, table)], what)
        if table == "loads":
            check_load(name, description, of)
        return entry_for(name, labels, [Slot(table, of, field, at) for at in places])
    labels, places, numbers, own = _FRAMED[kind]
    table, record, field = _frame_of(description, name, of)
    return entry_for(name, labels, [Slot(table, record, field, at) for at in places], numbers, own)


def name_of(slot: Slot) -> str:
    """Return the name of the parameter that is a number of an effect."""
    kinds = {number: kind for kind, number in _OF_EFFECTS.items()}
    return f"{kinds.get((slot.table, slot.field), slot.field)}:{slot.name}"


def effect_of(name: str) -> str | None:
    """Return the effect of which a parameter is a number by its name, or None."""
    kind, _, of = name.partition(":")
    return _OF_EFFECTS.get(kind, (of, kind))[0] if kind in _OF_EFFECTS or kind in _SHARED else None


def _of_effect(description: Description, name: str, kind: str, of: str) -> Entry:
    """Return a parameter that is a number of an effect, or several.

    Args:
        name: Its name: its kind, a colon, and `of`.

    Raises:
        ModelError: No effect of the description states it.
    """
    effect, word = _OF_EFFECTS.get(kind, (of, kind))
    found = [(at[1], x) for at, x in stated_numbers(description) if at[::2] == (effect, word)]
    what = _NOUNS.get(effect, f"{effect.replace('_', ' ')} on the joint")
    if kind in _SHARED:
        what = f"stated '{word}' of the effect"
    elif kind in _GEARS:
        what = "gear with losses at the motor" if word == "efficiency" else "gear with 'back' at the motor"
    check_one(name, of, [own for own, _ in found], what)
    value = dict(found)[of]
    if not isinstance(value, Sequence):
        return entry_for(name, (word,), [Slot(effect, of, word)])
    labels = _OF_BUSHINGS.get(word.partition("_")[0], tuple(f"c{i + 1}" for i in range(len(value))))
    return entry_for(name, labels, [Slot(effect, of, word, (i,)) for i in range(len(value))])


def _frame_of(description: Description, name: str, of: str) -> tuple[str, str, str]:
    """Return where a frame is: its table, the joint or closure there, and its field.

    Args:
        name: Name of the parameter, for messages.
        of: "JOINT", "CLOSURE/predecessor" or "CLOSURE/successor".

    Raises:
        ModelError: There is no such joint or closure.
    """
    base, _, side = of.rpartition("/")
    if side in _SIDES:
        check_one(name, base, [c.name for c in description.closures], "closure")
        return "closures", base, _SIDES[side]
    names = [joint.name for joint in description.joints]
    names += [f"{c.name}/{side}" for c in description.closures for side in _SIDES]
    check_one(name, of, names, "joint or side of a closure")
    return "joints", of, "placement"


def checked_parameter(found: Extension) -> Callable[[Description, str], Entry]:
    """Return what finds the parameter that a package adds, from a description and its name.

    Raises:
        ModelError: It is no function.
    """
    if not callable(found.value):
        raise found.refused("parameters", f"is {found.value!r}: make it a function of description and name")
    return partial(_added_entry, found)


def _added_entry(found: Extension, description: Description, name: str) -> Entry:
    """Return a parameter that a package adds.

    Raises:
        ModelError: Its code fails, or what it returns is no `Entry` that computes its slots.
    """
    with running("parameters", found.name, found.package):
        out = found.value(description, name)
        if not isinstance(out, Entry):
            raise TypeError(f"{type(out).__name__} is no Entry")
        own = out.own(np.array(list(values_of(description, out.slots))))
        shapes = np.shape(own), np.shape(out.numbers(np.tile(own, (2, 1)))[0])
    if shapes != (wanted := ((out.size,), (2, len(out.slots)))):
        why = f"returns numbers of shapes {shapes[0]} and {shapes[1]}, not {wanted[0]} and {wanted[1]}"
        raise found.refused("parameters", why)
    return out


def entry_for(
    name: str,
    labels: tuple[str, ...],
    slots: Sequence[Slot],
    numbers: Callable[[Array], Numbers] = _copied,
    own: Callable[[Array], Array] = _same,
) -> Entry:
    """Return a parameter; a single number is called like the parameter."""
    full = (name,) if len(labels) == 1 else tuple(f"{name}.{label}" for label in labels)
    return Entry(name, full, tuple(slots), numbers, own)
