import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch
import zarr
from tensordict import TensorDict

from kine2go_warp.cli.main import main
from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.checks.run import check_dataset
from kine2go_warp.dataset.schema import DIVERSITY_ARRAYS
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.episodes import EpisodeStart
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.symmetry import make_mirrors, mirrored_action
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.diversity import LEVELS, DiversitySettings
from kine2go_warp.rollouts.gather import gather
from kine2go_warp.rollouts.replay import replay_motion
from kine2go_warp.rotations import heading
from tests.conftest import ANYTHING_GOES

OTHER_SIDE = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
SIGNS = np.tile([-1.0, 1.0, 1.0], 4)
WIDE = DiversitySettings("wide", recovery=0.5, recovery_time=0.5, noise_time=(0.05, 0.1))
CONFIG = GatherConfig(trajectories=8, rows=90, num_worlds=8, diversity=WIDE, **ANYTHING_GOES)


@pytest.fixture(scope="module")
def dataset(policy, tmp_path_factory):
    path = tmp_path_factory.mktemp("wide") / "dataset.zarr"
    gather(policy, DatasetWriter(path, GO2), CONFIG, "cpu")
    return path


@pytest.fixture(scope="module")
def data(dataset):
    return open_dataset(dataset).load("dog_trot")


def test_everything_is_drawn_within_its_range_and_stored(data):
    draws = data.trajectories.draws
    for name in ("time_scale", "speed_offset", "turn_offset", "noise_time"):
        low, high = getattr(WIDE.resolved(), name)
        assert low <= draws[name].min() < draws[name].max() <= high
        assert len(set(draws[name].tolist())) == 8, name
    assert 0 < draws["mirrored"].sum() < 8
    assert 0 < draws["recovery"].sum() < 8
    assert data.attributes["gather_settings"]["diversity"]["time_scale"] == [0.85, 1.15]
    np.testing.assert_array_equal(draws["reset_scale"] > 1.0, draws["recovery"] > 0)


def test_reference_joints_are_the_clip_s_at_its_pace_and_side(data, clip):
    rows, draws = data.trajectories.rows, data.trajectories.draws
    looped = np.concatenate([clip.joint_position, clip.joint_position[:1]])
    speed = np.concatenate([clip.joint_velocity, clip.joint_velocity[:1]])
    for index in range(8):
        warm_up = 0 if draws["recovery"][index] else 30
        turns = draws["start_phase"][index] + (warm_up + np.arange(90)) / 60.0 / (
            clip.period * draws["time_scale"][index]
        )
        place = turns % 1.0 * clip.num_frames
        joints, rates = (
            np.stack([np.interp(place, np.arange(len(one)), one[:, joint]) for joint in range(12)], axis=-1)
            for one in (looped, speed / draws["time_scale"][index])
        )
        if draws["mirrored"][index]:
            joints, rates = joints[:, OTHER_SIDE] * SIGNS, rates[:, OTHER_SIDE] * SIGNS
        np.testing.assert_allclose(rows["reference_joint_position"][index], joints, atol=2e-3)
        np.testing.assert_allclose(rows["reference_joint_velocity"][index], rates, atol=0.1)


