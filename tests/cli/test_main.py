"""The command line as a person meets it: help, one-line errors, exit statuses, nothing half-written."""

import errno
import json
import os
import resource
import signal
import subprocess
import sys
from contextlib import suppress

import pytest
import torch

from kine2go_warp import __version__
from kine2go_warp.cli.data import DATA_VARIABLE
from kine2go_warp.cli.main import COMMANDS, GROUPS, OLD_NAMES, main
from kine2go_warp.errors import explain
from tests.conftest import ANYTHING_GOES, COMMITTED_CLIP

KINE2GO = [sys.executable, "-c", "from kine2go_warp.cli.main import entry_point; entry_point()"]


def kine2go(*arguments, cwd, **options):
    environment = {name: value for name, value in os.environ.items() if name != DATA_VARIABLE}
    return subprocess.run(
        [*KINE2GO, *map(str, arguments)],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        **options,
    )


NAMES = ["", *GROUPS, *COMMANDS, *OLD_NAMES]


@pytest.mark.parametrize("command", dict.fromkeys(NAMES))
def test_every_command_explains_itself(command, capsys):
    with suppress(SystemExit):
        assert main([*command.split(), "--help"]) == 0
    assert "usage: kine2go" in capsys.readouterr().out


def test_the_bare_command_shows_what_to_do_first(capsys):
    assert main([]) == 0
    assert "kine2go demo" in capsys.readouterr().out


