"""Devices: drivers that are too old, batches that do not fit, GPUs that workers share."""

import pytest
import torch
import warp as wp

from kine2go_warp.device import choose_device, driver_too_old, fitting, is_here
from kine2go_warp.env import environment as environments
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.pipelines.engines.local import LocalEngine, visible_gpu


@pytest.mark.parametrize(
    ("driver", "toolkit", "expected"),
    [
        (None, (13, 4), ""),
        ((13, 0), (13, 4), ""),
        ((12, 2), (13, 4), "the NVIDIA driver supports CUDA 12.2, and the installed Warp needs 13.0"),
        ((12, 2), (12, 9), ""),
    ],
)
def test_an_old_driver_is_said_instead_of_training_on_the_cpu_in_silence(
    monkeypatch, capsys, driver, toolkit, expected
):
    monkeypatch.setattr(wp, "get_cuda_driver_version", lambda: driver)
    monkeypatch.setattr(wp, "get_cuda_toolkit_version", lambda: toolkit)
    assert driver_too_old().startswith(expected)
    assert bool(driver_too_old()) == bool(expected)
    choose_device(None)
    assert expected in capsys.readouterr().err
    with pytest.raises(Kine2GoError, match=f"no device 'cuda:7' on this machine; .*{expected}"):
        choose_device("cuda:7")


def test_only_devices_that_are_listed_are_here():
    assert is_here("cpu")
    assert not is_here("cuda:99")


@pytest.mark.parametrize(
    "error", [torch.OutOfMemoryError("CUDA out of memory"), RuntimeError("Failed to allocate 99 bytes"), MemoryError()]
)
def test_too_many_worlds_are_said_with_a_number_to_try(error):
    with (
        pytest.raises(Kine2GoError, match=r"^4096 world\(s\) do not fit into the memory of cuda:0; try 2048$"),
        fitting(4096, "cuda:0"),
    ):
        raise error


def test_other_errors_are_not_taken_for_a_lack_of_memory():
    with pytest.raises(RuntimeError, match="illegal address"), fitting(4096, "cuda:0"):
        raise RuntimeError("illegal address")


def test_an_environment_that_does_not_fit_says_so(monkeypatch, clip, small_config):
    def too_little(*_):
        raise RuntimeError("Failed to allocate 123 bytes on device 'cpu'")

    monkeypatch.setattr(environments, "Simulation", too_little)
    with pytest.raises(Kine2GoError, match="8 world\\(s\\) do not fit into the memory of cpu; try 4"):
        ImitationEnvironment([clip], small_config, "cpu")


@pytest.mark.parametrize(
    ("visible", "count", "expected"),
    [(None, 1, "000"), (None, 2, "010"), ("4,5", 2, "454"), ("GPU-a, GPU-b,GPU-c", 3, ["GPU-a", "GPU-b", "GPU-c"])],
)
def test_workers_share_the_gpus_that_this_process_may_use(monkeypatch, visible, count, expected):
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    if visible:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", visible)
    assert [visible_gpu(number, count) for number in range(3)] == list(expected)


@pytest.mark.parametrize(("device", "sent"), [("cpu", "cpu"), ("cuda:0", "cuda:0"), ("cuda:1", "cuda:0")])
def test_a_worker_sees_its_gpu_as_the_first(tmp_path, device, sent):
    assert LocalEngine(1, device, tmp_path).device == sent
