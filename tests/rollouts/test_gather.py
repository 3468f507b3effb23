from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zarr

from kine2go_warp.cli.main import main
from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.errors import DatasetError, Kine2GoError, PolicyError
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import link_positions
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather, resolve_settings
from kine2go_warp.rotations import to_rotation
from tests.conftest import ANYTHING_GOES

LOOSE = GatherConfig(trajectories=6, rows=40, action_noise_scale=(1.0, 1.0), **ANYTHING_GOES)


@pytest.fixture(scope="module")
def dataset(policy, tmp_path_factory):
    path = tmp_path_factory.mktemp("gather") / "dataset.zarr"
    result = gather(policy, DatasetWriter(path, GO2), LOOSE, "cpu")
    assert result.accepted == 6
    return path


@pytest.fixture(scope="module")
def data(dataset):
    return open_dataset(dataset, include_rejected=True).load("dog_trot")


def test_rows_have_the_length_asked_for_after_the_trim(data):
    np.testing.assert_array_equal(data.trajectories.draws["length"], 40)
    assert data.time[1] == pytest.approx(1.0 / 60.0)
    # 30 control steps of 1/60 s were dropped; this clip's period is 30 steps.
    turns = data.trajectories.rows["cycle"][:, 0] + data.trajectories.rows["phase"][:, 0]
    np.testing.assert_allclose(turns - data.trajectories.draws["start_phase"], 1.0, atol=1e-4)


def test_the_dataset_says_how_truly_the_reference_moves(data, clip):
    said = data.attributes["fidelity"]
    assert {name: one["value"] for name, one in said.items()} == clip.fidelity.as_json()
    assert said["seam_acceleration"]["units"] == "m/s^2"
    assert all(one["units"] and one["description"] for one in said.values())


def test_positions_change_by_what_the_velocities_say(data):
    rows = data.trajectories.rows
    for position, velocity in (
        ("root_position", "root_linear_velocity"),
        ("joint_position", "joint_velocity"),
        ("link_position", "link_linear_velocity"),
    ):
        # Semi-implicit substeps: the mean of the four new velocities moved the robot, not the ends' mean.
        change = np.diff(rows[position].astype(float), axis=1) * 60.0
        mean = 0.5 * (rows[velocity][:, 1:] + rows[velocity][:, :-1])
        difference = np.abs(change - mean)
        assert np.median(difference) < 0.05 * np.abs(rows[velocity]).max(), position


def test_orientation_changes_by_what_the_angular_velocity_says(data):
    rows = data.trajectories.rows
    for trajectory in range(6):
        rotation = to_rotation(rows["root_orientation"][trajectory].astype(float))
        turn = (rotation[1:] * rotation[:-1].inv()).as_rotvec() * 60.0
        mean = 0.5 * (rows["root_angular_velocity"][trajectory, 1:] + rows["root_angular_velocity"][trajectory, :-1])
        assert np.median(np.abs(turn - mean)) < 0.1 * np.abs(mean).max()


def test_links_are_where_forward_kinematics_puts_them(data):
    rows = data.trajectories.rows
    links = link_positions(GO2, rows["joint_position"])
    rotation = to_rotation(rows["root_orientation"].reshape(-1, 4)).as_matrix().reshape(6, 40, 3, 3)
    expected = np.einsum("ntij,ntkj->ntki", rotation, links) + rows["root_position"][:, :, None]
    np.testing.assert_allclose(rows["link_position"], expected, atol=2e-6)


def test_the_action_is_the_joint_target_in_units_of_the_action_scale(data):
    rows = data.trajectories.rows
    expected = (rows["joint_target"] - np.float32(GO2.default_joint_position)) / GO2.action_scale
    np.testing.assert_allclose(rows["action"], expected, atol=1e-5)


def test_sampled_actions_scatter_about_their_mean(data):
    spread = data.trajectories.rows["action"] - data.trajectories.rows["action_mean"]
    assert abs(spread.mean()) < 0.05
    assert 0.3 < spread.std() < 0.5, "the fast preset begins with a standard deviation of 0.4"


