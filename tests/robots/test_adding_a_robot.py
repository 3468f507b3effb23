"""docs/adding-a-robot.md, followed for a made-up robot: from a URDF to checked data, the package unchanged."""

import json
import re
import shutil
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import zarr

from kine2go_warp.cli.main import main
from kine2go_warp.dataset import open_dataset
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.robots import GO2, RobotSpec, robot_named
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.robots.look import Motors
from tests.conftest import ANYTHING_GOES
from tests.robots.made_up import CALF, FOOT, PAGE, THIGH, WIDTH, urdf, write_robot

LOOSE = " ".join(f"--{name.replace('_', '-')} {value}" for name, value in ANYTHING_GOES.items())
SMALL = {
    "retarget": "",
    "train": "--num-worlds 8 --iterations 2 --processes 1 --device cpu",
    "gather": f"--trajectories 2 --rows 30 --warm-up 0.1 --device cpu {LOOSE}",
    "replay": "",
    "check": "",
}
"""What a test adds to the commands of the page."""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """The folder in which the commands of the page have been run, and their exit statuses."""
    folder = tmp_path_factory.mktemp("made_up")
    write_robot(folder)
    (block,) = re.findall(r"```bash\n(.*?)```", PAGE.read_text(), re.DOTALL)
    commands = [line.split()[1:] for line in block.strip().splitlines()]
    assert [command[1] for command in commands] == list(SMALL)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        statuses = {command[1]: main([*command, *SMALL[command[1]].split()]) for command in commands}
    return folder, statuses


def test_the_page_names_every_field_of_a_specification():
    named = set(re.findall(r"^\| (`.*?) \|", PAGE.read_text(), re.MULTILINE))
    assert {field.name for field in fields(RobotSpec)} == set(re.findall(r"`(\w+)`", " ".join(named)))


def test_the_variant_of_the_page_is_a_heavier_go2_with_weaker_motors(tmp_path):
    _robot, variant = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (tmp_path / "go2_laden.py").write_text(variant)
    text = GO2.urdf.read_text()
    assert text.count('<mass value="6.921"/>') == 1
    (tmp_path / "go2_laden.urdf").write_text(text.replace('"6.921"', '"9.921"'))
    spec = robot_named(f"{tmp_path / 'go2_laden.py'}:SPEC")
    assert spec.mass == pytest.approx(GO2.mass + 3.0)
    assert spec.motor_limits.driving == pytest.approx([0.8 * torque for torque in GO2.motor_limits.driving])
    assert spec.motor_limits.braking == GO2.motor_limits.braking
    assert spec.model_hash != GO2.model_hash


def test_every_command_of_the_page_succeeds_so_the_replay_is_the_same_bit_for_bit(place):
    assert place[1] == dict.fromkeys(SMALL, 0)


def test_clip_policy_and_dataset_name_the_robot_by_its_file(place):
    folder, _ = place
    reference = f"{(folder / 'my_robot.py').resolve()}:SPEC"
    clip = MotionClip.load(folder / "clips" / "dog_trot.npz")
    dataset = open_dataset(folder / "data.zarr")
    assert clip.robot == PolicyFolder(folder / "policy").read_record().robot == reference
    assert dataset.attributes["robot_reference"] == reference
    assert dataset.attributes["robot"] == "my_robot"
    assert dataset.robot == clip.spec == robot_named(reference)
    assert list(dataset.attributes["joint_names"])[:3] == [
        f"front_left_{x}" for x in ("abduction", "shoulder", "elbow")
    ]


def test_the_clip_is_the_robots_own(place, clip):
    """Its feet stand on the floor by its own lengths, and it goes as much farther as its legs are longer."""
    own = MotionClip.load(place[0] / "clips" / "dog_trot.npz")
    spec = own.spec
    assert (spec.foot_radius, spec.size, spec.width) == (FOOT, pytest.approx((THIGH + CALF) / 0.426), WIDTH / 0.0955)
    lowest = own.foot_position[..., 2][own.stance > 0.5] - FOOT
    assert np.abs(lowest).max() < 0.01
    assert own.cycle.x == pytest.approx(spec.size * clip.cycle.x, rel=0.02)
    standing = foot_positions(spec, np.array(spec.default_joint_position))[:, 2]
    assert standing == pytest.approx(FOOT - spec.default_root_height, abs=0.05)


