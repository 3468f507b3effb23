"""``kine2go dataset check`` as a person meets it: tables, JSON, exit statuses; one line for whatever is no dataset."""

import json
import os
import shutil

import pytest
import zarr

from kine2go_warp.cli.check_command import FEW, print_report
from kine2go_warp.cli.main import main
from kine2go_warp.dataset.checks.records import Finding, Report, Result
from tests.cli.test_main import kine2go


def opened(dataset):
    return zarr.open_group(dataset / "dog_trot", mode="r+", use_consolidated=False)


def test_a_clean_dataset_ends_with_status_0(dataset_copy, capsys):
    assert main(["check", str(dataset_copy)]) == 0
    output = capsys.readouterr().out
    assert "forward kinematics" in output
    assert "clean; 72 checks hold, 0 do not" in output
    assert main(["check", str(dataset_copy), "dog_trot"]) == 0


def test_findings_end_with_status_1_and_a_line_that_says_where_and_how_bad(dataset_copy, capsys):
    array = opened(dataset_copy)["joint_position"]
    array[3, 17, 2] = 0.5
    assert main(["check", str(dataset_copy)]) == 1
    output = capsys.readouterr().out
    assert "wrong: dog_trot/joint_position, trajectory 3, row 17: beyond the joint limits by" in output
    assert "not clean" in output


