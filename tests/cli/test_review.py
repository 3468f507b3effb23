"""``kine2go dataset review`` as a person meets it."""

import os
import pty
import select
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from PIL import Image

from kine2go_warp.cli.main import main
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import FILE, read_reviews, standing_reviews
from kine2go_warp.recordings.viewer import free_ports, stream_address

PROGRAM = [sys.executable, "-c", "from kine2go_warp.cli.main import entry_point; entry_point()"]


def failing(capsys, *arguments):
    """Run a command that must fail, and return its one line."""
    assert main(["review", *map(str, arguments)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    return lines[0]


def stepping(dataset, keys, *options):
    """Step through a dataset with keys from a pipe, one a line, and return what was shown."""
    command = [*PROGRAM, "review", str(dataset), "--step", "--who", "Ada", *options]
    result = subprocess.run(command, input=keys, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def said(dataset):
    return [(one.index, one.verdict, one.reason) for one in read_reviews(dataset)]


def shown_order(output):
    """The trajectories in the order in which they were shown."""
    return [int(line.split()[1].split("/")[1]) for line in output.splitlines() if line.startswith("[")]


def test_recordings_are_written_once_and_only_what_is_missing(dataset_copy, capsys):
    assert main(["review", str(dataset_copy), "--save"]) == 0
    path = dataset_copy.parent / "recordings" / "dog_trot.rrd"
    assert f"{path}: 5 trajectories" in capsys.readouterr().out
    before = path.stat().st_mtime_ns
    assert main(["review", str(dataset_copy), "dog_trot", "--save"]) == 0
    assert "up to date" in capsys.readouterr().out
    assert path.stat().st_mtime_ns == before


def test_options_choose_folder_and_number(dataset_copy, tmp_path, capsys):
    out = tmp_path / "elsewhere"
    assert main(["review", str(dataset_copy), "--save", "--out", str(out), "--trajectories", "2"]) == 0
    assert "2 trajectories" in capsys.readouterr().out
    assert (out / "dog_trot.rrd").is_file()


def test_a_clip_is_recorded_beside_itself(clip, tmp_path, capsys):
    clip.save(tmp_path / "dog_trot.npz")
    assert main(["review", str(tmp_path / "dog_trot.npz"), "--save"]) == 0
    assert (tmp_path / "recordings" / "dog_trot_clip.rrd").is_file()
    assert "written" in capsys.readouterr().out


def test_verdicts_by_option_stand_for_a_trajectory_or_a_whole_motion(dataset_copy, capsys):
    assert main(["review", str(dataset_copy), "--accept", "dog_trot", "--who", "Ada"]) == 0
    assert "5 trajectories accepted" in capsys.readouterr().out
    arguments = ["--reject", "dog_trot/1", "dog_trot/3", "--why", "drags a leg", "--who", "Ada"]
    assert main(["review", str(dataset_copy), *arguments]) == 0
    standing = standing_reviews(Motion(dataset_copy, "dog_trot"))
    assert [one.verdict for one in standing.values()] == ["accepted", "rejected", "accepted", "rejected", "accepted"]
    assert {one.reviewer for one in standing.values()} == {"Ada"}


def test_scores_leave_rejected_trajectories_out_and_say_so(dataset_copy, capsys):
    assert main(["review", str(dataset_copy), "--reject", "dog_trot/1", "--why", "falls"]) == 0
    assert main(["score", str(dataset_copy)]) == 0
    assert "left out 1 of 5 trajectories" in capsys.readouterr().out
    assert main(["review", str(dataset_copy), "--reject", "dog_trot", "--why", "falls"]) == 0
    capsys.readouterr()
    assert main(["score", str(dataset_copy)]) == 2
    assert "nothing is left to score" in capsys.readouterr().err


def test_keys_accept_reject_skip_and_quit(dataset_copy):
    output = stepping(dataset_copy, "a\nr\ndrags a leg\ns\nq\n")
    order = shown_order(output)
    assert len(order) == 4
    assert said(dataset_copy) == [(order[0], "accepted", ""), (order[1], "rejected", "drags a leg")]
    assert "1 accepted, 1 rejected, 1 skipped, 2 not looked at" in output
    for figure in ("root distance", "joint RMSE", "noise ", "foot error [m]"):
        assert figure in output


def test_those_closest_to_a_limit_come_first_and_those_with_a_verdict_not_again(dataset_copy):
    whole = shown_order(stepping(dataset_copy, "s\ns\ns\ns\ns\n"))
    shares = [line for line in stepping(dataset_copy, "s\ns\ns\ns\ns\n").splitlines() if "limit usage " in line]
    figures = [int(line.partition("limit usage ")[2].split("%")[0]) for line in shares]
    assert sorted(whole) == [0, 1, 2, 3, 4]
    assert figures == sorted(figures, reverse=True)
    stepping(dataset_copy, "a\nq\n")
    assert shown_order(stepping(dataset_copy, "")) == [whole[1]]
    assert shown_order(stepping(dataset_copy, "", "--again")) == [whole[0]]


def test_undo_takes_a_verdict_back_and_returns_to_its_trajectory(dataset_copy):
    output = stepping(dataset_copy, "u\na\nr\nlimps\nu\ns\nu\nu\nr\nfalls\nq\n")
    first, second = shown_order(output)[:2]
    # Nothing to undo; accept 1, reject 2, undo 2, skip 2, undo the skip, undo 1, reject 1, quit at 2.
    assert shown_order(output) == [
        first,
        second,
        shown_order(output)[2],
        second,
        shown_order(output)[2],
        second,
        first,
        second,
    ]
    assert "nothing to undo" in output
    assert said(dataset_copy) == [(first, "rejected", "falls")]


def test_a_rejection_needs_a_reason_and_other_keys_show_the_help(dataset_copy):
    output = stepping(dataset_copy, "x\n\nr\n\nr\nlimps\nq\n")
    assert "needs a reason" in output
    assert output.count("a accept, r reject") == 3
    assert [(verdict, why) for _, verdict, why in said(dataset_copy)] == [("rejected", "limps")]


def test_the_end_of_the_input_ends_the_steps(dataset_copy):
    assert "1 accepted, 0 rejected, 0 skipped, 4 not looked at" in stepping(dataset_copy, "a\n")
    assert "0 accepted, 0 rejected" in stepping(dataset_copy, "r\n")


def test_in_a_terminal_one_key_is_enough(dataset_copy):
    ours, theirs = pty.openpty()
    command = [*PROGRAM, "review", str(dataset_copy), "--step", "--who", "Ada"]
    process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, close_fds=True)
    os.close(theirs)
    output = ""
    for keys, prompt in (("a", "> "), ("r", "> "), ("drags a leg\n", "why: "), ("q", "> ")):
        output += read_until(ours, prompt)
        os.write(ours, keys.encode())
    output += read_until(ours, "not looked at")
    assert process.wait(30) == 0
    os.close(ours)
    assert [(verdict, why) for _, verdict, why in said(dataset_copy)] == [("accepted", ""), ("rejected", "drags a leg")]


def read_until(terminal, text, limit=60.0):
    """Read from a terminal until some text is there."""
    seen, end = "", time.monotonic() + limit
    while text not in seen:
        ready, _, _ = select.select([terminal], [], [], max(0.0, end - time.monotonic()))
        assert ready, seen
        seen += os.read(terminal, 1024).decode()
    return seen


def test_without_a_display_the_viewer_is_not_opened(dataset_copy, capsys, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert "--web" in failing(capsys, dataset_copy)
    assert not (dataset_copy.parent / "recordings").exists()


def test_wrong_input_gets_one_line_and_leaves_no_verdict(dataset_copy, clip, tmp_path, capsys):
    clip.save(tmp_path / "trot.npz")
    (tmp_path / "file.npz").write_text("no clip")
    (tmp_path / "note.txt").write_text("no dataset")
    faults = {
        ("--reject", "dog_trot/1"): "--why",
        ("--reject", "dog_trot/1", "--why", "  "): "--why",
        ("--reject", "wolf", "--why", "x"): "holds no motion 'wolf'",
        ("--reject", "dog_trot/5", "--why", "x"): "5, 0 to 4",
        ("--reject", "dog_trot/first", "--why", "x"): "no trajectory 'dog_trot/first'",
        ("--accept", "dog_trot/1", "--reject", "dog_trot/1", "--why", "x"): "both accepted and rejected",
        ("--accept", "dog_trot/1", "--step"): "not both",
        ("wolf", "--save"): "holds no motion 'wolf'",
        ("wolf", "--step"): "holds no motion 'wolf'",
        ("--save", "--trajectories", "0"): "at least 1",
        ("--save", "--meshes", tmp_path / "nowhere"): "no such folder of meshes",
        ("--save", "--out", tmp_path / "note.txt"): "is a file",
    }
    for arguments, message in faults.items():
        assert message in failing(capsys, dataset_copy, *arguments)
    assert "a clip has neither" in failing(capsys, tmp_path / "trot.npz", "--step")
    assert "not a clip" in failing(capsys, tmp_path / "file.npz", "--save")
    assert "no such clip" in failing(capsys, tmp_path / "missing.npz", "--save")
    assert "no dataset here" in failing(capsys, tmp_path / "missing.zarr", "--save")
    assert "no dataset here" in failing(capsys, tmp_path / "missing.zarr", "--reject", "dog_trot", "--why", "x")
    assert not (dataset_copy / FILE).exists()
    assert not (tmp_path / "recordings").exists()


def test_help_is_quick_and_needs_no_viewer():
    code = "import sys; sys.modules['rerun'] = None; from kine2go_warp.cli.main import main; main(['review', '--help'])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "--reject" in result.stdout


def test_a_dataset_copied_without_its_recordings_makes_its_own(dataset_copy, tmp_path, capsys):
    other = Path(shutil.copytree(dataset_copy, tmp_path / "other" / "dataset.zarr"))
    assert main(["review", str(other), "--save", "--trajectories", "1"]) == 0
    assert (other.parent / "recordings" / "dog_trot.rrd").is_file()
    assert capsys.readouterr().out.count("written") == 1


def test_the_most_doubtful_are_shown_by_any_metric(dataset_copy, capsys):
    (motion,) = [Motion(dataset_copy, "dog_trot")]
    slip = {one.index: one.values["quality/foot_slip"] for one in motion.references()}
    output = stepping(dataset_copy, "s\ns\n", "--by", "foot_slip", "--worst", "2")
    assert shown_order(output) == sorted(slip, key=lambda index: -slip[index])[:2]
    assert main(["review", str(dataset_copy), "--save", "--worst", "2", "--by", "foot_slip"]) == 0
    assert "2 trajectories" in capsys.readouterr().out
    assert "known are: largest_root_error" in failing(capsys, dataset_copy, "--by", "beauty", "--save")


def test_the_rest_is_accepted_and_verdicts_are_listed_and_withdrawn(dataset_copy, capsys):
    assert main(["review", str(dataset_copy), "--reject", "dog_trot/1", "--why", "drags\x1b[31m a leg"]) == 0
    assert main(["review", str(dataset_copy), "--accept-rest", "--who", "Ada"]) == 0
    assert main(["review", str(dataset_copy), "--list"]) == 0
    output = capsys.readouterr().out
    assert "4 trajectories accepted, all that had no verdict" in output
    assert "4 accepted, 1 rejected, 0 lapsed" in output
    assert "drags\\x1b[31m a leg" in output
    assert main(["review", str(dataset_copy), "--withdraw", "dog_trot/1", "dog_trot/3"]) == 0
    assert "2 verdicts withdrawn" in capsys.readouterr().out
    assert sorted(standing_reviews(Motion(dataset_copy, "dog_trot"))) == [0, 2, 4]
    assert main(["review", str(dataset_copy), "--withdraw", "dog_trot"]) == 0
    assert read_reviews(dataset_copy) == ()


def test_one_key_accepts_all_that_follow_if_that_is_meant(dataset_copy):
    output = stepping(dataset_copy, "r\nlimps\nt\nn\nt\ny\n")
    assert "accept 4 trajectories? y/n" in output
    assert "4 accepted, 1 rejected, 0 skipped, 0 not looked at" in output
    assert len(standing_reviews(Motion(dataset_copy, "dog_trot"))) == 5


def test_metrics_fit_a_narrow_terminal_at_words(dataset_copy, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    block = [line for line in stepping(dataset_copy, "q\n").splitlines()[1:] if line.startswith(" ")]
    assert len(block) > 12
    assert max(map(len, block)) <= 80


@pytest.mark.usefixtures("can_draw")
def test_a_sheet_of_pictures_lies_beside_each_question(dataset_copy, tmp_path):
    output = stepping(dataset_copy, "s\nq\n", "--sheets", str(tmp_path / "sheets"), "--worst", "2")
    order = shown_order(output)
    assert {path.name for path in (tmp_path / "sheets").iterdir()} == {f"dog_trot-{index:03d}.png" for index in order}
    with Image.open(tmp_path / "sheets" / f"dog_trot-{order[0]:03d}.png") as sheet:
        pixels = np.asarray(sheet).astype(int)
    assert pixels.shape == (480, 1280, 3)
    assert np.abs(pixels[60:200, :320] - pixels[60:200, 960:]).mean() > 0.5, "the robot has moved"


def test_missing_data_are_refused_before_the_first_question(dataset_copy, capsys):
    shutil.rmtree(dataset_copy / "dog_trot" / "joint_torque")
    assert "joint_torque: data are missing" in failing(capsys, dataset_copy, "--step")


def test_a_port_that_is_in_use_is_named(dataset_copy, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        message = failing(capsys, dataset_copy, "--web", "--trajectories", "1", "--port", str(port))
    assert f"port {port} cannot be used" in message


def test_the_viewer_follows_the_questions(dataset_copy):
    """Each question is a recording of its own, with the rows of its trajectory."""
    from kine2go_warp.dataset.limit_usage import limit_usages
    from kine2go_warp.recordings.following import FollowingViewer

    motion = Motion(dataset_copy, "dog_trot")
    usages = list(limit_usages(motion, motion.references()))[:2]
    server = rr.RecordingStream("listener", recording_id="listener")
    server.serve_grpc(grpc_port=(port := free_ports(1)[0]))
    viewer = FollowingViewer(stream_address(port))
    names = []
    for usage in usages:
        viewer.show(motion, usage)
        names.append(viewer._shown.get_recording_id())
    viewer.close()
    assert [name.split()[0] for name in names] == ["dog_trot/0", "dog_trot/1"]
