import json
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.errors import PolicyError, SimulationError
from kine2go_warp.learning.checkpoint import load_checkpoint
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST, ROBUST
from kine2go_warp.training.train import train, training_fingerprint

TINY = FAST.override({"env.num_worlds": 8, "ppo.iterations": 2})


def test_training_leaves_a_folder_that_stands_on_its_own(policy, clip):
    record = policy.read_record()
    assert record.complete
    assert record.iterations == 3
    assert [path.name for path in policy.checkpoints()] == ["model_2.pt"]
    assert policy.read_clips(record)[0].content_hash() == clip.content_hash()
    table = json.loads(policy.record_file.read_text())["observation"]
    assert table[0]["name"] == "down_b[t]"
    assert table[-1]["stop"] == 219
    assert any(path.name.startswith("events.out") for path in policy.path.iterdir()), "a TensorBoard log"
    assert not list(policy.path.glob(".tmp-*"))


def test_progress_is_reported(clip, tmp_path):
    seen = []
    train([clip], TINY, tmp_path / "policy", "cpu", on_progress=seen.append)
    assert [(state.iteration, state.total_iterations) for state in seen] == [(1, 2), (2, 2)]
    assert seen[-1].steps_per_second > 0.0


def test_an_interrupted_training_continues_from_its_checkpoint(clip, tmp_path):
    folder = tmp_path / "policy"
    config = TINY.override({"ppo.iterations": 25})

    def stop_at_22(state):
        if state.iteration == 22:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train([clip], config, folder, "cpu", on_progress=stop_at_22)
    policy = PolicyFolder(folder)
    assert not policy.read_record().complete
    assert policy.read_record().iterations == 21
    assert policy.read_record().seconds > 0.0
    assert policy.latest_checkpoint().name == "model_20.pt"
    seen = []
    record = train([clip], config, folder, "cpu", on_progress=seen.append)
    assert [state.iteration for state in seen] == [22, 23, 24, 25]
    assert record.complete
    assert train([clip], config, folder, "cpu", on_progress=seen.append) == PolicyFolder(folder).read_record()
    assert len(seen) == 4, "a finished training is not repeated"


def test_a_folder_of_other_settings_is_not_overwritten_unasked(clip, tmp_path):
    folder = tmp_path / "policy"
    train([clip], TINY, folder, "cpu")
    before = PolicyFolder(folder).checkpoint_hash()
    with pytest.raises(PolicyError, match="--overwrite"):
        train([clip], TINY.override({"env.seed": 5}), folder, "cpu")
    assert PolicyFolder(folder).checkpoint_hash() == before
    old = PolicyFolder(folder).read_record().fingerprint
    train([clip], TINY.override({"env.seed": 5}), folder, "cpu", overwrite=True)
    assert PolicyFolder(folder).checkpoint_hash() != before
    assert PolicyFolder(folder.with_name(f"policy.{old}-1")).checkpoint_hash() == before, "moved aside, not deleted"


def test_checkpoints_of_a_policy_that_is_gone_are_not_continued(clip, tmp_path):
    """As after a kill between the removal of a record and that of its checkpoints."""
    folder = tmp_path / "policy"
    train([clip], TINY, folder, "cpu")
    (folder / "policy.json").unlink()
    seen = []
    train([clip], TINY.override({"env.seed": 3}), folder, "cpu", on_progress=seen.append)
    assert [state.iteration for state in seen] == [1, 2]


def test_fewer_iterations_than_are_done_change_nothing(clip, tmp_path):
    folder = tmp_path / "policy"
    train([clip], TINY.override({"ppo.iterations": 3}), folder, "cpu")
    before = PolicyFolder(folder).checkpoint_hash()
    assert train([clip], TINY, folder, "cpu", overwrite=True).iterations == 3
    assert PolicyFolder(folder).checkpoint_hash() == before


def test_an_unreadable_record_stops_unless_it_may_be_overwritten(clip, tmp_path):
    folder = tmp_path / "policy"
    folder.mkdir()
    (folder / "policy.json").write_text("{")
    with pytest.raises(PolicyError, match="cannot be read"):
        train([clip], TINY, folder, "cpu")
    assert train([clip], TINY, folder, "cpu", overwrite=True).complete


def test_more_iterations_continue_a_finished_policy(clip, tmp_path):
    folder = tmp_path / "policy"
    train([clip], TINY, folder, "cpu")
    seen = []
    train([clip], TINY.override({"ppo.iterations": 3}), folder, "cpu", on_progress=seen.append)
    assert [state.iteration for state in seen] == [3]


def test_a_damaged_or_foreign_checkpoint_is_refused(tmp_path):
    path = tmp_path / "model_1.pt"
    path.write_bytes(b"PK\x03\x04 damaged")
    with pytest.raises(PolicyError, match="not a checkpoint"):
        load_checkpoint(path, "cpu")
    torch.save({"weights": torch.zeros(3)}, path)
    with pytest.raises(PolicyError, match="not a checkpoint of 'kine2go policy train'"):
        load_checkpoint(path, "cpu")