def test_a_fault_of_many_trajectories_is_one_line_and_explained(dataset_copy, capsys):
    array = opened(dataset_copy)["joint_velocity"]
    array[...] = 57.29578 * array[...]
    assert main(["check", str(dataset_copy)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert len([line for line in lines if "does not explain how joint_position changes" in line]) == 2
    assert any("4 more trajectories" in line for line in lines)
    assert any(line.startswith("likely: dog_trot: it looks as if joint_velocity is in degrees") for line in lines)


def test_json_holds_every_finding(dataset_copy, capsys):
    opened(dataset_copy)["heading"][1] = 0.123
    assert main(["check", str(dataset_copy), "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["clean"] is False
    assert {"check": "padding", "motion": "dog_trot", "state": "ok"} in report["results"]
    found = next(one for one in report["findings"] if one["check"] == "reference heading")
    assert (found["motion"], found["array"], found["trajectory"]) == ("dog_trot", "reference_root_orientation", 1)
    assert found["value"] > found["tolerance"]


def test_values_that_are_not_finite_are_valid_json(dataset_copy, capsys):
    opened(dataset_copy)["root_position"][1, 5] = float("inf")
    assert main(["check", str(dataset_copy), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["clean"] is False


def test_an_unknown_array_is_a_remark_and_no_fault(dataset_copy, capsys):
    opened(dataset_copy).create_array("mass", shape=(5,), dtype="f4")
    zarr.consolidate_metadata(str(dataset_copy / "dog_trot"))
    zarr.consolidate_metadata(str(dataset_copy))
    assert main(["check", str(dataset_copy)]) == 0
    assert "remark: dog_trot/mass: an array that the schema does not know" in capsys.readouterr().out


def test_a_damaged_motion_does_not_keep_the_others_from_being_checked(dataset_copy, capsys):
    shutil.copytree(dataset_copy / "dog_trot", dataset_copy / "broken")
    (dataset_copy / "broken" / "zarr.json").write_text("{")
    assert main(["check", str(dataset_copy)]) == 1
    output = capsys.readouterr().out
    assert "wrong: broken: cannot be opened" in output
    assert "wrong: dog_trot" not in output


def test_the_same_motion_under_two_names_is_found(dataset_copy, capsys):
    shutil.copytree(dataset_copy / "dog_trot", dataset_copy / "dog_trot_again")
    assert main(["check", str(dataset_copy)]) == 1
    assert "has the same rows as trajectory 0 of dog_trot" in capsys.readouterr().out


def spoil_metadata(path, text):
    (path / "zarr.json").write_text(text)


def spoil_shard(path):
    shard = next(one for one in (path / "dog_trot" / "action" / "c").rglob("*") if one.is_file())
    shard.write_bytes(shard.read_bytes()[:100])


UNUSABLE = {
    "a plain folder": (lambda path: shutil.rmtree(path) or path.mkdir(), "holds no zarr.json"),
    "a file": (lambda path: shutil.rmtree(path) or path.write_text("data"), "a dataset is a folder and this is a file"),
    "nothing": (shutil.rmtree, "no dataset here, nor anything else"),
    "corrupt metadata": (lambda path: spoil_metadata(path, "{"), "not a Zarr store that can be read"),
    "empty metadata": (lambda path: spoil_metadata(path, ""), "not a Zarr store that can be read"),
    "attributes of another kind": (
        lambda path: spoil_metadata(path, '{"zarr_format": 3, "node_type": "group", "attributes": [1]}'),
        "not a Zarr store that can be read",
    ),
    "metadata of another kind": (lambda path: spoil_metadata(path, "[1]"), "not a Zarr store that can be read"),
    "binary metadata": (lambda path: (path / "zarr.json").write_bytes(b"\xff\xfe\x00"), "not a Zarr store"),
    "another Zarr store": (
        lambda path: shutil.rmtree(path) or zarr.open_group(path, mode="w", zarr_format=3),
        "a Zarr store, but not a dataset of kine2go",
    ),
    "an older format": (
        lambda path: zarr.open_group(path, mode="a").attrs.update({"format_version": "0.0"}),
        "dataset format 0.0; this version reads and writes",
    ),
    "a newer format": (
        lambda path: zarr.open_group(path, mode="a").attrs.update({"format_version": "99"}),
        "gather the data again, or use the version that wrote it",
    ),
    "an empty dataset": (lambda path: shutil.rmtree(path / "dog_trot"), "a dataset without motions"),
}  # fmt: skip


@pytest.mark.parametrize("case", UNUSABLE, ids=lambda case: case.replace(" ", "-"))
def test_what_is_no_dataset_gets_one_line_and_status_2(case, dataset_copy, capsys):
    spoil, message = UNUSABLE[case]
    spoil(dataset_copy)
    assert main(["check", str(dataset_copy)]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    lines = output.err.strip().splitlines()
    assert len(lines) == 1, output.err
    assert lines[0].startswith(f"kine2go: error: {dataset_copy}: ")
    assert message in lines[0]


def test_an_unknown_motion_is_told_which_there_are(dataset_copy, capsys):
    assert main(["check", str(dataset_copy), "cat_trot"]) == 2
    assert "holds no motion 'cat_trot'; it has: dog_trot" in capsys.readouterr().err


def test_a_motion_given_for_a_dataset_is_told_where_the_dataset_is(dataset_copy, capsys):
    assert main(["check", str(dataset_copy / "dog_trot")]) == 2
    assert f"name the dataset itself, {dataset_copy}" in capsys.readouterr().err


def test_the_present_folder_can_be_the_dataset(dataset_copy, monkeypatch):
    monkeypatch.chdir(dataset_copy)
    assert main(["check", "."]) == 0


DAMAGED = {
    "truncated shard": (spoil_shard, "dog_trot/action: cannot be read"),
    "missing array": (lambda path: shutil.rmtree(path / "dog_trot" / "action"), "action: this array is missing"),
    "corrupt metadata": (
        lambda path: (path / "dog_trot" / "action" / "zarr.json").write_text("{"),
        "dog_trot/action: its metadata cannot be read",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", DAMAGED, ids=lambda case: case.replace(" ", "-"))
def test_a_damaged_array_is_named_in_one_line_without_a_traceback(case, dataset_copy, tmp_path):
    spoil, message = DAMAGED[case]
    spoil(dataset_copy)
    result = kine2go("check", dataset_copy, cwd=tmp_path)
    assert result.returncode == 1, result.stderr
    assert result.stderr == ""
    lines = [line for line in result.stdout.splitlines() if line.startswith("wrong: ") and message in line]
    assert len(lines) == 1, result.stdout


def refuse(monkeypatch, name):
    """Make the operating system refuse one folder, as it does with another user's, but never to root."""
    for function in ("stat", "scandir", "open", "listdir"):
        whole = getattr(os, function)

        def guarded(path, *arguments, whole=whole, **options):
            if isinstance(path, str | os.PathLike) and name in os.fspath(path):
                raise PermissionError(13, "Permission denied", os.fspath(path))
            return whole(path, *arguments, **options)

        monkeypatch.setattr(os, function, guarded)


def test_a_folder_that_may_not_be_read_gets_one_line_and_status_2(dataset_copy, monkeypatch, capsys):
    refuse(monkeypatch, dataset_copy.name)
    assert main(["check", str(dataset_copy)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert "no permission to write or read here" in lines[0]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_motion_that_may_not_be_read_is_found(dataset_copy, capsys):
    (dataset_copy / "dog_trot").chmod(0)
    try:
        assert main(["check", str(dataset_copy)]) in (1, 2)
    finally:
        (dataset_copy / "dog_trot").chmod(0o755)
    assert "Traceback" not in capsys.readouterr().err


def test_many_motions_get_a_line_each(capsys):
    motions = tuple(f"motion_{number}" for number in range(FEW + 1))
    results = tuple(Result("padding", motion, "ok") for motion in motions[1:])
    found = Finding("padding", motions[0], "values beyond the trajectory's length:", "phase", 2, 9, 1.0, 0.0)
    print_report(Report("all.zarr", motions, (Result("padding", motions[0], "failed"), *results), (found,)))
    output = capsys.readouterr().out
    assert all(motion in output for motion in motions)
    assert "motion_0/phase, trajectory 2, row 9: values beyond the trajectory's length: 1 (at most 0)" in output
    assert "3 checks hold, 1 do not" in output


def test_other_commands_say_what_check_found_in_this_content(dataset_copy, tmp_path, capsys):
    def said(*command):
        capsys.readouterr()
        assert main([*command]) == 0
        output = capsys.readouterr()
        return " ".join((output.out + output.err).split())

    quality, score = ("quality", str(dataset_copy)), ("score", str(dataset_copy))
    export = ("export", str(dataset_copy), "--format", "npz", "--out", str(tmp_path / "out"), "--overwrite")
    for command in (quality, score, export):
        assert "not checked since the data were written: dog_trot" in said(*command)
    assert main(["check", str(dataset_copy)]) == 0
    for command in (quality, score, export):
        assert "check" not in said(*command)
    opened(dataset_copy)["noise"][1] = 7.0
    assert "not checked since the data were written: dog_trot" in said(*quality)
    assert main(["check", str(dataset_copy)]) == 1
    for command in (quality, score, export):
        assert "'kine2go dataset check' found faults in dog_trot (draws, noise level" in said(*command)


def test_physics_is_checked_on_request(dataset_copy, capsys):
    assert main(["check", str(dataset_copy), "--physics"]) == 0
    assert "clean; 73 checks hold, 0 do not" in capsys.readouterr().out
