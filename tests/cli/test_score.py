"""``kine2go dataset score`` as a person meets it."""

import json
import shutil

import pytest
import zarr

from kine2go_warp.cli.main import main
from kine2go_warp.scores.registry import METRICS
from kine2go_warp.tables import number_text


@pytest.fixture(scope="module")
def dataset(policy, tmp_path_factory):
    """A dataset of two motions, with the same rollouts."""
    path = tmp_path_factory.mktemp("score") / "dataset.zarr"
    loose = "--trajectories 3 --rows 40 --max-distance 9 --max-angle 4 --max-joint-rmse 9"
    assert main(["gather", str(policy.path), "--out", str(path), "--device", "cpu", *loose.split()]) == 0
    shutil.copytree(path / "dog_trot", path / "second")
    return path


def test_one_motion_is_shown_with_all_figures(dataset, capsys):
    assert main(["score", str(dataset), "dog_trot"]) == 0
    output = capsys.readouterr().out
    for metric in METRICS:
        assert metric.name in output
    assert "second" not in output


def test_a_dataset_is_shown_motion_by_motion_and_overall(dataset, capsys, tmp_path):
    arguments = ["score", str(dataset), "--json", str(tmp_path / "a.json"), "--plots", str(tmp_path / "plots")]
    assert main(arguments) == 0
    output = capsys.readouterr().out
    assert "all 2 motions" in " ".join(output.split()), "the title folds after a long path"
    assert "[m/s]" in output
    assert max(len(line) for line in output.splitlines() if "│" in line) <= 80
    content = json.loads((tmp_path / "a.json").read_text())
    assert list(content["motions"]) == ["dog_trot", "second"]
    names = {path.name for path in (tmp_path / "plots").iterdir()}
    assert names == {f"{motion}_{kind}.png" for motion in ("dog_trot", "second") for kind in ("coverage", "phase")}


def failing(capsys, *arguments):
    """Run a command that must fail, and return its one line."""
    assert main(["score", *map(str, arguments)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    return lines[0]


def test_nothing_is_overwritten_unless_asked(dataset, tmp_path, capsys):
    figures, plots = tmp_path / "a.json", tmp_path / "plots"
    figures.write_text("precious")
    plots.mkdir()
    (plots / "mine.txt").write_text("precious")
    assert "--overwrite" in failing(capsys, dataset, "--json", figures)
    assert "--overwrite" in failing(capsys, dataset, "--plots", plots)
    assert figures.read_text() == "precious"
    assert main(["score", str(dataset), "--json", str(figures), "--plots", str(plots), "--overwrite"]) == 0
    assert json.loads(figures.read_text())
    assert len(list(plots.iterdir())) == 5


def test_wrong_input_gets_one_line_and_nothing_is_written(dataset, tmp_path, capsys):
    empty = tmp_path / "empty.zarr"
    empty.mkdir()
    shutil.copy(dataset / "zarr.json", empty / "zarr.json")
    file = tmp_path / "file"
    file.write_text("no folder")
    outputs = ("--json", tmp_path / "a.json", "--plots", tmp_path / "plots")
    assert "no dataset here" in failing(capsys, tmp_path / "nothing.zarr", *outputs)
    assert "holds no motions" in failing(capsys, empty, *outputs)
    assert "no motion 'wolf'; it has: dog_trot, second" in failing(capsys, dataset, "dog_trot", "wolf", *outputs)
    assert "is a file" in failing(capsys, dataset, "--plots", file)
    assert "is a folder" in failing(capsys, dataset, "--json", tmp_path)
    failing(capsys, dataset, "--json", file / "a.json")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty.zarr", "file"]


def test_a_damaged_array_is_named(dataset, tmp_path, capsys):
    copy = tmp_path / "dataset.zarr"
    shutil.copytree(dataset, copy)
    shard = next(path for path in (copy / "second" / "joint_torque" / "c").rglob("*") if path.is_file())
    shard.write_bytes(b"damaged")
    assert "second/joint_torque: cannot be read" in failing(capsys, copy, "--json", tmp_path / "a.json")
    assert not (tmp_path / "a.json").exists()


def test_short_trajectories_lower_survival(dataset, tmp_path):
    copy = tmp_path / "dataset.zarr"
    shutil.copytree(dataset, copy)
    group = zarr.open_group(copy / "second", mode="a", use_consolidated=False)
    group["length"][:] = [40, 30, 40]
    assert main(["score", str(copy), "second", "--json", str(tmp_path / "a.json")]) == 0
    survival = json.loads((tmp_path / "a.json").read_text())["overall"]["survival"]
    assert survival["value"] == pytest.approx(2 / 3)


def test_numbers_have_three_digits():
    assert [number_text(value) for value in (0.0123456, 4560.4, float("nan"), 0.0)] == ["0.0123", "4,560", "-", "0"]
