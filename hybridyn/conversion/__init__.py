"""Write robots in other formats: MJCF, URDF, USD and the files beside them, with a list of what is lost.

Read `request` first (what a writer receives and returns, how it lists what its format cannot say, and numbers
and elements as text), then `convert` (which chooses the writer by the ending of the file, closes loops that
are open at home, and goes from a robot to files), and one format; MJCF takes three files: `mjcf_bodies`,
`mjcf_forces` and `mjcf`. `parts` makes joints and closures that a format has of others.

May import: `description`, `structure`, `assembly`, and the layers below them.
"""
