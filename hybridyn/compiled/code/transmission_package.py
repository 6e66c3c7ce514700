"""Generate a ROS 2 package: a transmission of ros2_control around the exported C of a map."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape, quoteattr

from .kernels import literal
from .plain_c import WRITTEN
from .scalars import text_of

PACKAGE_XML = """<?xml version="1.0"?>
<!-- {written}. -->
<package format="3">
  <name>{package}</name>
  <version>0.1.0</version>
  <description>{about}</description>
  <maintainer email="maintainer@example.com">maintainer</maintainer>
  <license>unstated</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <depend>hardware_interface</depend>
  <depend>pluginlib</depend>
  <depend>transmission_interface</depend>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""

PLUGIN_XML = """<!-- {written}. -->
<library path="{package}">
  <class name="{package}/Transmission"
         type="{package}::TransmissionLoader"
         base_class_type="transmission_interface::TransmissionLoader">
    <description>{about}</description>
  </class>
</library>
"""

CMAKE = """# {written}.
cmake_minimum_required(VERSION 3.16)
project({package} C CXX)

find_package(ament_cmake REQUIRED)
find_package(hardware_interface REQUIRED)
find_package(pluginlib REQUIRED)
find_package(transmission_interface REQUIRED)

add_library({package} SHARED src/{package}.cpp src/{name}.c)
target_compile_features({package} PUBLIC cxx_std_17)
set_target_properties({package} PROPERTIES C_STANDARD 99)
target_include_directories({package} PUBLIC
  "$<BUILD_INTERFACE:${{CMAKE_CURRENT_SOURCE_DIR}}/include>"
  "$<BUILD_INTERFACE:${{CMAKE_CURRENT_SOURCE_DIR}}/include/{package}>"
  "$<INSTALL_INTERFACE:include>")
target_link_libraries({package} PUBLIC
  hardware_interface::hardware_interface
  pluginlib::pluginlib
  transmission_interface::transmission_interface)

pluginlib_export_plugin_description_file(transmission_interface {package}.xml)
install(DIRECTORY include/ DESTINATION include)
install(TARGETS {package} ARCHIVE DESTINATION lib LIBRARY DESTINATION lib RUNTIME DESTINATION bin)
ament_package()
"""

README = """# {package}

{written}. {about}

Copy this folder into the `src` of a workspace and build it with `colcon build`. These lines belong into the
URDF's `<ros2_control>` of type "system", beside its `<joint>` elements, which have to name the same joints:

```xml
{urdf}
```

`name` is what handles are called; `role` is the name of the motor or joint in the file that hybridyn read.
ros2_control's parser requires both. Elements `mechanical_reduction` and `offset` may stand in each and mean
what they do in ros2_control's own transmissions: value in the robot = actuator / reduction + offset, and
joint = value in the robot / reduction + offset.

Handles are matched by name, in any order. Velocities and efforts need handles
of the positions on the side that is read; for effort commands these are the measured positions of the joints.
Results are NaN where the loops cannot be closed and near singular postures. Maintainer and licence in
`package.xml` are yours to state.
"""


@dataclass(frozen=True)
class Place:
    """A joint on one side of a map.

    Attributes:
        at: Its first entry of q.
        turns: Whether q has its cosine and sine.
        step: Largest step in which positions are followed, [m or rad].
    """

    name: str
    at: int
    turns: bool
    step: float


def transmission_package(
    robot: str,
    name: str,
    exported: dict[str, str],
    sides: tuple[Sequence[Place], Sequence[Place]],
    home: Sequence[float],
) -> dict[str, str]:
    """Return the files of the package by their paths."""
    joints, motors = sides
    package = f"{name}_transmission"
    listed = [", ".join(place.name for place in side) for side in sides]
    words = {"written": WRITTEN, "package": package, "name": name, "urdf": _urdf(name, package, sides)}
    words["about"] = f"Transmission between the joints {listed[0]} and the motors {listed[1]} of '{robot}'."
    in_xml = words | {"about": escape(words["about"])}
    marks = {
        "WRITTEN": WRITTEN, "PACKAGE": package, "NAME": name, "GUARD": f"{package.upper()}_HPP_",
        "JOINTS": _line(listed[0]), "MOTORS": _line(listed[1]), "K": len(joints), "M": len(motors),
        "KM": len(joints) * len(motors), "NQ": len(home), "HOME": ", ".join(map(literal, home)),
        "JOINT_PLACES": _places(joints), "MOTOR_PLACES": _places(motors),
    }  # fmt: skip
    return {
        "package.xml": PACKAGE_XML.format(**in_xml),
        "CMakeLists.txt": CMAKE.format(**words),
        f"{package}.xml": PLUGIN_XML.format(**in_xml),
        "README.md": README.format(**words),
        f"include/{package}/{package}.hpp": _filled("transmission.hpp", marks),
        f"src/{package}.cpp": _filled("transmission.cpp", marks),
        f"include/{package}/{name}.h": exported[f"{name}.h"],
        f"src/{name}.c": exported[f"{name}.c"],
    }


def _filled(template: str, marks: dict[str, object]) -> str:
    """Return a source with its marks replaced."""
    text = text_of(template)
    for mark, value in marks.items():
        text = text.replace(f"@{mark}@", str(value))
    return text


def _places(side: Sequence[Place]) -> str:
    """Return places as lines of an array in C++."""
    return "\n".join(
        f"  {{{json.dumps(p.name)}, {p.at}, {'true' if p.turns else 'false'}, {literal(p.step)}}},"
        for p in side
    )


def _line(text: str) -> str:
    """Return a text that stays in its line of a comment."""
    return " ".join(text.replace("\\", "/").split())


def _urdf(name: str, package: str, sides: tuple[Sequence[Place], Sequence[Place]]) -> str:
    """Return the element of the URDF that loads the transmission."""
    lines = [f'<transmission name="{name}">', f"  <plugin>{package}/Transmission</plugin>"]
    for element, side in zip(("joint", "actuator"), sides, strict=True):
        for place in side:
            text = quoteattr(place.name)
            lines.append(f"  <{element} name={text} role={text}/>")
    return "\n".join([*lines, "</transmission>"])
