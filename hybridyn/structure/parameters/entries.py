"""Parameters by name: "mass:LINK", "position:JOINT", ..., and the numbers of a description that they set."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ...description.names import did_you_mean
from ...description.records import LOAD_FRICTION, Description
from ...errors import ModelError
from ...extensions import Extension, added, every_name, running
from ...spatial import Array, slices
from .slots import Slot, check_load, check_one, values_of
from .xacro import XacroArguments

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
    **{
        f"spring_{field}": ("springs", "spring on the joint", field, (field,), ((),))
        for field in ("stiffness", "rest")
    },
    **{
        f"load_friction_{word}": ("load_friction", "load friction on the joint", word, (word,), ((),))
        for word in LOAD_FRICTION
    },
    "gear_efficiency": ("gears", "gear with losses at the motor", "efficiency", ("efficiency",), ((),)),
    "gear_back": ("gears", "gear with losses at the motor", "back", ("back",), ((),)),
    **{PAYLOAD + kind: ("loads", "payload on the link", *where) for kind, where in _OF_LINKS.items()},
}
#: What follows the name of a closure: its frame on the predecessor and on the successor.
_SIDES = {"predecessor": "frame_a", "successor": "frame_b"}
#: Kinds of parameters, before the colon.
KINDS = (*_FRAMED, *_FIELDS)


def entry_of(description: Description, name: str) -> Entry:
    """Return the parameter of a name.

    Args:
        description: The robot's description.
        name: "mass:LINK", "centre:LINK" or "inertia:LINK" (about the centre of mass: xx, xy, xz, yy, yz,
            zz); "position:JOINT", "rotation:JOINT" (roll, pitch, yaw) or "placement:JOINT" (both), also of
            "CLOSURE/predecessor" and "CLOSURE/successor"; "offset:COUPLING"; "viscous_friction:JOINT" and
            "coulomb_friction:JOINT", the coefficients in the robot's files; "spring_stiffness:JOINT" and
            "spring_rest:JOINT"; "load_friction_radial:JOINT", and so "axial", "tilt" and "normal";
            "gear_efficiency:MOTOR" and "gear_back:MOTOR"; "payload_mass:LINK", "payload_centre:LINK" and
            "payload_inertia:LINK", those of the payload on a link.

    Raises:
        ModelError: The name has another form, or there is no such link, joint, closure, coupling, spring or
            payload.
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
    if kind in _FIELDS:
        table, what, field, labels, places = _FIELDS[kind]
        check_one(name, of, [record.name for record in getattr(description, table)], what)
        if table == "loads":
            check_load(name, description, of)
        return _entry(name, labels, [Slot(table, of, field, at) for at in places])
    labels, places, numbers, own = _FRAMED[kind]
    table, record, field = _frame_of(description, name, of)
    return _entry(name, labels, [Slot(table, record, field, at) for at in places], numbers, own)


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


def _entry(
    name: str,
    labels: tuple[str, ...],
    slots: Sequence[Slot],
    numbers: Callable[[Array], Numbers] = _copied,
    own: Callable[[Array], Array] = _same,
) -> Entry:
    """Return a parameter; a single number is called like the parameter."""
    full = (name,) if len(labels) == 1 else tuple(f"{name}.{label}" for label in labels)
    return Entry(name, full, tuple(slots), numbers, own)


def of_xacro(arguments: XacroArguments) -> Entry:
    """Return the parameter whose numbers are arguments of a xacro file."""
    name = ", ".join(arguments.names)
    return Entry(name, arguments.names, arguments.slots, arguments.numbers, arguments.own)


def _check_owners(entries: Sequence[Entry]) -> None:
    """Raise if two parameters set the same number, or a link's numbers and those of its payload."""
    owner: dict[Slot, str] = {}
    for entry in entries:
        for slot in entry.slots:
            if slot in owner:
                raise ModelError(
                    f"parameters '{owner[slot]}' and '{entry.name}' both set {slot}", element=entry.name
                )
            owner[slot] = entry.name
    both = {slot.name for slot in owner if slot.table == "loads"}
    for slot, name in owner.items():
        if slot.table == "links" and slot.name in both:
            raise ModelError(
                f"parameter '{name}': link '{slot.name}' has parameters of its payload, which are part "
                "of its numbers: name one of both",
                element=slot.name,
            )