def test_the_simulated_robot_weighs_what_its_urdf_says(place):
    spec = MotionClip.load(place[0] / "clips" / "dog_trot.npz").spec
    assert spec.mass == pytest.approx(9.0 + 4 * (0.8 + 1.4 + 0.2 + 0.06))
    data = open_dataset(place[0] / "data.zarr").load("dog_trot")
    assert data.trajectories.rows["link_position"].shape[2] == 16
    # The recorded joint centres are those of this robot, not of another one.
    links = data.trajectories.rows["link_position"][0, :10]
    assert np.linalg.norm(links[:, 2] - links[:, 1], axis=-1) == pytest.approx(THIGH, abs=1e-4)
    assert np.linalg.norm(links[:, 12] - links[:, 2], axis=-1) == pytest.approx(CALF, abs=1e-4)


LATER = (
    "dataset review data.zarr --save",
    "dataset score data.zarr",
    "dataset report data.zarr",
    "dataset render data.zarr dog_trot --out trot.mp4 --end 0.1 --size 160x120",
    "dataset export data.zarr --format npz",
    "policy eval policy --worlds 4 --seconds 0.5 --device cpu",
    "policy export policy",
    "policy sim2sim policy --worlds 2 --seconds 0.5 --device cpu",
)


@pytest.fixture(scope="module")
def results(place, tmp_path_factory):
    """A copy of what the commands of the page have made."""
    return shutil.copytree(place[0], tmp_path_factory.mktemp("results") / "made_up")


@pytest.mark.parametrize("command", LATER)
def test_later_commands_take_the_robot_from_what_they_open(results, command, monkeypatch, request):
    if "report" in command or "render" in command:
        request.getfixturevalue("can_draw")
    monkeypatch.chdir(results)
    assert main(command.split()) == 0


def test_a_robot_without_motors_at_the_hips_is_drawn_without_them(place, tmp_path):
    spec = MotionClip.load(place[0] / "clips" / "dog_trot.npz").spec
    assert Motors.of(spec) is not None
    bare = tmp_path / "bare.urdf"
    bare.write_text(urdf().replace('<cylinder radius="0.04" length="0.04"/>', '<sphere radius="0.04"/>'))
    assert Motors.of(replace(spec, urdf=bare)) is None


def error_of(capsys, *arguments: object) -> str:
    """Return the one line with which a command ends with status 2."""
    capsys.readouterr()
    assert main([str(argument) for argument in arguments]) == 2
    (line,) = [
        line for line in capsys.readouterr().err.splitlines() if "started" not in line and "preparing" not in line
    ]
    return line


def test_clips_of_two_robots_are_not_trained_together(place, clip, tmp_path, capsys):
    replace(clip, name="other").save(tmp_path / "other.npz")
    own = place[0] / "clips" / "dog_trot.npz"
    line = error_of(capsys, "train", own, tmp_path / "other.npz", "--out", tmp_path / "policy")
    assert "is for the robot go2 and dog_trot for" in line
    assert not (tmp_path / "policy").exists()


def test_a_policy_takes_no_clip_of_another_robot(place, policy, tmp_path, capsys):
    own = place[0] / "clips" / "dog_trot.npz"
    line = error_of(capsys, "train", own, "--out", policy.path, "--num-worlds", 8, "--device", "cpu")
    assert "holds a policy of another robot, go2, not" in line
    folder = tmp_path / "policy"
    folder.mkdir()
    for file in (place[0] / "policy").iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    (folder / "dog_trot.npz").write_bytes((policy.path / "dog_trot.npz").read_bytes())
    line = error_of(capsys, "gather", folder, "--out", tmp_path / "data.zarr")
    assert "the clip dog_trot is for the robot go2 and the policy for" in line
    assert not (tmp_path / "data.zarr").exists()


