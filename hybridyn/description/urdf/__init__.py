"""URDF and xacro, with every way to write a loop in them.

Read `xml_node` (elements that know their file and line), `urdf` (links and joints), `loops` (closures and
couplings), `transmissions` (motors), `foreign` (loops in forms that are refused by name), `xacro`
(expansion), `robot_folders` (what it may read), `xacro_child/` (the process that expands).

May import: `description`'s own files.
"""
