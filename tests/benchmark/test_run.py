"""The yardstick: the dataset's own commands score 1, worse policies less; nothing is simulated twice."""

import json

import numpy as np
import pytest

from kine2go_warp.benchmark.config import BenchmarkConfig
from kine2go_warp.benchmark.leaderboard import Leaderboard, draw
from kine2go_warp.benchmark.policies import BenchmarkPolicy, load_policy
from kine2go_warp.benchmark.run import METRIC_NAMES, SCORE, SURVIVAL, benchmark_motion
from kine2go_warp.benchmark.splits import HELD_OUT, split_of
from kine2go_warp.cli.main import main
from kine2go_warp.dataset import open_dataset
from kine2go_warp.errors import DatasetError, PolicyError
from kine2go_warp.motions.catalogue import load_catalogue

EASY = BenchmarkConfig(max_distance=9.0, max_angle=3.1, trajectories=3)
"""Limits beyond which the poor policy of the tests does not drift."""


def repeats(dataset, name="own commands"):
    """A policy that repeats the dataset's commands."""
    commands = open_dataset(dataset).load("dog_trot").trajectories.rows["action"][:3]

    def begin(*_):
        rows = iter(np.nan_to_num(commands).swapaxes(0, 1))
        return lambda _: next(rows)

    return BenchmarkPolicy(name, "0" * 64, begin)


def stands(*_):
    return lambda seen: np.zeros((len(seen["height"]), 12))


@pytest.fixture(scope="module")
def results(clean_dataset):
    return benchmark_motion(open_dataset(clean_dataset), "dog_trot", repeats(clean_dataset), EASY, "cpu")


def test_the_datasets_own_commands_score_1(results):
    recorded = results[0]
    assert recorded.condition == "recorded"
    assert recorded.estimates[SURVIVAL].value == 1.0
    for name in METRIC_NAMES:
        assert recorded.estimates[name].value == pytest.approx(recorded.data[name], rel=1e-3), name
    assert recorded.estimates[SCORE].value == pytest.approx(1.0, abs=1e-3)


def test_a_kick_makes_them_miss_their_reference(results):
    recorded, perturbed = results
    assert perturbed.condition == "perturbed"
    assert perturbed.estimates["root_error"].value > recorded.estimates["root_error"].value
    assert perturbed.estimates[SCORE].value < recorded.estimates[SCORE].value


def test_a_robot_that_stands_still_is_lost_and_scores_little(clean_dataset):
    policy = BenchmarkPolicy("stands", "1" * 64, stands)
    config = BenchmarkConfig(trajectories=3, engine="mujoco", max_distance=0.3)
    recorded, _ = benchmark_motion(open_dataset(clean_dataset), "dog_trot", policy, config, "cpu")
    assert recorded.estimates[SURVIVAL].value < 1.0
    assert recorded.estimates[SCORE].value < 0.7
    assert "foot_slip" not in recorded.estimates, "plain MuJoCo tells no forces of feet here"


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros((3, 8)), r"float64 of shape \(3, 8\), not actions \(3, 12\)"),
        (np.full((3, 12), np.nan), "not finite"),
        ("forward", "not actions"),
    ],
)
def test_what_is_no_action_is_refused(clean_dataset, action, message):
    policy = BenchmarkPolicy("wrong", "2" * 64, lambda *_: lambda _: action)
    config = BenchmarkConfig(trajectories=3, engine="mujoco")
    with pytest.raises(PolicyError, match=message):
        benchmark_motion(open_dataset(clean_dataset), "dog_trot", policy, config, "cpu")


def test_one_of_ours_is_run_from_its_folder(exported, clean_dataset):
    policy = load_policy(str(exported), name="ours")
    recorded, _ = benchmark_motion(open_dataset(clean_dataset), "dog_trot", policy, EASY, "cpu")
    # Without noise on its actions it tracks better than the rollouts that were recorded with it.
    assert recorded.estimates[SURVIVAL].value == 1.0
    assert recorded.estimates["joint_mse"].value < 1.05 * recorded.data["joint_mse"]


def test_results_are_merged_and_kept_apart_from_those_of_other_rollouts(results, clean_dataset, tmp_path):
    policy, path = repeats(clean_dataset), tmp_path / "board.json"
    board = Leaderboard(EASY).with_results(policy, "content", results)
    board.write(path)
    read = Leaderboard.read(path, EASY)
    assert read.has(policy, "dog_trot", "content")
    assert read.entries[0].mean("held_out", "recorded", SCORE) == pytest.approx(1.0, abs=1e-3)
    other = BenchmarkPolicy("another", "3" * 64, stands)
    assert [entry.policy for entry in read.with_results(other, "content", results).entries] == [policy.name, "another"]
    assert draw(read, tmp_path / "board.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(DatasetError, match="other rollouts"):
        read.with_results(other, "other content", results)
    with pytest.raises(DatasetError, match="other settings"):
        Leaderboard.read(path, BenchmarkConfig(kick=0.1))
    path.write_text("[]")
    with pytest.raises(DatasetError, match="no leaderboard"):
        Leaderboard.read(path, EASY)


def test_the_command_simulates_what_is_missing_and_nothing_twice(clean_dataset, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n\ndef stand(seen):\n    return np.zeros((len(seen['height']), 12))\n"
    )
    command = ["dataset", "benchmark", str(clean_dataset), "--policy", "mine.py:stand", "--engine", "mujoco"]
    assert main([*command, "--trajectories", "2"]) == 0
    assert "stand" in capsys.readouterr().out
    before = json.loads((tmp_path / "leaderboard.json").read_text())
    assert before["entries"][0]["policy"] == "stand"
    monkeypatch.setattr("kine2go_warp.benchmark.run.benchmark_motion", lambda *_: pytest.fail("simulated again"))
    assert main([*command, "--trajectories", "2"]) == 0
    assert json.loads((tmp_path / "leaderboard.json").read_text()) == before


@pytest.mark.parametrize(
    ("files", "reference", "message"),
    [
        ({}, "nothing", "no policy here; name an .onnx file"),
        ({}, "nothing.onnx", "nothing.json: missing"),
        ({"p.json": "{"}, "p.onnx", "cannot be read"),
        ({"p.json": '{"observation": []}'}, "p.onnx", "at least one feature"),
        ({"p.json": '{"observation": ["speed"]}'}, "p.onnx", "no feature 'speed'"),
        ({"p.json": '{"observation": ["height"]}', "p.onnx": "text"}, "p.onnx", "not an ONNX model"),
        ({"p.py": "a = 1"}, "p.py:a", "no function or class"),
    ],
)
def test_policies_that_cannot_be_read_are_named(
    files, reference, message, clean_dataset, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert main(["dataset", "benchmark", str(clean_dataset), "--policy", reference]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert message in line
    assert not (tmp_path / "leaderboard.json").exists()


def test_no_frame_of_a_held_out_motion_is_in_one_to_learn_from():
    entries = load_catalogue()
    assert set(entries) >= HELD_OUT
    for name in HELD_OUT:
        for other, entry in entries.items():
            if split_of(other) == "train" and entry.file == entries[name].file:
                one, two = entries[name].frames, entry.frames
                ends = [float("inf") if frames.end < 0 else frames.end for frames in (one, two)]
                assert one.start >= ends[1] or two.start >= ends[0], f"{name} and {other}"
