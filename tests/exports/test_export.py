"""Exports appear whole or not at all, and their card says what they hold and whose it is."""

import json
import re
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
import zarr

from kine2go_warp.cli.main import main
from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.schema import QUALITY_ARRAYS, ROW_ARRAYS, TRAJECTORY_ARRAYS, ArraySpec
from kine2go_warp.dataset.writer import consolidate, write_array
from kine2go_warp.errors import ExportError
from kine2go_warp.exports import export as export_module
from kine2go_warp.exports.export import FORMATS, export_dataset, target_named
from kine2go_warp.exports.journal import resumable
from tests.exports.conftest import LENGTHS, ORIGINS

both_formats = pytest.mark.parametrize("form", ["lerobot", "npz"])
every_format = pytest.mark.parametrize("form", FORMATS)


def card_of(store, form, folder, motions=()):
    export_dataset(store, form, folder, motions)
    return (folder / "README.md").read_text()


@both_formats
def test_the_card_names_every_array_with_unit_and_meaning(store, form, tmp_path):
    card = card_of(store, form, tmp_path / "out")
    for array in ROW_ARRAYS:
        assert re.search(rf"\| {array.name} \| \d+ \| {array.unit} \| {re.escape(array.description)} \|", card), array
    for array in (*TRAJECTORY_ARRAYS, *QUALITY_ARRAYS):
        if (form, array.name) != ("lerobot", "length"):  # which has a column of LeRobot's own
            assert array.description in card


@both_formats
def test_the_card_gives_licence_and_citation_of_each_motion(store, form, tmp_path):
    card = card_of(store, form, tmp_path / "out")
    for motion, origin in ORIGINS.items():
        assert f"| `{motion}` | {origin['source']} | {origin['licence']} | {origin['citation']} |" in card
    assert "\nlicense: cc-by-nc-4.0\n" in card


def test_motions_of_two_licences_never_end_in_one_folder(store, written, tmp_path):
    for motion, licence in (("one", "CC BY-NC 4.0"), ("two", "CC BY-SA 4.0")):
        zarr.open_group(store / motion, mode="a").attrs["licence"] = licence
    for form in FORMATS:
        out = tmp_path / form
        record = export_dataset(store, form, out)
        assert record.parts == {"CC BY-NC 4.0": "cc-by-nc-4.0", "CC BY-SA 4.0": "cc-by-sa-4.0"}
        for motion, other, folder in (("one", "two", "cc-by-nc-4.0"), ("two", "one", "cc-by-sa-4.0")):
            card = (out / folder / "README.md").read_text()
            assert f"\nlicense: {folder}\n" in card
            assert f"| `{motion}` | 3 |" in card
            assert f"`{other}`" not in card
            assert f"| [{folder}]({folder}/README.md) | " in (out / "README.md").read_text()
        assert sorted(path.name for path in out.iterdir()) == [
            "README.md", "cc-by-nc-4.0", "cc-by-sa-4.0", "export.json",
        ]  # fmt: skip
    state = pq.read_table(tmp_path / "parquet" / "cc-by-sa-4.0" / "data")["observation.state"].combine_chunks()
    np.testing.assert_array_equal(state.flatten().to_numpy().reshape(-1, 34)[:, 0], written_heights(written["two"]))


def written_heights(data):
    return np.concatenate([data.rows["root_position"][index, :length, 2] for index, length in enumerate(LENGTHS)])


@every_format
def test_the_card_says_time_rule_frames_joint_order_limits_and_versions(store, form, tmp_path):
    attributes = zarr.open_group(store / "one", mode="a").attrs
    limits = {"joint_lower": [-1.5] * 12, "joint_upper": [1.25] * 12, "motor_limits": {"driving": [23.0] * 12}}
    attributes["simulation"] = json.dumps({"engine": "MuJoCo Warp", "packages": {"newton": "9.8.7"}, **limits})
    card = card_of(store, form, tmp_path / "out")
    assert target_named(form).time_rule in card
    assert "| 3 | `FR_hip_joint` | 0 | 0.0 | -1.5 | 1.25 | 23 | - |" in card
    assert "- engine: MuJoCo Warp\n- versions: newton 9.8.7" in card
    assert "World frame: z up" in card
    if form in ("lerobot", "minari", "d4rl", "robomimic", "motivo", "parquet"):
        assert re.search(r"\| gravity \| 3 \| 1 \| direction of gravity \| base \|", card)


