"""What is published is checked, whole, told apart by licence, and has its scores and checksums with it."""

import json
import subprocess
from pathlib import Path

import pytest
import zarr

from kine2go_warp.cli.main import main


def test_a_clean_dataset_is_published_with_scores_pictures_and_checksums(dataset_copy, tmp_path, capsys):
    out = tmp_path / "published"
    assert main(["dataset", "publish", str(dataset_copy), "--to", str(out), "--no-pictures"]) == 0
    assert "checked" in capsys.readouterr().out
    card = (out / "README.md").read_text()
    assert card.startswith("---\nlicense: bsd-3-clause\n")
    assert "## Scorecard" in card
    assert "| joint_rmse |" in card
    scores = json.loads((out / "scores.json").read_text())
    assert list(scores["motions"]) == ["dog_trot"]
    assert "<html" in (out / "report.html").read_text()
    for path in (out / "plots").iterdir():
        assert f"(plots/{path.name})" in card
    listed = {line.split("  ")[1] for line in (out / "SHA256SUMS").read_text().splitlines()}
    files = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert listed == files - {"SHA256SUMS"}
    subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=out, check=True)
    assert main(["dataset", "publish", str(dataset_copy), "--to", str(out)]) == 2
    assert "holds an export already" in capsys.readouterr().err


def test_what_the_checks_find_wrong_is_not_published(dataset_copy, tmp_path, capsys):
    group = zarr.open_group(dataset_copy / "dog_trot", mode="r+", use_consolidated=False)
    group["joint_position"][0, 5, 2] = 9.0
    assert main(["dataset", "publish", str(dataset_copy), "--to", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "not published" in error
    assert "dog_trot" in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_the_hub_gets_a_private_dataset_of_its_own_for_each_licence(dataset_copy, monkeypatch, capsys):
    hub = pytest.importorskip("huggingface_hub")
    calls = []

    class Api:
        def create_repo(self, name, **settings):
            calls.append((name, settings["repo_type"], settings["private"]))

        def upload_folder(self, repo_id, folder_path, **_):
            calls.append((repo_id, sorted(name.name for name in Path(folder_path).iterdir())))

    monkeypatch.setattr(hub, "HfApi", Api)
    assert main(["dataset", "publish", str(dataset_copy), "--to", "hf://datasets/me/dogs", "--no-pictures"]) == 0
    assert "hf://datasets/me/dogs: BSD-3-Clause" in capsys.readouterr().out
    assert calls[0] == ("me/dogs", "dataset", True)
    assert {"README.md", "SHA256SUMS", "data", "report.html", "scores.json"} <= set(calls[1][1])
    assert main(["dataset", "publish", str(dataset_copy), "--to", "hf://me"]) == 2
    assert "is named hf://datasets/USER/NAME" in capsys.readouterr().err
