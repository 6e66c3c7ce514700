"""Write robots in other formats: MJCF, URDF, USD and the files beside them, with a list of what is lost.

Read `request` first (what a writer receives and returns, and how it lists what its format cannot say) and
`as_text`, then `convert` (which chooses the writer by the ending of the file, and goes from a robot to files;
`closed_home`, `shapes` and `target_files` are its steps), and one format: `usd_prim`, `usd_joints` and `usd`;
`mjcf_bodies`, `mjcf_forces` and `mjcf`; `from_home` and `sdf`; `urdf`. `parts` makes joints and closures that
a format has of others, `mujoco_parts` does so for MuJoCo, with `small_bodies`; `renamed` changes names.

May import: `description`, `structure`, `assembly`, and the layers below them.
"""
