"""The four conditions, and what is written of them."""

import json

import numpy as np
import pytest
from PIL import Image

from kine2go_warp.cli.main import main
from kine2go_warp.evaluation.evaluate import CONDITIONS
from kine2go_warp.evaluation.report import finite
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST


@pytest.fixture
def two_clips(policy, clip, standing_clip, tmp_path):
    """The policy of the trot as one of two clips, the other standing still."""
    folder = PolicyFolder(tmp_path / "two")
    record = policy.read_record()
    names = folder.write_clips((clip, standing_clip))
    folder.write_record(type(record)(FAST, names, record.fingerprint, record.iterations, record.seconds))
    (folder.path / policy.latest_checkpoint().name).write_bytes(policy.latest_checkpoint().read_bytes())
    return folder


def test_the_command_reports_every_clip_under_every_condition(two_clips, capsys):
    assert main(["eval", str(two_clips.path), "--worlds", "3", "--seconds", "1", "--device", "cpu"]) == 0
    printed = capsys.readouterr().out
    assert "stochastic, randomised" in printed
    report = json.loads((two_clips.path / "eval.json").read_text())
    clips = ["dog_trot", "standing"]
    found = [(one["clip"], one["condition"]) for one in report["results"]]
    assert found == [(clip, condition) for clip in clips for condition in CONDITIONS]
    assert report["checkpoint_sha256"] == two_clips.checkpoint_hash()
    assert report["randomised_environment"]["randomization"]["push_speed"] == [0.0, 0.2]
    for one in report["results"]:
        assert one["survival"]["count"] == 3
        assert one["rollouts"]["initial_phase"] == [pytest.approx(value, abs=1e-6) for value in (1 / 6, 0.5, 5 / 6)]
        assert one["joint_rmse"]["value"] == pytest.approx(np.mean(one["rollouts"]["joint_rmse"]), rel=1e-6)
        assert 0.0 <= one["torque_saturation"]["value"] <= 1.0
    by_condition = {one["condition"]: one for one in report["results"] if one["clip"] == "dog_trot"}
    rates = {name: one["action_rate"]["value"] for name, one in by_condition.items()}
    assert rates["stochastic, plain"] > rates["deterministic, plain"], "noise shows in the rate of the action"
    for clip in clips:
        with Image.open(two_clips.path / f"eval_{clip}.png") as picture:
            assert min(picture.size) > 400


def test_clips_that_the_policy_was_not_trained_on_are_evaluated_from_their_first_frame(
    policy, standing_clip, tmp_path, capsys
):
    file, table = tmp_path / "standing.npz", tmp_path / "table.md"
    standing_clip.save(file)
    chosen = ["--start", "first_frame", "--no-stochastic", "--no-randomised"]
    command = ["eval", str(policy.path), *chosen, "--worlds", "2", "--seconds", "0.5", "--device", "cpu", "--clips"]
    assert main([*command, str(file), "--json", str(tmp_path / "eval.json"), "--markdown", str(table)]) == 0
    (found,) = json.loads((tmp_path / "eval.json").read_text())["results"]
    assert (found["clip"], found["condition"]) == ("standing", "deterministic, plain")
    assert found["rollouts"]["initial_phase"] == [0.0, 0.0]
    assert table.read_text().count("`standing`") == 1
    assert main([*command, str(file), str(file)]) == 2
    assert "two clips are named 'standing'" in capsys.readouterr().err


def test_json_has_no_nan():
    assert [finite(value) for value in (float("nan"), float("inf"), 7, 0.123456789)] == [None, None, 7, 0.1234568]


def test_a_file_that_is_there_is_kept(policy, tmp_path, capsys):
    file = tmp_path / "kept.json"
    file.write_text("{}")
    for command in ("eval", "sim2sim"):
        assert main([command, str(policy.path), "--json", str(file)]) == 2
        assert "--overwrite" in capsys.readouterr().err
    assert file.read_text() == "{}"
