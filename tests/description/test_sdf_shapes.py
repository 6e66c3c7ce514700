"""Inertia of SDF's links from their shapes: by integration, and as Drake's parser computes it."""

from pathlib import Path

import numpy as np
import pytest

from hybridyn.description import read
from tests.description.drake_plant import Plant
from tests.description.sdf_texts import sdf
from tests.support.files import save
from tests.support.samples import slow

#: Shapes, and whether a point (in arrays x, y, z) is inside, in a box of these half sizes.
SHAPES = {
    "<box><size>0.2 0.4 0.6</size></box>": (lambda x, y, z: x == x, (0.1, 0.2, 0.3)),
    "<sphere><radius>0.3</radius></sphere>": (lambda x, y, z: x * x + y * y + z * z <= 0.09, (0.3, 0.3, 0.3)),
    "<cylinder><radius>0.2</radius><length>0.7</length></cylinder>": (
        lambda x, y, z: x * x + y * y <= 0.04, (0.2, 0.2, 0.35),
    ),
    "<capsule><radius>0.2</radius><length>0.5</length></capsule>": (
        lambda x, y, z: x * x + y * y + np.maximum(abs(z) - 0.25, 0) ** 2 <= 0.04, (0.2, 0.2, 0.45),
    ),
    "<ellipsoid><radii>0.2 0.3 0.5</radii></ellipsoid>": (
        lambda x, y, z: (x / 0.2) ** 2 + (y / 0.3) ** 2 + (z / 0.5) ** 2 <= 1, (0.2, 0.3, 0.5),
    ),
    "<cone><radius>0.3</radius><length>0.8</length></cone>": (
        lambda x, y, z: np.hypot(x, y) <= 0.3 * (0.5 - z / 0.8), (0.3, 0.3, 0.4),
    ),
}  # fmt: skip
#: Points along each axis of the sum that stands for an integral, and its part of a moment.
GRID, AGAINST_SUM = 80, 5e-3
ROUNDED = 1e-12

COLLISION = '<collision name="c{}">{}<geometry>{}</geometry></collision>'
BOX, BALL, TUBE, _, EGG, CONE = SHAPES
PLACES = (
    "<pose>1 0.2 -0.3 0.4 -0.5 0.6</pose>", '<pose relative_to="f">0.1 0 0 0 0 0.2</pose>', "", "", "", "",
)  # fmt: skip
OF_70 = [(f"{place}<density>70</density>", shape) for place, shape in zip(PLACES, SHAPES, strict=True)]
#: What the inertial states, and the collisions of a link that stands anywhere.
LINKS = {
    "water": ("", [("", BOX)]),
    "one density": ("<density>300</density>", [("", BALL), ("", TUBE)]),
    "mass": ("<mass>7</mass>", [(PLACES[0], BOX), ("", BALL)]),
    "placed": ("", OF_70),
    "densities": ("<density>3</density>", [("", EGG), ("<density>50</density>", CONE)]),
}


def robot(inertial: str, collisions: list[tuple[str, str]]) -> str:
    """Return a robot with one such link."""
    shapes = "".join(COLLISION.format(n, more, shape) for n, (more, shape) in enumerate(collisions))
    return sdf(
        '<link name="a"><pose>0.5 0.4 0.3 0.2 0.1 0</pose>'
        f'<inertial auto="true">{inertial}</inertial>{shapes}</link>',
        '<frame name="f" attached_to="a"><pose>0.3 -0.2 0.1 0.5 0 0.3</pose></frame>', version="1.11",
    )  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_the_inertia_of_a_shape_is_the_sum_over_its_points(shape: str, tmp_path: Path) -> None:
    inside, half = SHAPES[shape]
    steps = [size * ((np.arange(GRID) + 0.5) / GRID * 2 - 1) for size in half]
    grid = np.meshgrid(*steps)
    keep = inside(*grid)
    x, y, z = (axis[keep] for axis in grid)
    volume = len(x) * np.prod([2 * size / GRID for size in half])
    text = robot("<density>1</density>", [("", shape)])
    (link,) = read(save(tmp_path, text, "r.sdf")).links
    assert link.mass == pytest.approx(volume, rel=AGAINST_SUM)
    points = np.stack([x, y, z], axis=1) - link.com
    assert np.abs(points.mean(axis=0)).max() <= AGAINST_SUM * max(half)
    moments = volume / len(x) * np.sum(np.sum(points**2, axis=1)[:, None] - points**2, axis=0)
    np.testing.assert_allclose(np.diag(link.inertia), moments, rtol=2 * AGAINST_SUM)


@pytest.mark.parametrize("name", ["placed", *(slow(name) for name in LINKS if name != "placed")])
def test_the_inertia_of_a_link_is_that_of_drake(name: str, tmp_path: Path) -> None:
    file = save(tmp_path, robot(*LINKS[name]), "r.sdf")
    (link,) = read(file).links
    theirs = Plant(file, "robot").bodies["a"].default_spatial_inertia()
    assert link.mass == pytest.approx(theirs.get_mass(), rel=ROUNDED)
    np.testing.assert_allclose(link.com, theirs.get_com(), atol=ROUNDED)
    about = theirs.CalcRotationalInertia().CopyToFullMatrix3()
    r = link.com
    ours = link.inertia + link.mass * (r @ r * np.eye(3) - np.outer(r, r))
    np.testing.assert_allclose(ours, about, atol=ROUNDED * np.abs(about).max())