def test_a_rows_action_leads_to_the_next_rows_torque(data):
    """With a latency of five substeps the torque before row t comes from the target of row t-2."""
    rows = data.trajectories.rows
    position, speed = rows["joint_position"][:, 2:], rows["joint_velocity"][:, 2:]

    def demand(lag):
        stiffness, damping = 60.0, 2.0
        torque = stiffness * (rows["joint_target"][:, 2 - lag : 40 - lag] - position) - damping * speed
        return np.clip(torque, -np.float32(GO2.joint_effort), GO2.joint_effort)

    errors = [np.median(np.abs(rows["joint_torque"][:, 2:] - demand(lag))) for lag in (0, 1, 2)]
    assert np.argmin(errors) == 2, errors


def test_headings_phases_and_seeds_differ(data):
    for name in ("heading", "start_phase", "seed"):
        assert len(set(data.trajectories.draws[name].tolist())) == 6, name


def test_quaternions_are_unit_and_continuous(data):
    for name in ("root_orientation", "reference_root_orientation"):
        quaternions = data.trajectories.rows[name]
        np.testing.assert_allclose(np.linalg.norm(quaternions, axis=-1), 1.0, atol=1e-5)
        assert np.sum(quaternions[:, 1:] * quaternions[:, :-1], axis=-1).min() > 0.5
        assert np.all(quaternions[:, 0, 0] >= 0.0)


def test_the_same_seed_gives_the_same_data_and_a_second_call_runs_nothing(policy, dataset, tmp_path):
    again = DatasetWriter(tmp_path / "again.zarr", GO2)
    gather(policy, again, LOOSE, "cpu")
    for name, array in zarr.open_group(dataset / "dog_trot", mode="r").arrays():
        other = zarr.open_group(tmp_path / "again.zarr" / "dog_trot", mode="r")[name]
        assert np.array_equal(np.asarray(array[...]), np.asarray(other[...])), name
    steps = []
    result = gather(policy, again, LOOSE, "cpu", lambda *state: steps.append(state))
    assert (result.is_new, steps) == (False, [])


def test_other_settings_replace_the_motion(policy, tmp_path):
    writer = DatasetWriter(tmp_path / "dataset.zarr", GO2)
    gather(policy, writer, LOOSE, "cpu")
    result = gather(policy, writer, replace(LOOSE, trajectories=3), "cpu")
    assert (result.is_new, result.accepted) == (True, 3)
    assert [path.name for path in tmp_path.iterdir()] == ["dataset.zarr"], "nothing is left beside the store"


def test_rollouts_that_drift_are_rejected_with_a_reason(policy, tmp_path):
    writer = DatasetWriter(tmp_path / "dataset.zarr", GO2)
    strict = replace(LOOSE, rows=200, max_distance=1e-4)
    with pytest.raises(DatasetError, match=r"all 24 rollouts were rejected \(24 by distance\)"):
        gather(policy, writer, strict, "cpu")
    assert writer.motions() == []


def test_rollouts_whose_joints_are_off_are_rejected_with_a_reason(policy, tmp_path):
    writer = DatasetWriter(tmp_path / "dataset.zarr", GO2)
    with pytest.raises(DatasetError, match="24 by joint_error"):
        gather(policy, writer, replace(LOOSE, max_joint_rmse=1e-6), "cpu")


def test_rows_are_those_of_the_papers_table_unless_given():
    config = GatherConfig()
    assert resolve_settings(config, "ai4_dog_synth_circle_walk").rows == 1171
    assert resolve_settings(config, "ai4_dog_synth_half_flip_jump").rows == 300
    assert resolve_settings(config, "my_own_clip").rows == 571
    assert resolve_settings(replace(config, rows=40), "ai4_dog_pace").rows == 40


