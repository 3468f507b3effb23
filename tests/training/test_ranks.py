"""Several processes train one policy, as torchrun starts them."""

import os
import socket
import subprocess
import sys
from contextlib import ExitStack

import numpy as np
import pytest
import torch

from kine2go_warp.cli.main import main
from kine2go_warp.device import is_here
from kine2go_warp.env.episodes import world_seeds
from kine2go_warp.errors import Kine2GoError, PolicyError
from kine2go_warp.learning.checkpoint import OTHER_RANKS, load_checkpoint
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.training.beginning import ResumePoint
from kine2go_warp.training.ranks import ALONE, Ranks, packed, unpacked
from kine2go_warp.training.train import train
from tests.conftest import REPOSITORY
from tests.training.helpers import assert_same_bits, assert_same_training, flattened

TWO = Ranks(rank=1, size=2, local_rank=1)


@pytest.fixture
def second_of_two(monkeypatch):
    for name, value in (("RANK", "1"), ("WORLD_SIZE", "2"), ("LOCAL_RANK", "1")):
        monkeypatch.setenv(name, value)


@pytest.mark.usefixtures("second_of_two")
def test_torchrun_tells_each_process_its_number():
    assert Ranks.of_torchrun() == TWO
    assert not TWO.is_first


def test_without_torchrun_a_process_is_alone(monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "")
    monkeypatch.setenv("RANK", "1")
    assert Ranks.of_torchrun() == ALONE
    assert ALONE.is_first
    assert ALONE.first_decides(lambda: 3) == 3
    assert ALONE.gathered("state") == ["state"]
    assert ALONE.device("cpu") == "cpu"


def test_each_process_has_its_share_of_the_worlds():
    config = FAST.override({"env.num_worlds": 6}).env
    assert TWO.share(config).num_worlds == 3
    with pytest.raises(PolicyError, match="6 worlds cannot be shared equally by 4 processes"):
        Ranks(0, 4).share(config)


def test_what_is_exchanged_may_hold_tensors_of_any_kind():
    seeds = torch.tensor([7, 2**31], dtype=torch.uint32)
    assert unpacked(packed({"seeds": seeds}))["seeds"].tolist() == [7, 2**31]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"device": "cuda:1"}, "--device cuda:1 names one device for 2 processes; leave it out"),
        ({"device": "cpu", "processes": 2}, "take neither --processes nor --strict"),
        ({"device": "cpu", "strict": True}, "take neither --processes nor --strict"),
    ],
)
@pytest.mark.usefixtures("second_of_two")
def test_options_for_one_process_are_refused_before_anything_is_written(clip, tmp_path, options, message):
    with pytest.raises(PolicyError, match=message):
        train([clip], FAST, tmp_path / "policy", **options)
    assert not (tmp_path / "policy").exists()


@pytest.mark.usefixtures("second_of_two")
def test_processes_that_torchrun_has_not_started_are_refused(clip, tmp_path, monkeypatch):
    monkeypatch.delenv("MASTER_ADDR", raising=False)
    with pytest.raises(PolicyError, match="WORLD_SIZE is 2, but torchrun has not started this process"):
        train([clip], FAST, tmp_path / "policy", "cpu")


@pytest.mark.skipif(is_here("cuda:1"), reason="there are two GPUs here")
@pytest.mark.usefixtures("second_of_two")
def test_more_processes_than_gpus_are_refused(monkeypatch):
    monkeypatch.setattr("warp.is_cuda_available", lambda: True)
    with pytest.raises(Kine2GoError, match="no device 'cuda:1' on this machine"):
        TWO.device(None)


@pytest.mark.usefixtures("second_of_two")
def test_other_commands_are_the_work_of_one_process(capsys):
    assert main(["doctor"]) == 2
    assert "WORLD_SIZE is 2, as torchrun sets it, and doctor is the work of one process" in capsys.readouterr().err


def test_a_training_is_continued_by_as_many_processes_as_began_it(tmp_path):
    start = ResumePoint(tmp_path / "model_0.pt", {"iter": 0, OTHER_RANKS: [{}]})
    start.check_ranks(2)
    with pytest.raises(PolicyError, match=r"written by 2 process.* there are 1 now; continue with torchrun"):
        start.check_ranks(1)
    ResumePoint(tmp_path / "model_0.pt", {"iter": 0}).check_ranks(1)


def free_ports(count):
    """Return so many free TCP ports of this machine."""
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(count)]
        return [str(one.getsockname()[1]) for one in sockets]


@pytest.mark.slow
def test_two_processes_learn_one_policy_and_continue_it_exactly(clip, tmp_path):
    """By gloo on the CPU, where NCCL would be on GPUs. Stopped after an iteration, it ends with the same bits."""
    clip.save(tmp_path / "clip.npz")
    command = [sys.executable, "-m", "tests.training.rank_process", tmp_path / "clip.npz", tmp_path, *free_ports(3)]
    shared = {**os.environ, "WORLD_SIZE": "2", "MASTER_ADDR": "127.0.0.1"}
    processes = [
        subprocess.Popen(command, env={**shared, "RANK": number, "LOCAL_RANK": number}, cwd=REPOSITORY)
        for number in ("0", "1")
    ]
    assert [process.wait(timeout=600) for process in processes] == [0, 0]
    ours, theirs = (flattened(torch.load(tmp_path / f"rank_{rank}.pt", weights_only=True)) for rank in (0, 1))
    assert_same_bits(ours, theirs)
    assert_same_training(tmp_path / "stopped", tmp_path / "undisturbed")
    policy = PolicyFolder(tmp_path / "undisturbed")
    record, checkpoint = policy.read_record(), load_checkpoint(policy.latest_checkpoint(), "cpu")
    assert record.complete
    assert record.evaluation is not None
    states = [checkpoint["training"], *checkpoint[OTHER_RANKS]]
    seeds = np.concatenate([state["worlds"]["seed"].numpy() for state in states])
    assert seeds.tolist() == world_seeds(record.preset.env.seed, 8).tolist(), "the worlds of one process, shared"
    assert len(list(policy.path.glob("events.out.*"))) == 1
