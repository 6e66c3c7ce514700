"""Read URDF and xacro files, with every supported form of a loop.

Read `xml_node` (elements that know their file and line), `urdf` (links and joints), `loops` (closures and
couplings), `transmissions` (motors), `foreign` (loops in unsupported forms, which raise errors), `xacro`
(expansion), `expressions` (their evaluation), `robot_folders` (the files that it may read).

May import: `description`'s own files.
"""