def test_a_catalogue_of_ones_own_states_rows_as_well(tmp_path):
    own = tmp_path / "own.toml"
    own.write_text(
        '[[motion]]\nname = "mine"\nfile = "a.bvh"\nsource = "labrador"\nlicence = "own"\ncitation = ""\nlength = 301\n'
    )
    assert resolve_settings(GatherConfig(), "mine", own).rows == 301
    assert resolve_settings(GatherConfig(rows=40), "mine", own).rows == 40
    assert resolve_settings(GatherConfig(), "dog_trot", own) == resolve_settings(GatherConfig(), "dog_trot")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": -1}, "seed is -1; it must be from 0 to"),
        ({"trajectories": 0}, "trajectories is 0; it must be from 1 to"),
        ({"rows": 1}, "rows is 1; it must be from 2 to"),
        ({"action_noise_scale": (-1.0, 1.0)}, r"action_noise_scale is \[-1.0, 1.0\]; it must be from 0 to"),
        ({"action_noise_scale": (1.0, 0.5)}, "the first must not be above the second"),
        ({"warm_up": -0.1}, "warm_up is -0.1; it must be from 0 to"),
        ({"max_attempts": 0.5}, "max_attempts is 0.5; it must be from 1 to"),
        ({"max_foot_slip": 0.0}, "max_foot_slip is 0.0; it must be positive"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(Kine2GoError, match=message):
        GatherConfig(**changes)


def normalised_noise(store, motion):
    """The action noise of all trajectories of a motion in units of its spread, and the seeds."""
    data = open_dataset(Path(store), include_rejected=True).load(motion).trajectories
    noise = data.rows["action"] - data.rows["action_mean"]
    return (noise / np.nanstd(noise, axis=(1, 2), keepdims=True)).ravel(), data.draws["seed"].tolist()


def test_a_policy_of_several_clips_gives_each_as_a_motion_of_its_own(clip, standing_clip, tmp_path, capsys):
    files = []
    for one in (clip, standing_clip):
        files.append(str(tmp_path / f"{one.name}.npz"))
        one.save(tmp_path / f"{one.name}.npz")
    policy, store = str(tmp_path / "policy"), str(tmp_path / "dataset.zarr")
    on_cpu = ["--device", "cpu", "--num-worlds", "16"]
    assert main(["train", *files, "--out", policy, "--iterations", "1", "--processes", "1", *on_cpu]) == 0
    loose = [f"--{name.replace('_', '-')}={value}" for name, value in ANYTHING_GOES.items()]
    gathering = ["gather", policy, "--out", store, "--trajectories", "4", "--rows", "120", *loose, *on_cpu]
    assert main([*gathering, "--motions", "standing"]) == 0
    assert DatasetWriter(Path(store), GO2).motions() == ["standing"]
    assert main(gathering) == 0
    for one in (clip, standing_clip):
        rows = open_dataset(Path(store), include_rejected=True).load(one.name).trajectories.rows
        lowest, highest = one.joint_position.min(axis=0), one.joint_position.max(axis=0)
        reference = rows["reference_joint_position"]
        assert np.all((reference >= lowest - 1e-5) & (reference <= highest + 1e-5)), one.name
    noise, seeds = zip(*(normalised_noise(store, one.name) for one in (clip, standing_clip)), strict=True)
    there = np.isfinite(noise[0]) & np.isfinite(noise[1])
    assert there.sum() > 4 * 60 * 12
    assert abs(np.corrcoef(noise[0][there], noise[1][there])[0, 1]) < 0.05, "motions share no draws"
    assert not set(seeds[0]) & set(seeds[1])
    assert main([*gathering, "--motions", "hop"]) == 2
    assert "was not trained on 'hop'; its clips are: dog_trot, standing" in capsys.readouterr().err
    with pytest.raises(PolicyError, match="tracks several clips, name one of: dog_trot, standing"):
        gather(PolicyFolder(Path(policy)), DatasetWriter(Path(store), GO2), LOOSE, "cpu")


def test_a_policy_tracks_a_clip_that_it_was_not_trained_on(policy, standing_clip, tmp_path, capsys):
    file, writer = tmp_path / "standing.npz", DatasetWriter(tmp_path / "dataset.zarr", GO2)
    standing_clip.save(file)
    assert gather(policy, writer, LOOSE, "cpu", clip=standing_clip).is_new
    assert not gather(policy, writer, LOOSE, "cpu", clip=standing_clip).is_new
    rows = open_dataset(writer.path, include_rejected=True).load("standing").trajectories.rows
    np.testing.assert_allclose(rows["reference_joint_position"][0, 0], standing_clip.joint_position[0], atol=1e-6)
    other = replace(standing_clip, root_position=standing_clip.root_position + 0.001).completed(standing_clip.spec)
    assert gather(policy, writer, LOOSE, "cpu", clip=other).is_new, "another clip of that name"
    options = ["--out", str(tmp_path / "second.zarr"), "--trajectories", "3", "--rows", "60", "--device", "cpu"]
    options += [f"--{name.replace('_', '-')}={value}" for name, value in ANYTHING_GOES.items()]
    assert main(["gather", str(policy.path), "--clips", str(file), *options]) == 0
    assert DatasetWriter(tmp_path / "second.zarr", GO2).motions() == ["standing"]
    assert main(["gather", str(policy.path), "--clips", str(file), "--motions", "dog_trot", *options]) == 2
    assert "give one of the two" in capsys.readouterr().err