def test_a_dataset_takes_no_motion_of_another_robot(place, walks, capsys):
    line = error_of(capsys, "gather", place[0] / "policy", "--out", walks, "--device", "cpu")
    assert "holds motions with robot go2, and dog_trot has my_robot; choose another dataset" in line
    assert open_dataset(walks).robot is GO2
    assert open_dataset(walks).motions == ["stroll", "walk"]


def test_a_robot_that_is_gone_is_one_line(clip, dataset_copy, tmp_path, capsys):
    gone = f"{tmp_path / 'gone.py'}:SPEC"
    replace(clip, robot=gone).save(tmp_path / "clip.npz")
    line = error_of(capsys, "train", tmp_path / "clip.npz", "--out", tmp_path / "policy")
    assert f"clip dog_trot: its robot is not available here: {tmp_path / 'gone.py'}: no such Python file" in line
    zarr.open_group(dataset_copy, mode="r+").attrs["robot_reference"] = gone
    for command in ("score", "check", "replay"):
        assert "gone.py: no such Python file" in error_of(capsys, command, dataset_copy)
    assert next(open_dataset(dataset_copy).trajectories()).length > 100, "data are loaded without it"
    assert "unknown robot 'b3'; known are: a1, b2, go1, go2, or FILE.py:NAME" in error_of(
        capsys, "retarget", "dog_trot", "--robot", "b3", "--out", tmp_path
    )


def test_clips_without_a_robot_are_the_go2s(clip, tmp_path):
    clip.save(tmp_path / "new.npz")
    with np.load(tmp_path / "new.npz") as data:
        header = json.loads(str(data["header"]))
        del header["robot"]
        np.savez(tmp_path / "old.npz", **{**data, "header": np.array(json.dumps(header))})
    assert MotionClip.load(tmp_path / "old.npz").spec is GO2


WRONG = {
    "an axis": ('<axis xyz="0 1 0"/>', '<axis xyz="1 0 0"/>', "must turn about"),
    "a foot": (
        f'"{FOOT}"/></geometry></collision>',
        '"0.02"/></geometry></collision>',
        "no collision sphere of foot_radius",
    ),
    "a joint": ("rear_left_elbow", "rear_left_knee", "rear_left"),
    "a chain": ('<parent link="front_left_side"/>', '<parent link="body"/>', "must be on front_left_side"),
    "a turn": ('<origin xyz="0 0 -0.24"/>', '<origin xyz="0 0 -0.24" rpy="0 0.1 0"/>', "not turned"),
    "no URDF at all": ("<robot", "<<robot", "not a URDF|not well-formed"),
}


@pytest.mark.parametrize("fault", WRONG)
def test_a_urdf_that_is_another_kind_of_robot_is_refused(fault, tmp_path, capsys):
    write_robot(tmp_path)
    old, new, expected = WRONG[fault]
    file = Path(tmp_path / "my_robot.urdf")
    before, found, after = file.read_text().rpartition(old)
    assert found
    file.write_text(before + new + after)
    line = error_of(capsys, "retarget", "dog_trot", "--robot", f"{tmp_path / 'my_robot.py'}:SPEC", "--out", tmp_path)
    assert re.search(expected, line), line


def test_values_that_no_robot_has_are_refused(tmp_path, capsys):
    for wrong, expected in (
        ("default_joint_position=(0.0, 0.8, 1.5) * 4", "default_joint_position of front_left_elbow is outside"),
        ("default_root_height=-0.38", "default_root_height is -0.38; its values must be positive"),
        ("joint_friction=(0.2,) * 11", "joint_friction has 11 entries, not 12"),
    ):
        write_robot(tmp_path)
        name = wrong.partition("=")[0]
        text = (tmp_path / "my_robot.py").read_text()
        file = tmp_path / f"{name}.py"
        file.write_text(re.sub(rf"{name}=.*,", f"{wrong},", text))
        assert expected in error_of(capsys, "retarget", "dog_trot", "--robot", f"{file}:SPEC", "--out", tmp_path)