def test_the_reference_s_root_has_the_speed_and_yaw_rate_that_were_drawn(data, clip):
    rows, draws = data.trajectories.rows, data.trajectories.draws
    speed = np.hypot(clip.cycle.x, clip.cycle.y) / clip.period
    period = round(clip.num_frames * 60.0 * clip.frame_duration)
    for index in range(8):
        yaw = np.unwrap(heading(rows["reference_root_orientation"][index]))
        scale = float(draws["time_scale"][index])
        # The clip repeats itself after a period, so over whole periods only its own turn and the offset are left.
        places = rows["cycle"][index] + rows["phase"][index]
        whole = int(places[-1] - places[0])
        last = np.interp(places[0] + whole, places, np.arange(90.0))
        side = -1.0 if draws["mirrored"][index] else 1.0
        turned = np.interp(last, np.arange(90.0), yaw) - yaw[0] - side * whole * clip.cycle.yaw
        assert turned / (last / 60.0) == pytest.approx(draws["turn_offset"][index], abs=2e-3)
        steps = np.linalg.norm(np.diff(rows["reference_root_position"][index, :, :2], axis=0), axis=-1)
        expected = speed / scale + draws["speed_offset"][index]
        assert steps[: period * (89 // period)].mean() * 60.0 == pytest.approx(expected, abs=0.03)
        chord = rows["reference_root_linear_velocity"][index]
        change = np.diff(rows["reference_root_position"][index], axis=0) * 60.0
        assert np.median(np.abs(change - 0.5 * (chord[1:] + chord[:-1]))) < 0.02


def test_recoveries_begin_off_their_reference_without_a_warm_up(data):
    rows, draws = data.trajectories.rows, data.trajectories.draws
    recovery = draws["recovery"] > 0
    step = data.trajectories.groups["initial_state"]["reference_step"]
    np.testing.assert_array_equal(step, np.where(recovery, 0, 30))
    off = np.abs(rows["joint_position"][:, 0] - rows["reference_joint_position"][:, 0]).max(axis=-1)
    # Joints are off by up to 0.05 rad times the scale.
    assert np.all(off[recovery] > 0.5 * 0.05 * draws["reset_scale"][recovery])
    assert np.all(off[recovery] <= 0.05 * draws["reset_scale"][recovery] + 1e-5)
    assert not rows["joint_torque_peak"][recovery, 0].any()
    np.testing.assert_array_equal(rows["applied_target"][recovery, 0], rows["joint_position"][recovery, 0])


def test_noise_is_correlated_over_the_time_that_was_drawn(data):
    rows, draws = data.trajectories.rows, data.trajectories.draws
    noise = (rows["action"] - rows["action_mean"]).astype(float)
    for index in range(8):
        one = noise[index]
        found = np.sum(one[1:] * one[:-1]) / np.sum(one**2)
        assert found == pytest.approx(np.exp(-1.0 / 60.0 / draws["noise_time"][index]), abs=0.12)


def test_pushes_are_as_hard_as_the_level_says(data):
    assert 0.4 < np.linalg.norm(data.trajectories.rows["push"], axis=-1).max() <= 0.8


def test_a_wide_dataset_is_clean(dataset):
    report = check_dataset(dataset, GO2)
    assert report.is_clean, [str(finding) for finding in report.findings]


@pytest.mark.parametrize(
    ("name", "change", "check"),
    [
        ("time_scale", lambda values: values * 1.01, "even phase"),
        ("mirrored", lambda values: 1 - values, "reference joints"),
        ("turn_offset", lambda values: -values, "reference heading"),
        ("speed_offset", lambda values: -values, "reference path"),
        ("recovery", lambda values: 1 - values, "start phase"),
        ("noise_time", lambda values: values + 3.0, "draws"),
    ],
)
def test_a_wrong_draw_of_one_trajectory_is_found(dataset, tmp_path, name, change, check):
    spoiled = tmp_path / "dataset.zarr"
    shutil.copytree(dataset, spoiled)
    array = zarr.open_group(spoiled / "dog_trot", mode="r+")[name]
    place = int(np.argmax(np.abs(array[...])))
    array[place] = change(array[place])
    report = check_dataset(spoiled, GO2)
    assert check in {finding.check for finding in report.findings if finding.trajectory == place}, report.findings


def test_wide_trajectories_come_out_bit_for_bit(dataset):
    results = replay_motion(dataset, "dog_trot", None, "newton", "cpu")
    assert len(results) == 8
    assert all(result.is_identical for result in results), results


def test_readers_select_by_what_was_drawn(dataset):
    near = open_dataset(dataset).select(where=lambda one: abs(one.values["time_scale"] - 1.0) < 0.05)
    stored = zarr.open_group(dataset / "dog_trot", mode="r")["time_scale"][...]
    assert {one.index for one in near.references} == set(np.flatnonzero(np.abs(stored - 1.0) < 0.05).tolist())
    assert 0 < len(near.references) < 8


def test_without_diversity_nothing_is_drawn(clean_dataset):
    draws = open_dataset(clean_dataset).load("dog_trot").trajectories.draws
    for array in DIVERSITY_ARRAYS:
        np.testing.assert_array_equal(draws[array.name], 1.0 if array.name.endswith("scale") else 0.0)


def test_a_clip_for_every_world_gives_the_bits_of_one_for_all(clip, small_config):
    config = replace(small_config, num_worlds=3)
    starts = EpisodeStart(np.arange(3, dtype=np.int32), np.float32([0.1, 0.5, 0.9]), np.float32([0.0, 1.0, -2.0]))
    one, many = (ImitationEnvironment(clips, config, "cpu") for clips in ([clip], [clip] * 3))
    many.replace_clips([clip] * 3)
    one.restart(5, replace(starts, clip=np.zeros(3, np.int32)))
    many.restart(5, starts)
    for _ in range(20):
        np.testing.assert_array_equal(one.observation.numpy(), many.observation.numpy())
        one.step()
        many.step()


def test_a_mirrored_world_gets_the_mirror_image_of_what_the_policy_does_there(policy, clip):
    record = policy.read_record()
    env = ImitationVecEnv(ImitationEnvironment([clip], replace(record.preset.env, num_worlds=4), "cpu"))
    actor = NoisyPolicy(env, record.preset, policy.latest_checkpoint(), 3)
    seen = env.get_observations()
    plain, _ = actor(seen, 0.0)
    image = TensorDict({"policy": make_mirrors(env.config)["policy"](seen["policy"])}, batch_size=[4])
    expected = mirrored_action(actor(image, 0.0)[0])
    actor.vary(torch.tensor([[0.0], [1.0], [0.0], [1.0]]), torch.zeros(4, 1))
    found, sample = actor(seen, 0.0)
    torch.testing.assert_close(found[::2], plain[::2], rtol=0.0, atol=0.0)
    torch.testing.assert_close(found[1::2], expected[1::2])
    torch.testing.assert_close(sample, found)
    assert (found[1::2] - plain[1::2]).abs().max() > 1e-3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time_scale": (1.1, 0.9)}, "time_scale is .*the first must not be above"),
        ({"time_scale": (0.1, 1.0)}, "time_scale is .*from 0.5 to 2"),
        ({"mirrored": 1.5}, "mirrored is 1.5; it must be from 0 to 1"),
        ({"reset_scale": (0.5, 2.0)}, "reset_scale is .*from 1 to 20"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(Kine2GoError, match=message):
        DiversitySettings(**changes)


def test_single_values_replace_those_of_the_level():
    assert DiversitySettings("wide", mirrored=0.0).resolved() == replace(LEVELS["wide"], mirrored=0.0)
    assert DiversitySettings().resolved() == LEVELS["paper"]
    assert not LEVELS["cloning"].varies_reference


def test_the_quality_command_tells_the_coverage(dataset, capsys):
    assert main(["quality", str(dataset)]) == 0
    assert "coverage" in capsys.readouterr().out
