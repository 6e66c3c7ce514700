"""NVRTC builds the kernels for GPUs that are not here; their registers and stack stand in the binaries."""

import re
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest

import hybridyn
from tests.support.extras import needs
from tests.support.samples import slow

wp = needs("gpu")
wp.config.log_level = wp.LOG_WARNING

ARCHITECTURES = [80, 90]
#: Registers and bytes of stack of a thread: a tenth above what Warp 1.19 made of them.
USED = {
    ("five_bar", "idm"): (105, 48), ("five_bar", "ddm"): (130, 48),
    ("gough_stewart", "idm"): (215, 1320), ("gough_stewart", "ddm"): (255, 1410),
    ("lx4", "idm"): (255, 6410), ("lx4", "ddm"): (255, 9100),
    ("five_bar", "close"): (165, 48), ("gough_stewart", "close"): (255, 4350),
    ("lx4", "close"): (255, 5230),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "model"),
    [key if key[0] == "five_bar" and key[1] != "close" else slow(*key) for key in USED],
)
def test_kernels_are_built_for_gpus_and_use_as_much(name: str, model: str, tmp_path: Path) -> None:
    batch = hybridyn.warp(hybridyn.load(name), device="cpu")
    built: list[Path] = []
    for kernel in batch.made(model).kernels:
        more = wp.compile_aot_module(kernel.module, arch=ARCHITECTURES, module_dir=tmp_path, use_ptx=False)
        assert [path.name.split(".")[-2:] for path in more] == [["sm80", "cubin"], ["sm90", "cubin"]]
        built += more
    tool = cuobjdump()
    if tool is None:
        pytest.skip("needs cuobjdump: pip install nvidia-cuda-cuobjdump")
    for path in built:
        text = subprocess.run([tool, "-res-usage", path], capture_output=True, text=True, check=True).stdout
        registers, stack = (max(map(int, re.findall(rf"{word}:(\d+)", text))) for word in ("REG", "STACK"))
        assert registers <= USED[name, model][0], (path.name, registers)
        assert stack <= USED[name, model][1], (path.name, stack)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("name", ["five_bar", slow("gough_stewart"), slow("lx4")])
@pytest.mark.slow
def test_every_function_is_built_for_gpus(name: str, dtype: str, tmp_path: Path) -> None:
    batch = hybridyn.warp(hybridyn.load(name), dtype=dtype, device="cpu")
    for model in dir(batch.functions):
        for kernel in batch.made(model).kernels:
            built = wp.compile_aot_module(
                kernel.module, arch=ARCHITECTURES[1], module_dir=tmp_path / model, use_ptx=False
            )
            assert len(built) == 1


def cuobjdump() -> Path | None:
    """Return the program that reads binaries of GPUs, if it is installed."""
    found = find_spec("nvidia")
    folders = [] if found is None else list(found.submodule_search_locations or ())
    return next((path for folder in folders for path in Path(folder).rglob("cuobjdump")), None)
