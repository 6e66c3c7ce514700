"""Many robots at once through Warp: the exported C of a robot inside functions and kernels of Warp.

Read `functions` (programs as the body of one Warp function, and kernels), `native_models` (what these
compute), `module_lanes` (loops closed module by module), `arrays` (whose arrays come and go), `launching`
(a kernel on such arrays), `derivatives` (programs of derivatives as kernels), `taping` (gradients on tapes
of Warp), then `batch` and `maps`. `c/` holds what is written by hand; the walk along a branch is that of
exported C.

The general path that samples in doubt take is `fallback`: its steps are those of `simulation`, under
controllers of `scenes`.

May import: `scenes` and below.
"""