@pytest.mark.parametrize("form", ["lerobot", "minari", "parquet"])
def test_an_interrupted_export_goes_on_where_it_was(store, form, tmp_path, monkeypatch):
    export_dataset(store, form, tmp_path / "whole")
    target = target_named(form)
    written = []

    def write(output, name, trajectories):
        written.append(name)
        if written == ["one", "two"]:
            next(trajectories)
            (output.folder / "data").mkdir(exist_ok=True)
            (output.folder / "data" / "half.parquet").write_text("half")
            raise KeyboardInterrupt
        target.write(output, name, trajectories)

    monkeypatch.setattr(export_module, "target_named", lambda _: replace(target, write=write))
    with pytest.raises(KeyboardInterrupt):
        export_dataset(store, form, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    seen = []
    export_dataset(store, form, tmp_path / "out", on_trajectory=lambda done, total: seen.append((done, total)))
    assert written == ["one", "two", "two"]
    assert seen == [(3, 6), (4, 6), (5, 6), (6, 6)]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dataset.zarr", "out", "whole"]
    files = {path.relative_to(tmp_path / "whole") for path in (tmp_path / "whole").rglob("*") if path.is_file()}
    assert {path.relative_to(tmp_path / "out") for path in (tmp_path / "out").rglob("*") if path.is_file()} == files
    for path in files:
        same = (tmp_path / "whole" / path).read_bytes() == (tmp_path / "out" / path).read_bytes()
        assert same or path.suffix == ".hdf5", path  # which notes the time of writing


def test_an_interrupted_export_of_other_content_begins_anew(store, tmp_path, monkeypatch):
    target = target_named("npz")

    def write(output, name, trajectories):
        if name == "two":
            raise KeyboardInterrupt
        target.write(output, name, trajectories)

    monkeypatch.setattr(export_module, "target_named", lambda _: replace(target, write=write))
    with pytest.raises(KeyboardInterrupt):
        export_dataset(store, "npz", tmp_path / "out")
    monkeypatch.undo()
    zarr.open_group(store / "one", mode="a").attrs["citation"] = "another one"
    export_dataset(store, "npz", tmp_path / "out", ["one"])
    assert "another one" in (tmp_path / "out" / "README.md").read_text()
    assert not (tmp_path / "out" / "two").exists()


def test_two_processes_do_not_export_to_one_folder(store, tmp_path):
    with resumable(tmp_path / "out", "another export") as journal:
        (journal.data / "file").write_text("")
        with pytest.raises(ExportError, match="another process is exporting"):
            export_dataset(store, "npz", tmp_path / "out")


def test_the_card_counts_what_is_there_and_gives_the_stored_quality(store, tmp_path):
    card = card_of(store, "npz", tmp_path / "out")
    assert "6 trajectories, 110 rows at 60 Hz, 0.000509 hours" in card
    assert "| `two` | 3 | 2 | 55 | 15-20 | 0.02 | vhdc |" in card
    dataset = open_dataset(store)
    figures = sorted(array.name for array in QUALITY_ARRAYS)
    means = [np.mean(dataset.motion("one").values(f"quality/{name}")) for name in figures]
    quality = card[card.index("## Quality") :]
    line = next(line for line in quality.splitlines() if line.startswith("| `one` |"))
    found = [float(cell) for cell in line.strip("| ").split("|")[1:]]
    np.testing.assert_allclose(found, means, rtol=1e-3)


def test_the_lines_of_the_card_that_load_it_work(store, tmp_path, monkeypatch):
    card = card_of(store, "npz", tmp_path / "out")
    monkeypatch.chdir(tmp_path / "out")
    names = {}
    exec(re.search(r"```python\n(.*?)```", card, re.DOTALL).group(1), names)
    assert names["states"].shape == names["actions"].shape == (20, 12)
    assert names["attributes"]["motion"]["licence"] == ORIGINS["one"]["licence"]


@both_formats
def test_only_the_motions_that_are_named_are_exported(store, form, tmp_path):
    record = export_dataset(store, form, tmp_path / "out", ["two"])
    assert (record.motions, record.trajectories, record.rows) == (("two",), 3, 55)
    kept = json.loads((tmp_path / "out" / "export.json").read_text())
    assert (kept["format"], kept["dataset"], kept["motions"]) == (form, "dataset.zarr", ["two"])


@both_formats
def test_an_export_that_fails_leaves_nothing(store, form, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(export_module, "dataset_card", fail)
    with pytest.raises(OSError, match="No space"):
        export_dataset(store, form, tmp_path / "deep" / "out")
    assert list((tmp_path / "deep").iterdir()) == []


@both_formats
def test_an_older_export_stays_unless_it_may_be_replaced(store, form, tmp_path, monkeypatch):
    out = tmp_path / "out"
    export_dataset(store, form, out)
    with pytest.raises(ExportError, match="holds an export already; replace it with --overwrite"):
        export_dataset(store, form, out, ["two"])
    assert len(json.loads((out / "export.json").read_text())["motions"]) == 2
    export_dataset(store, form, out, ["two"], overwrite=True)
    assert len(json.loads((out / "export.json").read_text())["motions"]) == 1
    monkeypatch.setattr(export_module, "dataset_card", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        export_dataset(store, form, out, overwrite=True)
    assert len(json.loads((out / "export.json").read_text())["motions"]) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dataset.zarr", "out"]


def test_a_folder_with_other_things_is_never_replaced(store, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("all of it")
    with pytest.raises(ExportError, match="exists and is no export"):
        export_dataset(store, "npz", tmp_path / "mine", overwrite=True)
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match="exists and is no export"):
        export_dataset(store, "npz", tmp_path / "file", overwrite=True)
    (tmp_path / "empty").mkdir()
    export_dataset(store, "npz", tmp_path / "empty")
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "all of it"


def test_whatever_else_is_stored_once_a_trajectory_goes_along(store, tmp_path):
    masses = np.arange(6, dtype=np.float32).reshape(3, 2)
    for motion in ORIGINS:
        group = zarr.open_group(store / motion, mode="a", use_consolidated=False).create_group("bodies")
        spec = ArraySpec("mass", ("trajectory", "body"), "kg", "mass of some bodies")
        write_array(group, spec, masses)
        consolidate(store / motion)
    card = card_of(store, "npz", tmp_path / "npz")
    assert "| `bodies/mass` | trajectory x body | kg | mass of some bodies |" in card
    with np.load(tmp_path / "npz" / "two" / "trajectory-0001.npz", allow_pickle=False) as file:
        np.testing.assert_array_equal(file["bodies/mass"], masses[1])
    card_of(store, "lerobot", tmp_path / "lerobot")
    episodes = pq.read_table(tmp_path / "lerobot" / "meta" / "episodes")
    assert episodes["kine2go/bodies/mass"].to_pylist() == masses.tolist() * 2


def test_progress_counts_trajectories(store, tmp_path):
    seen = []
    export_dataset(store, "npz", tmp_path / "out", (), False, lambda done, total: seen.append((done, total)))
    assert seen == [(number, 6) for number in range(1, 7)]


def test_the_command_exports_beside_the_dataset(store, capsys):
    assert main(["export", str(store)]) == 0
    assert "6 trajectories of 2 motions, 110 rows" in capsys.readouterr().out
    assert (store.parent / "dataset-lerobot" / "meta" / "info.json").is_file()
    assert main(["export", str(store), "one", "--format", "npz"]) == 0
    assert (store.parent / "dataset-npz" / "one").is_dir()
    assert not (store.parent / "dataset-npz" / "two").exists()


def test_a_dataset_may_be_the_folder_one_stands_in(store, monkeypatch):
    monkeypatch.chdir(store)
    assert main(["export", ".", "--format", "npz"]) == 0
    assert (store.parent / "dataset-npz" / "README.md").is_file()


BAD_INPUT = {
    "no dataset": (["nowhere.zarr"], "no dataset here"),
    "unknown motion": (["dataset.zarr", "three"], "holds no motion 'three'; it has: one, two"),
    "unknown format": (["dataset.zarr", "--format", "csv"], "unknown format 'csv'; known are: lerobot, minari, "),
    "a folder without a name": (["dataset.zarr", "--out", "."], "give it a name with --out"),
    "no export to replace": (["dataset.zarr", "--out", "dataset.zarr", "--overwrite"], "exists and is no export"),
}


@pytest.mark.parametrize("case", BAD_INPUT)
def test_wrong_input_is_explained_in_one_line(case, store, monkeypatch, capsys):
    arguments, message = BAD_INPUT[case]
    monkeypatch.chdir(store.parent)
    assert main(["export", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("kine2go: error: ")
    assert message in error
    assert len(error.splitlines()) == 1
    assert [path.name for path in store.parent.iterdir()] == [store.name]