class Trap:
    """Unpickling this creates a file: what a malicious checkpoint would do."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def test_a_checkpoint_cannot_run_code(tmp_path):
    torch.save({"actor_state_dict": Trap(tmp_path / "sprung")}, tmp_path / "model_1.pt")
    with pytest.raises(PolicyError):
        load_checkpoint(tmp_path / "model_1.pt", "cpu")
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("content", ["", "{}", '{"format_version": 99}', '{"format_version": 1}'])
def test_a_damaged_record_is_refused(tmp_path, content):
    (tmp_path / "policy.json").write_text(content)
    with pytest.raises(PolicyError):
        PolicyFolder(tmp_path).read_record()


def test_a_folder_without_a_policy_says_how_to_make_one(tmp_path):
    with pytest.raises(PolicyError, match="kine2go policy train"):
        PolicyFolder(tmp_path).read_record()


def test_a_folder_with_files_of_the_users_is_left_in_place(clip, tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "notes.txt").write_text("keep me")
    train([clip], TINY, folder, "cpu")
    assert (folder / "notes.txt").read_text() == "keep me"
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_the_robust_preset_trains_on_rough_ground_with_a_critic_that_sees_more(clip, tmp_path):
    record = train(
        [clip],
        ROBUST.override({"env.num_worlds": 16, "ppo.iterations": 2, "env.terrain.kind": "waves"}),
        tmp_path / "p",
        "cpu",
    )
    assert record.complete
    weights = load_checkpoint(PolicyFolder(tmp_path / "p").latest_checkpoint(), "cpu")
    actor_inputs = weights["actor_state_dict"]["mlp.0.weight"].shape[1]
    critic_inputs = weights["critic_state_dict"]["mlp.0.weight"].shape[1]
    assert (actor_inputs, critic_inputs) == (219, 219 + 85)


def test_several_clips_train_one_policy(clip, standing_clip, tmp_path):
    record = train(
        [clip, standing_clip], FAST.override({"env.num_worlds": 16, "ppo.iterations": 1}), tmp_path / "policy", "cpu"
    )
    assert record.clips == ("dog_trot.npz", "standing.npz")
    policy = PolicyFolder(tmp_path / "policy")
    assert [one.name for one in policy.chosen_clips(record)] == ["dog_trot", "standing"]
    assert [one.name for one in policy.chosen_clips(record, ["standing"])] == ["standing"]
    with pytest.raises(PolicyError, match="was not trained on 'hop'; its clips are: dog_trot, standing"):
        policy.chosen_clips(record, ["hop"])


def test_clips_of_the_same_name_are_refused_before_anything_is_written(clip, tmp_path):
    with pytest.raises(PolicyError, match="a name of its own"):
        train([clip, clip], TINY, tmp_path / "policy", "cpu")
    assert not list(tmp_path.iterdir())


def test_an_environment_of_several_clips_begins_episodes_in_all_of_them(clip, standing_clip):
    environment = ImitationEnvironment([clip, standing_clip], replace(FAST.env, num_worlds=64), "cpu", use_graph=False)
    counts = np.bincount(environment.episodes.placement.clip.numpy(), minlength=2)
    assert counts.min() > 16


def test_strict_training_stops_at_a_fault_and_names_the_file(clip, tmp_path):
    cramped = FAST.override({"env.solver.max_contacts": 4, "env.solver.max_constraints": 16, "env.num_worlds": 32})
    with pytest.raises(SimulationError, match=r"overflow in world \d+ of 32.*fault_world_\d+\.npz"):
        train([clip], cramped.override({"ppo.iterations": 20}), tmp_path / "policy", "cpu", strict=True)
    assert list((tmp_path / "policy").glob("fault_world_*.npz"))


def test_training_begins_with_the_networks_of_another_policy(policy, standing_clip, tmp_path):
    """They keep their size, the critic comes along, and the same folder with the same weights is the same training."""
    preset = TINY.override({"initial_policy": str(policy.path), "ppo.hidden_dims": [7], "ppo.learning_rate": 1e-12})
    record = train([standing_clip], replace(preset, ppo=replace(preset.ppo, iterations=1)), tmp_path / "tuned", "cpu")
    assert record.preset.ppo.hidden_dims == policy.read_record().preset.ppo.hidden_dims
    tuned = load_checkpoint(PolicyFolder(tmp_path / "tuned").latest_checkpoint(), "cpu")
    initial = load_checkpoint(policy.latest_checkpoint(), "cpu")
    for network in ("actor_state_dict", "critic_state_dict"):
        for name, values in initial[network].items():
            if "mlp" in name:
                torch.testing.assert_close(tuned[network][name], values, atol=1e-6, rtol=0.0)
    moved = tmp_path / "elsewhere"
    shutil.copytree(policy.path, moved)
    assert training_fingerprint([standing_clip], preset) == training_fingerprint(
        [standing_clip], replace(preset, initial_policy=str(moved))
    )
    assert training_fingerprint([standing_clip], preset) != training_fingerprint([standing_clip], TINY)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"initial_policy": "nowhere"}, "no policy here"),
        ({"env.history_length": 2}, "observes other things than these settings"),
        ({"env.privileged": True}, "does not fit these settings"),
    ],
)
def test_an_initial_policy_that_does_not_fit_is_refused(policy, clip, tmp_path, settings, message):
    preset = TINY.override({"initial_policy": str(policy.path), **settings})
    with pytest.raises(PolicyError, match=message):
        train([clip], preset, tmp_path / "tuned", "cpu")


def test_a_second_training_in_the_same_folder_is_refused(clip, tmp_path):
    policy, second = PolicyFolder(tmp_path / "policy"), TINY.override({"env.seed": 1})
    with policy.alone(), pytest.raises(PolicyError, match=f"another training writes here .process {os.getpid()} on "):
        train([clip], TINY, policy.path, "cpu")
    assert not policy.exists
    train([clip], TINY, policy.path, "cpu", on_progress=lambda _: refused(clip, second, policy.path))
    train([clip], second, policy.path, "cpu", overwrite=True, on_progress=lambda _: refused(clip, TINY, policy.path))
    assert policy.read_record().preset == second.on("cpu")


def refused(clip, preset, folder):
    with pytest.raises(PolicyError, match="another training writes here"):
        train([clip], preset, folder, "cpu", overwrite=True)
