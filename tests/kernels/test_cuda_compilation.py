"""Kernels compile for the GPUs they are meant for, also on a machine without one."""

import importlib
import pkgutil

import pytest
import warp as wp

from kine2go_warp import kernels

MODULES = sorted(module.name for module in pkgutil.iter_modules(kernels.__path__))


def kernels_of(module):
    return [value for value in vars(module).values() if isinstance(value, wp.Kernel)]


def assert_it_compiles(name, architectures, folder):
    module = importlib.import_module(f"kine2go_warp.kernels.{name}")
    if not any(kernel.module.name == module.__name__ for kernel in kernels_of(module)):
        pytest.skip("holds functions only, which are compiled with the kernels that use them")
    wp.compile_aot_module(module, arch=architectures, module_dir=folder)
    compiled = {path.name.split(".")[-2] for path in folder.glob("*.cubin")}
    assert compiled == {f"sm{architecture}" for architecture in architectures}


@pytest.mark.parametrize("name", MODULES)
def test_a_module_compiles_for_hopper(name, tmp_path):
    assert_it_compiles(name, [90], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODULES)
def test_a_module_compiles_for_ampere_hopper_and_blackwell(name, tmp_path):
    assert_it_compiles(name, [80, 90, 100, 120], tmp_path)
