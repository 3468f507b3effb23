"""Kernels compile for the GPUs they are meant for, also on a machine without one."""

import importlib
import pkgutil

import pytest
import warp as wp

from kine2go_warp import kernels

MODULES = sorted(module.name for module in pkgutil.iter_modules(kernels.__path__))


def kernels_of(module):
    return [value for value in vars(module).values() if isinstance(value, wp.Kernel)]


@pytest.mark.parametrize("name", MODULES)
def test_a_module_compiles_for_ampere_hopper_and_blackwell(name, tmp_path):
    module = importlib.import_module(f"kine2go_warp.kernels.{name}")
    if not any(kernel.module.name == module.__name__ for kernel in kernels_of(module)):
        pytest.skip("holds functions only, which are compiled with the kernels that use them")
    wp.compile_aot_module(module, arch=[80, 90, 100], module_dir=tmp_path)
    compiled = {path.name.split(".")[-2] for path in tmp_path.glob("*.cubin")}
    assert compiled == {"sm80", "sm90", "sm100"}
