"""Read URDF and xacro files, with every supported form of a loop.

Read `xml_node` (elements that know their file and line), `urdf` (links, joints, motors), `loops` (closures,
couplings), `xacro` (what is kept of expansions), `robot_folders` (the files that may be read), `expansion`
(of elements), `definitions` (properties, macros), `texts` (what they say), `scopes` (names), `traced` (what
depends on arguments), `expressions` (their evaluation).

May import: `description`'s own files.
"""
