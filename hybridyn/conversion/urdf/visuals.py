"""Write visual shapes as `<visual>`."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from ...description.urdf.shapes import Shape
from ..numerals import angles_of, numeral, numerals


def add_visual(link: ET.Element, shape: Shape) -> None:
    """Add a shape to a link."""
    visual = ET.SubElement(link, "visual")
    at = shape.placement
    if not np.array_equal(at, np.eye(4)):
        ET.SubElement(visual, "origin", xyz=numerals(at[:3, 3]), rpy=numerals(angles_of(at[:3, :3])))
    element = ET.SubElement(ET.SubElement(visual, "geometry"), shape.kind)
    if shape.kind == "box":
        element.set("size", numerals(shape.size))
    elif shape.kind == "mesh":
        element.set("filename", shape.file)
        if any(factor != 1 for factor in shape.size):
            element.set("scale", numerals(shape.size))
    else:
        for word, value in zip(("radius", "length"), shape.size, strict=False):
            element.set(word, numeral(value))
    if shape.colour is not None:
        rgba = numerals(shape.colour)
        material = ET.SubElement(visual, "material", name=f"rgba {rgba}")
        ET.SubElement(material, "color", rgba=rgba)