class Parameters:
    """The parameters of a model, in order.

    Attributes:
        names: What was asked for, in order.
        entries: The parameters.
        labels: Name of each number.
        slots: The slots that they set, each once.
        arguments: Those of the robot's xacro file, or None.
        nominal: The numbers in the robot's description, shape (size,).
    """

    def __init__(self, description: Description, names: Sequence[str | Slot]) -> None:
        """Find the parameters in a description.

        Args:
            description: The robot's description.
            names: Names as `entry_of` takes them, slots, and arguments of the robot's xacro file. These stand
                together, where the first of them is named.

        Raises:
            ModelError: A name is unknown, or two parameters set the same number.
        """
        self.names = tuple(names)
        arguments = [name for name in names if isinstance(name, str) and ":" not in name]
        xacro = [XacroArguments(description, arguments)] if arguments else []
        self.arguments = next(iter(xacro), None)
        self.entries = tuple(
            _entry(str(name), ("value",), [name]) if isinstance(name, Slot)
            else entry_of(description, name) if ":" in name
            else of_xacro(xacro[0])
            for name in names
            if name not in arguments[1:]
        )  # fmt: skip
        self.labels = tuple(label for entry in self.entries for label in entry.labels)
        self._at = slices(entry.size for entry in self.entries)
        self.slots = tuple(slot for entry in self.entries for slot in entry.slots)
        _check_owners(self.entries)
        held = iter(values_of(description, self.slots))
        parts = [entry.own(np.array([next(held) for _ in entry.slots])) for entry in self.entries]
        self.nominal: Array = np.concatenate([np.zeros(0), *parts])

    @property
    def size(self) -> int:
        """Number of numbers."""
        return len(self.labels)

    def near(self, factor: float) -> Array:
        """Return the numbers of another design, shape (size,): all but those of rotation matrices, scaled."""
        fixed = [entry.of_matrix for entry in self.entries for _ in entry.labels]
        return np.where(np.array(fixed, dtype=bool), 1.0, factor) * self.nominal

    def beside(self, part: float, place: int) -> Array:
        """Return the numbers of a design, shape (size,), in which one coordinate of each position moves.

        Args:
            part: How far, as a part of the largest coordinate.
            place: Which one: 0 for the least, 1 for the one after it.
        """
        out = self.nominal.copy()
        for entry, at in zip(self.entries, self._at, strict=True):
            if entry.origin:
                own = out[at][:3]  # a view
                own[np.argsort(np.abs(own), kind="stable")[place]] += part * np.abs(own).max()
        return out

    def slot_values(self, p: Array) -> Array:
        """Compute the numbers in the slots, shape (T, slots), from parameters, shape (T, size).

        Raises:
            ModelError: A design is not possible.
        """
        values, errors = self.possible(p)
        if errors:
            raise errors[min(errors)]
        return values

    def possible(self, p: Array) -> Numbers:
        """Compute `slot_values` with NaN for designs that are not possible, and these designs' errors."""
        parts, errors = [np.zeros((len(p), 0))], dict[int, ModelError]()
        for entry, at in zip(self.entries, self._at, strict=True):
            values, wrong = entry.numbers(p[:, at])
            parts.append(values)
            errors |= wrong
        return np.concatenate(parts, axis=1), errors

    def vector(self, values: Mapping[str, Any]) -> Array:
        """Return the numbers of all parameters, shape (size,), those left out as in the description.

        Raises:
            ModelError: A name is unknown, or a value has a wrong size.
        """
        out, names = self.nominal.copy(), [entry.name for entry in self.entries]
        for name, given in values.items():
            check_one(name, name, names, "parameter")
            at = self._at[names.index(name)]
            own = np.asarray(given, dtype=float).ravel()
            if own.shape != out[at].shape or not np.isfinite(own).all():
                raise ModelError(
                    f"parameter '{name}' has {len(out[at])} finite numbers, not {given!r}", element=name
                )
            out[at] = own
        return out
