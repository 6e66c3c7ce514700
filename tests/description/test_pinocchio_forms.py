"""Every row of the tables of Pinocchio's forms on the page, as models: read, noted or refused as it says."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description.pin_model import read_model
from hybridyn.errors import ModelError
from tests.description.reading import holds
from tests.support.comparing import refused
from tests.support.snippets import ROOT

RX, S = pin.JointModelRX(), pin.JointModelSpherical()
UNIVERSAL = pin.JointModelUniversal(np.eye(3)[0], np.eye(3)[1])
AT = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))


def model(*joints: pin.JointModel, **numbers: Any) -> pin.Model:
    """Return a chain of joints with bodies, and numbers of its freedoms."""
    out, tip = pin.Model(), 0
    for number, joint in enumerate(joints or (pin.JointModelRX(), pin.JointModelSpherical())):
        tip = out.addJoint(tip, joint, AT, f"j{number}")
        out.appendBodyToJoint(tip, pin.Inertia.Random(), AT)
        out.addBodyFrame(f"body{number}", tip, pin.SE3.Identity(), 0)
    for name, value in numbers.items():
        getattr(out, name)[:] = value
    return out


def composite(*joints: pin.JointModel) -> pin.JointModel:
    """Return joints as one."""
    out = pin.JointModelComposite(len(joints))
    for joint in joints:
        out.addJoint(joint, AT)
    return out


def mimic(factor: float) -> pin.Model:
    """Return two hinges, of which the second follows the first."""
    return pin.transformJointIntoMimic(model(pin.JointModelRX(), pin.JointModelRX()), 1, 2, factor, 0.3)


def constraint(make: Callable[..., Any], **stated: Any) -> Callable[[], dict[str, Any]]:
    """Return the arguments of a model with a constraint between its tip and the world."""

    def given() -> dict[str, Any]:
        own = model(*[pin.JointModelRX()] * 3)
        out = make(own, 3, pin.SE3.Identity(), 0, pin.SE3.Identity())
        out.name = "c"
        for name, value in stated.items():
            call = getattr(out, name)
            call(value) if callable(call) else setattr(out, name, value)
        return {"model": own, "constraint_models": out}

    return given


def rigid(kind: pin.ContactType) -> Callable[..., pin.RigidConstraintModel]:
    """Return the maker of a rigid constraint."""
    return lambda own, *ends: pin.RigidConstraintModel(kind, own, *ends)


def named(**posture: Any) -> pin.Model:
    """Return a hinge with reference configurations and gravity."""
    out = model(pin.JointModelRX())
    for name, q in posture.items():
        out.referenceConfigurations[name] = np.array(q)
    out.gravity.linear = np.array([0.0, 0.0, -2.0])
    return out


def free() -> pin.Model:
    """Return a body that floats."""
    out = pin.Model()
    out.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    out.appendBodyToJoint(1, pin.Inertia.Random(), pin.SE3.Identity())
    return out


def framed() -> pin.Model:
    """Return a hinge with an operational frame."""
    out = model(RX)
    out.addFrame(pin.Frame("tool", 1, 0, AT, pin.FrameType.OP_FRAME))
    return out


def misnumbered() -> pin.Model:
    """Return two joints that hang on each other."""
    out = model(RX, RX)
    out.parents[1] = 2
    return out


def joints(*of: pin.JointModel) -> Callable[[], pin.Model]:
    """Return the maker of a chain of joints."""
    return lambda: model(*of)


def lone(kind: str, *of: pin.JointModel) -> tuple[Any, Any]:
    """Return a case whose first joint has a kind."""
    return joints(*of), {"joints": {"j0": {"kind": kind}}}


POINT, FRAME = pin.PointAnchorConstraintModel, pin.FrameAnchorConstraintModel
#: By the row's first cell: makers of a model, or of the reader's arguments, and what it has.
READ: dict[str, list[tuple[Callable[[], Any], Any]]] = {
    "revolute, prismatic and unbounded joints, aligned or not": [
        lone("revolute", RX),
        lone("prismatic", pin.JointModelPrismaticUnaligned(np.array([0.6, 0.8, 0.0]))),
        lone("continuous", pin.JointModelRUBZ()),
    ],
    "spherical, planar, free-flyer": [
        lone("spherical", S), lone("planar", pin.JointModelPlanar()),
        (joints(RX, pin.JointModelFreeFlyer()), {"joints": {"j1": {"kind": "floating"}}}),
    ],
    "universal, translation, spherical ZYX, composite": [
        (joints(UNIVERSAL), {"joints": {"j0_1": {}, "j0_2": {}}}),
        (joints(pin.JointModelTranslation()), {"joints": {"j0_x": {}, "j0_z": {}}}),
        (joints(pin.JointModelSphericalZYX()), {"joints": {"j0_z": {}, "j0_x": {}}}),
        (
            joints(composite(S, RX, pin.JointModelHX(0.2), pin.JointModelPZ())),
            {"joints": {"j0_1": {}, "j0_4": {}}},
        ),
    ],
    "the only joint on the world, if it is a free-flyer": [
        (free, {"base": "floating"}),
    ],
    "screws (`JointModelH...`), also in composites": [lone("screw", pin.JointModelHY(0.3))],
    "joints that mimic others (`mimic=True`, `transformJointIntoMimic`)": [
        (lambda: mimic(-2.0), {"couplings": [{"terms": (("j1", 1.0), ("j0", 2.0)), "offset": 0.3}]}),
    ],
    "inertias": [(joints(RX), {"links": {"body0": {}}})],
    "body, operational and sensor frames": [(framed, {"links": {"tool": {"mass": 0}}})],
    "position, velocity and effort limits": [
        (lambda: model(RX, velocityLimit=3.0), {"joints": {"j0": {"velocity": 3}}}),
    ],
    "`armature`; `rotorInertia` with `rotorGearRatio` if they agree with the armature or it is zero": [
        (lambda: model(RX, armature=3.0), {"joints": {"j0": {"rotor_inertia": 3}}}),
        (lambda: model(S, armature=3.0), {"joints": {"j0": {"rotor_inertia": 3}}}),
    ],
    "`damping`, `friction`": [
        (lambda: model(S, damping=3.0, friction=2.0), {"joints": {"j0": {"damping": 3, "friction": 2}}}),
    ],
    "`RigidConstraintModel`, point and frame anchors, in any reference frame": [
        *(
            (constraint(make), {"closures": [{"rotation": rotation, "translations": (0, 1, 2)}]})
            for make, rotation in (
                (rigid(pin.ContactType.CONTACT_3D), "free"), (rigid(pin.ContactType.CONTACT_6D), "fixed"),
                (POINT, "free"), (FRAME, "fixed"),
            )
        ),
        (
            constraint(POINT, setBaumgarteCorrectorParameters=pin.BaumgarteCorrectorParameters(1.0, 2.0)),
            {"notes": {"'c' have Baumgarte numbers"}},
        ),
        (
            constraint(FRAME, desired_constraint_offset=np.ones(6)),
            {"notes": {"desired places and motions of constraints 'c'"}},
        ),
        (constraint(POINT, setCompliance=np.ones(3)), {"notes": {"drops the compliance of constraints 'c'"}}),
    ],
    "limits and friction of joints among the constraint models": [
        (
            lambda: {"model": model(RX), "constraint_models": pin.JointLimitConstraintModel(model(RX), [1])},
            {"closures": [], "notes": {"are limits or friction of joints"}},
        )
    ],
    "`gravity`, `referenceConfigurations`": [
        (lambda: named(home=[0.3]), {"gravity": (0, 0, -2), "home": {"j0": (0.3,)}}),
    ],
}  # fmt: skip
REFUSED: dict[str, list[tuple[Callable[[], Any], str]]] = {
    "ellipsoid and spline joints; a mimic with the factor 0": [
        (joints(pin.JointModelEllipsoid(1.0, 2.0, 3.0)), "moves on an ellipsoid"),
        (lambda: mimic(0.0), "with a factor of 0"),
    ],
    "rotors of joints with several freedoms, armature and dry friction of those that are no ball; damping, "
    "friction or armature that differs among their freedoms": [
        (lambda: model(S, rotorInertia=0.1), "rotorInertia of a joint with several freedoms"),
        (lambda: model(pin.JointModelPlanar(), friction=0.1), "friction of a joint with several freedoms"),
        (lambda: model(S, damping=np.arange(3.0)), "different damping"),
    ],
    "point anchors that move (`desired_constraint_velocity` or `..._acceleration` not zero)": [
        (constraint(POINT, desired_constraint_velocity=np.ones(3)), "is not zero"),
    ],
    "contacts among the constraint models": [
        (
            lambda: {
                "model": model(), "constraint_models": pin.PointContactConstraintModel(model(), 2, AT),
            },
            "which closes no loop",
        )
    ],
    "numbers that are not finite, negative masses, placements that are not rigid motions, home "
    "configurations without unit quaternions": [
        (lambda: model(RX, armature=np.nan), "finite numbers"),
        (lambda: {"model": model(S), "home": [0.0, 0.0, 0.0, 2.0]}, "no unit vector"),
    ],
    "joints with a smaller number than their parents": [(misnumbered, "does not come before it")],
}  # fmt: skip


def page(heading: str) -> list[str]:
    """Return the first cells of a table on the page."""
    text = (ROOT / "docs" / "pinocchio.md").read_text().partition(f"## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [re.split(r"(?<!\\)\|", line)[1].strip() for line in lines][1:]


def test_each_row_of_the_page_has_its_models() -> None:
    assert page("What is read") == [*READ]
    assert page("What is refused") == [*REFUSED]


def arguments(made: Any) -> dict[str, Any]:
    """Return the reader's arguments."""
    return made if isinstance(made, dict) else {"model": made}


@pytest.mark.parametrize("form", READ)
def test_it_is_read(form: str) -> None:
    for make, expected in READ[form]:
        robot = read_model(**arguments(make()))
        found = {name: tuple(getattr(robot, name)) for name in ("joints", "links") if name in expected}
        for name, value in expected.items():
            holds(found.get(name, getattr(robot, name)), value)


@pytest.mark.parametrize("form", REFUSED)
def test_it_is_refused(form: str) -> None:
    for make, words in REFUSED[form]:
        refused(lambda make=make: read_model(**arguments(make())), ModelError, words)
