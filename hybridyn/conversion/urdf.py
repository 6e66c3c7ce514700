"""Write a URDF: links, joints, closures, couplings, transmissions; what it cannot say goes to files beside.

Closures are `<loop>`; couplings are `<mimic>`, or stand in the model file where no joint can follow another.
Plain URDF readers take the spanning tree and skip `<loop>`.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

from ..description.closure_forms import FORMS
from ..description.followers import followers_at_home
from ..description.joint_words import UNIVERSAL, WORDS
from ..description.placement import turned
from ..description.records import Array, Closure, Coupling, Description, Joint, Link
from ..description.rows import to_state
from ..description.shape_files import SIZES, Shape
from ..description.side_cars.model_toml import model_file
from ..description.urdf.loops import DYNAMICS
from ..description.urdf.urdf import INERTIA_ATTRIBUTES, LIMIT, UNLIMITED
from ..joints.kinds import JointKind
from .as_text import Content, angles_of, document, numerals
from .parts import without_screws
from .request import (
    LIMITS,
    USUAL_GRAVITY,
    ConversionRequest,
    Losses,
    Written,
    add_of_several,
    followers_of,
    rows_of,
)


def write_urdf(request: ConversionRequest, losses: Losses) -> Written:
    """Write a robot as URDF."""
    d = without_screws(request.description, losses)
    loops = [_loop(closure, losses) for closure in d.closures]
    mimics, left = followers_of(d.couplings, losses)
    _add_losses(d, losses)
    content = {
        "@name": d.name,
        "link": [_link(link, request.shapes) for link in d.links],
        "joint": [_joint(joint, joint.name in d.endless_gears, mimics.get(joint.name)) for joint in d.joints],
        "loop": loops,
        "transmission": [
            {
                "@name": f"{motor}_transmission", "type": "transmission_interface/SimpleTransmission",
                "joint": {"@name": motor}, "actuator": {"@name": f"{motor}_motor"},
            }
            for motor in d.motors
        ],
    }  # fmt: skip
    followers = [
        Coupling(name, ((name, 1.0), (leader, -factor)), offset)
        for name, (leader, factor, offset) in mimics.items()
    ]
    still = dict.fromkeys(followers_at_home(followers, d.home), (0.0,))  # else they follow when they are read
    return Written(document("robot", content), *_beside(replace(d, home=d.home | still), left))


def _origin(placement: Array) -> Content | None:
    """Return `<origin>`, None for the identity."""
    at = {"@xyz": placement[:3, 3], "@rpy": angles_of(placement[:3, :3])}
    return None if np.array_equal(placement, np.eye(4)) else at


def _link(link: Link, shapes: tuple[Shape, ...]) -> Content:
    moments = zip(INERTIA_ATTRIBUTES, link.inertia[np.triu_indices(3)], strict=True)
    inertial = {
        "origin": {"@xyz": link.com} if link.com.any() else None,
        "mass": {"@value": link.mass},
        "inertia": {f"@{word}": moment for word, moment in moments},
    }
    visuals = [_visual(shape) for shape in shapes if shape.link == link.name]
    has_mass = link.mass or link.inertia.any()
    return {"@name": link.name, "inertial": inertial if has_mass else None, "visual": visuals}


def _visual(shape: Shape) -> Content:
    scale = shape.size if any(factor != 1 for factor in shape.size) else None
    size: Content = (
        {"@size": shape.size} if shape.kind == "box" else {"@filename": shape.file, "@scale": scale}
    )
    if shape.kind in SIZES:
        size = {f"@{word}": number for word, number in zip(SIZES[shape.kind], shape.size, strict=True)}
    colour = shape.colour and {"@name": f"rgba {numerals(shape.colour)}", "color": {"@rgba": shape.colour}}
    return {"origin": _origin(shape.placement), "geometry": {shape.kind: size}, "material": colour}


def _joint(joint: Joint, endless: bool, mimic: tuple[str, float, float] | None) -> Content:
    """Return a joint; a ball is written as a hinge, which the side-car retypes.

    Args:
        endless: Whether it is a gear that turns without limits, which URDF calls continuous.
        mimic: Leader, factor and offset, where it follows another joint.
    """
    kind = JointKind.REVOLUTE if joint.kind is JointKind.SPHERICAL else joint.kind
    kind = JointKind.CONTINUOUS if endless else kind
    required = kind.additive  # other readers require all of their limits, as finite numbers
    bounds = {word: getattr(joint, word) for word in LIMIT}
    limit = {
        f"@{word}": np.clip(bound, -UNLIMITED, UNLIMITED)
        for word, bound in bounds.items() if required or word in ("effort", "velocity")
    }  # fmt: skip
    forces = to_state(DYNAMICS, {"damping": joint.damping, "friction": joint.friction})
    return {
        "@name": joint.name,
        "@type": WORDS[kind].urdf,
        "origin": _origin(joint.placement),
        "parent": {"@link": joint.parent},
        "child": {"@link": joint.child},
        "axis": {"@xyz": joint.axis} if joint.kind.single or joint.kind is JointKind.PLANAR else None,
        "limit": limit if required or to_state(LIMIT, bounds) else None,
        "dynamics": {f"@{word}": force for word, force in forces.items()} or None,
        "rotor_inertia": {"@value": joint.rotor_inertia} if joint.rotor_inertia else None,
        "gear_ratio": {"@value": joint.gear_ratio} if joint.gear_ratio != 1 else None,
        "mimic": mimic and {"@joint": mimic[0], "@multiplier": mimic[1], "@offset": mimic[2] or None},
    }


def _loop(closure: Closure, losses: Losses) -> Content:
    """Return a closure. `losses`: receives one whose axes `<loop>` cannot say."""
    locked = (closure.translations, closure.rotation)
    forms = [kind for kind, form in FORMS.items() if (form.translations, form.rotation) == locked]
    kind = closure.kind if closure.kind in forms else forms[0] if forms else "rows"
    rows, turn = rows_of(closure, losses) if kind == "rows" else (None, closure.turn)
    universal = kind == UNIVERSAL
    at_a, at_b = turned(closure.frame_a, turn.T), turned(closure.frame_b, np.eye(3) if universal else turn.T)
    return {
        "@name": closure.name,
        "@type": kind,
        "@rows": rows,
        "predecessor": {"@link": closure.link_a, "origin": _origin(at_a)},
        "successor": {"@link": closure.link_b, "origin": _origin(at_b)},
        "axis": {"@xyz": turn[:, 2]} if rows is None and FORMS[kind].has_axis else None,
        "axis2": {"@xyz": "0 0 1"} if universal else None,
    }


def _add_losses(d: Description, losses: Losses) -> None:
    for joint in d.joints:
        add_of_several(joint, losses, LIMITS if joint.kind is JointKind.SPHERICAL else LIMITS[:2], ())
    if d.base == "floating":
        losses.add("the base floats, which URDF cannot say: load the file with base='floating'")
        if d.base_home is not None:
            losses.add("pose of the floating base in the home posture")
    if d.gravity is not None and not np.allclose(d.gravity, USUAL_GRAVITY, rtol=0, atol=1e-12):
        losses.add(f"gravity of {numerals(d.gravity)} m/s^2, which URDF cannot say")


def _beside(d: Description, couplings: list[Coupling]) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the notes, and the files beside.

    These are a model file with home, effects, couplings, and that nothing is driven, which URDF cannot say;
    and a side-car that makes balls of hinges.
    """
    notes, effects = [], [name for name, _ in d.effects]
    model = model_file(d, motors=not d.motors, home=True, couplings=couplings, effects=effects)
    files = {".model.toml": model} if model else {}
    if d.closures:
        notes.append("<loop> is read by hybridyn; most other URDF readers skip it")
    if balls := [joint.name for joint in d.joints if joint.kind is JointKind.SPHERICAL]:
        notes.append("ball joints are hinges in the URDF, which the .yaml beside it makes balls again")
        types = json.dumps([WORDS[JointKind.SPHERICAL].gepetto] * len(balls))
        files[".yaml"] = f"joint_name: {json.dumps(balls)}\njoint_type: {types}\n"
    return tuple(notes), files