def test_the_version_is_that_of_the_package(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"kine2go {__version__}\n"


def test_the_package_runs_as_a_module(tmp_path):
    command = [sys.executable, "-m", "kine2go_warp", "--version"]
    assert subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout.startswith(
        "kine2go"
    )


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        ("trian", "did you mean 'policy train'?"),
        ("datset check", "did you mean 'dataset'?"),
        ("dataset scroe", "did you mean 'dataset score'?"),
        ("xyzzy", "'kine2go --help' lists all"),
    ],
)
def test_a_mistyped_command_gets_a_suggestion(arguments, hint, capsys):
    assert main(arguments.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("kine2go: error: unknown command")
    assert hint in line


def test_an_old_name_works_and_a_person_gets_to_know_the_new_one(capsys, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    assert main(["sources", "list"]) == 0
    assert capsys.readouterr().err == "kine2go: 'sources' is now 'motion sources'; the old name still works\n"
    assert main(["doctor"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("arguments", ["--help", "motion sources list"])
def test_output_that_nobody_reads_ends_quietly(arguments, tmp_path):
    """The reader closes the pipe before the command writes."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [*KINE2GO, *arguments.split()]
    result = subprocess.run(command, cwd=tmp_path, stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert (result.returncode, result.stderr) == (141, "")


def test_a_missing_package_is_named_with_its_extra(capsys, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "placo", None)
    monkeypatch.delitem(sys.modules, "kine2go_warp.motions.inverse_kinematics", raising=False)
    assert main(["motion", "retarget", "dog_trot", "--out", str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "placo is not installed" in line
    assert "kine2go-warp[retarget]" in line


@pytest.mark.parametrize("error", [torch.OutOfMemoryError("CUDA out of memory"), RuntimeError("Failed to allocate 9")])
def test_memory_that_is_used_up_is_one_line(capsys, monkeypatch, error):
    def measure(*_):
        raise error

    monkeypatch.setattr("kine2go_warp.bench.environment.bench_environment", measure)
    assert main(["bench", "env", "--clip", str(COMMITTED_CLIP), "--device", "cpu"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "out of memory; try half as many worlds" in line.lower()


def test_a_defect_is_not_taken_for_a_lack_of_memory(monkeypatch):
    def measure(*_):
        raise RuntimeError("illegal address")

    monkeypatch.setattr("kine2go_warp.bench.environment.bench_environment", measure)
    with pytest.raises(RuntimeError, match="illegal address"):
        main(["bench", "env", "--clip", str(COMMITTED_CLIP), "--device", "cpu"])


BAD_INPUT = {
    "unknown motion": ("retarget wolf", "unknown motion 'wolf'"),
    "no motion": ("retarget", "name at least one motion"),
    "no data folder": ("retarget ai4_dog_pace", "--data"),
    "missing data folder": ("retarget ai4_dog_pace --data nowhere", "no such folder"),
    "missing motion file": ("retarget ai4_dog_pace --data .", "no such motion file"),
    "missing clip": ("train clip.npz", "no such clip"),
    "no clip": ("train", "name at least one clip"),
    "ablation of a missing clip": ("ablate clip.npz", "no such clip"),
    "export of no clip": ("motion export --out here", "name at least one clip"),
    "ablation of one clip twice": (
        f"ablate {COMMITTED_CLIP} {COMMITTED_CLIP}",
        "two clips are named 'dog_trot'",
    ),
    "ablation of no clip": ("ablate", "name at least one clip"),
    "an unknown variant": ("ablate clip.npz --variants luck", "unknown variant 'luck'; known are: fast, default_pose"),
    "ablation of no seeds": ("ablate clip.npz --seeds 0", "seeds"),
    "wrong clip": ("train wrong.npz", "not a clip"),
    "folder for a clip": ("train .", "not a clip"),
    "missing policy": ("gather policy", "no policy here"),
    "evaluation of nothing": ("eval policy", "no policy here"),
    "evaluation of no worlds": ("eval policy --worlds 0", "worlds is 0; it must be from 1"),
    "export of nothing": ("export-policy policy", "no policy here"),
    "sim2sim of nothing": ("sim2sim policy", "no policy here"),
    "missing recipe": ("run recipe.toml", "no such recipe"),
    "wrong recipe": ("run wrong.toml", "unknown key"),
    "recipe without data": ("run smoke", "--data"),
    "cycles of nothing": ("cycles dog.txt", "no such motion file"),
    "cycles of an unknown source": ("cycles dog.txt --source cat", "known are: ai4animation, ai4animation_bvh, amp"),
    "cycles of a wrong length": ("cycles dog.txt --shortest 2 --longest 1", "shortest <= longest"),
    "fetch from nowhere": ("sources fetch", "needs --url"),
    "sources of an unknown motion": ("sources check wolf", "unknown motion"),
    "no iterations": ("train clip.npz --iterations 0", "iterations is 0; it must be from 1"),
}


@pytest.mark.parametrize("case", BAD_INPUT, ids=lambda case: case.replace(" ", "-"))
def test_bad_input_gets_one_line_status_2_and_nothing_written(case, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(DATA_VARIABLE, raising=False)
    arguments, message = BAD_INPUT[case]
    (tmp_path / "wrong.npz").write_text("no clip")
    (tmp_path / "wrong.toml").write_text("name = 'a'\nmotions = ['dog_trot']\ncolour = 'red'\n")
    before = sorted(path.name for path in tmp_path.rglob("*"))
    assert main(arguments.split()) == 2
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert line.startswith("kine2go: error: ")
    assert message in line
    assert sorted(path.name for path in tmp_path.rglob("*")) == before


def test_an_unknown_option_ends_with_status_2(tmp_path):
    result = kine2go("demo", "--speed", "9", cwd=tmp_path)
    assert result.returncode == 2
    assert "Traceback" not in result.stderr


def test_a_device_that_is_not_there_is_named(clip, tmp_path):
    clip.save(tmp_path / "clip.npz")
    result = kine2go("train", "clip.npz", "--device", "cuda:77", cwd=tmp_path)
    assert result.returncode == 2
    assert "no device 'cuda:77' on this machine" in result.stderr
    assert not (tmp_path / "runs").exists()


def limit_files_to(size):
    """Make every write beyond a size fail, as on a disk that is full."""

    def apply():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return apply


def test_a_disk_that_is_full_leaves_nothing_half_written(tmp_path):
    result = kine2go("retarget", "dog_trot", "--out", ".", cwd=tmp_path, preexec_fn=limit_files_to(2000))
    assert result.returncode == 2, result.stderr
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    assert list(tmp_path.iterdir()) == []


LIMITS = [(f"--{name.replace('_', '-')}", str(value)) for name, value in ANYTHING_GOES.items()]
LOOSE = ["--trajectories", "3", "--rows", "20", *(word for limit in LIMITS for word in limit)]


@pytest.mark.faults
def test_a_disk_that_fills_up_during_gathering_keeps_the_dataset(policy, tmp_path):
    def files():
        return {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    command = ["gather", policy.path, *LOOSE, "--device", "cpu", "--out", "data.zarr"]
    first = kine2go(*command, cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    before = files()
    result = kine2go(*command, "--seed", "2", cwd=tmp_path, preexec_fn=limit_files_to(20_000))
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    assert result.stderr.strip().splitlines()[-1].startswith("kine2go: error: ")
    assert files() == before


def test_errors_of_the_file_system_say_what_to_do():
    assert "no space left on the disk" in explain(OSError(errno.ENOSPC, "No space left on device", "runs/a"))
    assert explain(PermissionError(errno.EACCES, "Permission denied", "/root/x")).startswith("/root/x: no permission")


def test_sources_are_listed_and_checked(tmp_path):
    listed = kine2go("sources", "list", cwd=tmp_path)
    assert listed.returncode == 0
    assert "solo8_crawl_fast" in listed.stdout
    assert "CC BY-SA 4.0" in listed.stdout
    assert "No jump: a second ellipse walk" in listed.stdout
    checked = kine2go("sources", "check", "dog_trot", "ai4_dog_pace", cwd=tmp_path)
    assert checked.returncode == 2
    assert "whole" in checked.stdout
    assert "missing" in checked.stdout
    assert "1 of 2 files missing or damaged; name the folder of source clips with --data" in checked.stderr
    assert kine2go("sources", "check", "dog_trot", cwd=tmp_path).returncode == 0


def test_fetching_shows_the_licence_and_asks_first(tmp_path):
    (tmp_path / "data").mkdir()
    command = ["sources", "fetch", "ai4_dog_pace", "--url", "http://127.0.0.1:1", "--data", "data"]
    result = kine2go(*command, cwd=tmp_path, input="n\n")
    assert result.returncode == 2
    assert "CC BY-NC 4.0" in result.stdout
    assert "not accepted" in result.stderr
    agreed = kine2go(*command, "--yes", cwd=tmp_path)
    assert agreed.returncode == 2
    assert "cannot be fetched" in agreed.stderr


def test_cycles_of_the_bundled_motion_are_whole_strides(tmp_path):
    from kine2go_warp.motions.catalogue import motion_named

    result = kine2go("cycles", motion_named("dog_trot").path(None), "--count", "3", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "0.50 s" in result.stdout


def test_retargeting_leaves_clips_a_report_and_pictures(tmp_path):
    result = kine2go("retarget", "--all", "--sheets", "--markdown", "table.md", "--out", "clips", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "not there: ai4_dog_canter" in result.stdout
    assert sorted(path.name for path in (tmp_path / "clips").iterdir()) == [
        "dog_trot.npz",
        "dog_trot.png",
        "report.json",
    ]
    report = json.loads((tmp_path / "clips" / "report.json").read_text())
    assert report[0]["name"] == "dog_trot"
    assert report[0]["remarks"] == []
    assert (tmp_path / "clips" / "dog_trot.png").read_bytes().startswith(b"\x89PNG")
    assert "| `dog_trot` |" in (tmp_path / "table.md").read_text()


def test_one_bad_motion_does_not_keep_the_others_from_being_saved(tmp_path):
    (tmp_path / "data" / "ai4animation").mkdir(parents=True)
    (tmp_path / "data" / "ai4animation" / "dog_walk00_joint_pos.txt").write_text("no dog\n" * 9)
    result = kine2go("retarget", "dog_trot", "ai4_dog_pace", "--data", "data", "--out", "clips", cwd=tmp_path)
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert "ai4_dog_pace" in result.stderr
    assert (tmp_path / "clips" / "dog_trot.npz").is_file()


def test_bench_measures_both_modes(tmp_path):
    result = kine2go("bench", "retarget", "--repeats", "1", "--json", cwd=tmp_path)
    (report,) = json.loads(result.stdout)
    assert report["stage"] == "retarget"
    rates = {figure["name"]: figure["median"] for figure in report["measurements"]}
    assert set(rates) == {"plain", "contact"}
    assert rates["contact"] > 0.0
    assert report["machine"]["kine2go-warp"]


@pytest.mark.slow
def test_bench_of_environment_and_training_accounts_for_all_the_time(tmp_path):
    arguments = "bench env train --device cpu --num-worlds 64 --processes 2 --steps 4 --repeats 2 --json"
    result = kine2go(*arguments.split(), cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    env, training = (
        {row["name"]: row["median"] for row in report["measurements"]} for report in json.loads(result.stdout)
    )
    assert env["share of physics"] + env["share of kernels"] == pytest.approx(1.0)
    assert env["environment / MuJoCo C"] == pytest.approx(env["environment"] / env["MuJoCo C"], rel=0.5)
    assert env["processes / one process"] > 0.5
    shares = ("share of environment", "share of policy", "share of PPO update")
    assert sum(training[share] for share in shares) == pytest.approx(1.0, abs=0.1)


def test_bench_without_a_stage_says_which_there_are(capsys):
    assert main(["bench"]) == 2
    assert "env, train, retarget, gather, load" in capsys.readouterr().err


def test_doctor_lists_devices_and_motions(capsys):
    assert main(["doctor"]) == 0
    output = capsys.readouterr().out
    assert "cpu" in output
    assert "dog_trot" in output
    assert "verdict: ready" in output


def test_an_interruption_ends_with_status_130(monkeypatch, capsys):
    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("kine2go_warp.cli.commands.Doctor.run", interrupt)
    assert main(["doctor"]) == 130
    assert "nothing finished is lost" in capsys.readouterr().err


def test_an_unwritable_kernel_cache_is_named_with_the_variable_that_moves_it(clip, tmp_path):
    clip.save(tmp_path / "clip.npz")
    (tmp_path / "file").write_text("no folder")
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path / "file" / "cache")}
    for arguments in ("train clip.npz --out policy", "doctor"):
        result = subprocess.run(
            [*KINE2GO, *arguments.split()], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        text = result.stderr if result.returncode == 2 else result.stdout
        assert "WARP_CACHE_PATH" in text
        assert str(tmp_path / "file" / "cache") in text
    assert result.returncode == 1
    assert result.stdout.splitlines()[-1] == "verdict: not ready"
    assert not (tmp_path / "policy").exists()
