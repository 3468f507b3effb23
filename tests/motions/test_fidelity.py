"""The metrics against animals whose truth is known, and the clips of such animals at any rate and size."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp.motions.body import GRAVITY
from kine2go_warp.motions.catalogue import load_catalogue, motion_named
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.fidelity import contacts_by_speed, measure
from kine2go_warp.motions.generator import PACE, TROT, WALK, DogGait, generate, write_ai4animation
from kine2go_warp.motions.hops import Hop, generate_hops, write_solo8
from kine2go_warp.motions.inverse_kinematics import InverseKinematics
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.motions.sources import AI4Animation
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import (
    contact_velocity,
    foot_positions,
    leg_angles,
    leg_points,
    shank_rotations,
)
from kine2go_warp.rotations import from_rotation, to_rotation
from tests.motions.test_retarget import KEEP_RANGE, entry_of

TOES = [COLUMN_OF_KEYPOINT[f"{leg}_toe"] for leg in ("FL", "FR", "RL", "RR")]
STRIDE = 0.6
"""[s]"""


@contextmanager
def source_with(**values):
    """Dogs recorded at another rate, or of another size."""
    kept = {name: getattr(AI4Animation, name) for name in values}
    for name, value in values.items():
        setattr(AI4Animation, name, value)
    try:
        yield
    finally:
        for name, value in kept.items():
            setattr(AI4Animation, name, value)


def dog(folder, solver, rate=60.0, size=1.0, config=KEEP_RANGE, **options):
    """Two strides of a generated dog as a clip, its motion in the robot's size, and the truth about it."""
    gait = DogGait(rate=rate, stride_frames=round(STRIDE * rate), duty=0.6, **options)
    frames = round(6 * STRIDE * rate) + 1
    truth = generate(gait, frames)
    write_ai4animation(truth.points * size, folder / "dog.txt")
    entry = entry_of("dog.txt", round(2 * STRIDE * rate), round(4 * STRIDE * rate), rate=rate)
    with source_with(rate=rate, scale=AI4Animation.scale / size):
        clip = retarget(entry, folder, solver, config).clip
        motion = entry.motion_source.read(folder / "dog.txt").scaled(AI4Animation.scale)
    return clip, motion, truth


@pytest.mark.parametrize("rate", [25.0, 30.0, 60.0, 120.0, 240.0])
@pytest.mark.parametrize("phases", [TROT, WALK])
def test_a_gait_keeps_duty_clearance_pitch_and_speed_at_any_rate(solver, tmp_path, rate, phases):
    clip, _, truth = dog(tmp_path, solver, rate, phases=phases, brisk=True)
    gait = DogGait()
    within = slice(clip.origin.start, clip.origin.end)
    frame = 1.0 / (STRIDE * rate)
    np.testing.assert_allclose(clip.stance.mean(axis=0), truth.contact[within].mean(axis=0), atol=0.05 + 2.0 * frame)
    peaks = clip.foot_position[..., 2].max(axis=0) - GO2.foot_radius
    np.testing.assert_allclose(peaks, AI4Animation.scale * gait.step_height, rtol=0.06)
    up = to_rotation(clip.root_orientation).apply([0.0, 0.0, 1.0])
    assert np.degrees(np.arccos(up[:, 2])).max() < 0.3
    assert np.hypot(clip.cycle.x, clip.cycle.y) / clip.period == pytest.approx(
        AI4Animation.scale * gait.speed, rel=5e-3
    )


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_animals_of_another_size_become_the_same_clip(solver, tmp_path, size):
    here, *_ = dog(tmp_path, solver, phases=PACE)
    there, *_ = dog(tmp_path, solver, size=size, phases=PACE)
    np.testing.assert_array_equal(there.stance, here.stance)
    np.testing.assert_allclose(there.joint_position, here.joint_position, atol=2e-3)


@pytest.mark.parametrize("direction", [0.0, np.pi])
def test_a_trot_on_a_floor_tilted_by_one_degree_comes_out_as_on_level_ground(solver, tmp_path, direction):
    gait = DogGait(stride_frames=36, duty=0.6)
    truth = generate(gait, 361)
    slope = Rotation.from_rotvec(np.radians(1.0) * np.array([np.sin(direction), -np.cos(direction), 0.0]))
    clips = []
    for name, turn in (("level", Rotation.identity()), ("tilted", slope)):
        write_ai4animation(turn.apply(truth.points.reshape(-1, 3)).reshape(truth.points.shape), tmp_path / name)
        clips.append(retarget(entry_of(name, 144, 216), tmp_path, solver, KEEP_RANGE))
    assert [len(one.remarks) for one in clips] == [0, 1]
    assert clips[1].remarks[0].startswith("the floor rose by 1.0 degrees")
    level, tilted = (one.clip for one in clips)
    # Against the generator: contacts, standing height, a trunk that is level and as high as the animal's.
    contact = truth.contact[144:216]
    assert np.mean((tilted.stance > 0.5) != contact) < 0.14
    both = (tilted.stance > 0.5) & contact
    np.testing.assert_allclose(tilted.foot_position[both][:, 2], GO2.foot_radius, atol=1e-3)
    assert abs(tilted.fidelity.trunk_pitch) < 0.1
    assert np.degrees(np.abs(to_rotation(tilted.root_orientation).as_euler("ZYX")[:, 1:])).max() < 0.2
    height = AI4Animation.scale * (truth.trunk[144:216, 2] - gait.toe_height)
    offset = tilted.root_position[:, 2] - height
    assert np.ptp(offset) < 2e-3
    speed = np.hypot(tilted.cycle.x, tilted.cycle.y) / tilted.period
    assert speed == pytest.approx(AI4Animation.scale * gait.speed, rel=2e-3)
    # And against the same animal on level ground.
    np.testing.assert_allclose(tilted.root_position[:, 2], level.root_position[:, 2], atol=2e-3)
    np.testing.assert_allclose(tilted.joint_position, level.joint_position, atol=0.02)
    assert np.array_equal(tilted.stance > 0.5, level.stance > 0.5)


def test_metrics_see_what_is_wrong(solver, tmp_path):
    """Each fault is put in by hand, and its metric gives its size."""
    clip, motion, _ = dog(tmp_path, solver, phases=WALK)
    good = measure(clip, motion, GO2)
    assert good.trunk_pitch == pytest.approx(0.0, abs=0.1)
    assert good.swing_front == pytest.approx(1.0, abs=0.05)
    assert good.duty == pytest.approx(0.0, abs=0.03)
    assert good.contact_slip < 0.01
    tilt = to_rotation(clip.root_orientation) * to_rotation(np.array([np.cos(0.05), 0.0, -np.sin(0.05), 0.0]))
    tilted = replace(clip, root_orientation=from_rotation(tilt)).completed(GO2)
    assert measure(tilted, motion, GO2).trunk_pitch == pytest.approx(np.degrees(0.1), abs=0.1)
    dipped = clip.root_position.copy()
    dipped[20:24, 2] -= 0.03
    dip = measure(replace(clip, root_position=dipped).completed(GO2), motion, GO2)
    assert dip.base_dip == pytest.approx(0.03, abs=5e-3)
    assert dip.penetration > 0.01
    assert dip.height_correlation < 0.7
    kicked = clip.root_position.copy()
    kicked[0, 0] += 0.005
    assert measure(replace(clip, root_position=kicked).completed(GO2), motion, GO2).seam_acceleration > 30.0
    sliding = replace(
        clip, root_position=clip.root_position * [1.2, 1.0, 1.0], cycle=replace(clip.cycle, x=1.2 * clip.cycle.x)
    )
    slip = measure(sliding.completed(GO2), motion, GO2).contact_slip
    assert slip == pytest.approx(0.2 * AI4Animation.scale * DogGait().speed, rel=0.1)


def test_a_range_of_one_and_a_half_strides_is_found_out(solver, tmp_path):
    truth = generate(DogGait(), 181)
    write_ai4animation(truth.points, tmp_path / "dog.txt")
    good, bad = (
        retarget(entry_of("dog.txt", 60, end), tmp_path, solver, KEEP_RANGE).clip.fidelity for end in (120, 105)
    )
    assert good.seam_shift == 0.0
    assert abs(bad.seam_shift) == pytest.approx(0.5, abs=0.04)


@pytest.mark.parametrize("rate", [60.0, 120.0])
def test_contacts_by_speed_are_those_of_the_generator(rate):
    truth = generate(DogGait(rate=rate, stride_frames=round(0.5 * rate), duty=0.6, brisk=True), round(3 * rate))
    found = contacts_by_speed(0.825 * truth.points[:, TOES], 1.0 / rate)
    np.testing.assert_allclose(found.mean(axis=0), truth.contact.mean(axis=0), atol=4.0 / rate)


def test_a_foot_that_rises_from_rest_is_held_longer_but_not_above_its_threshold(solver, tmp_path):
    """Nothing tells a foot that hardly moves from one that stands: the price is 0.13 of a stride of cycloids."""
    clip, _, truth = dog(tmp_path, solver)
    within = slice(clip.origin.start, clip.origin.end)
    late = (clip.stance > 0.5) & ~truth.contact[within]
    assert 0.0 < late.mean() < 0.14
    heights = AI4Animation.scale * (truth.points[within][:, TOES, 2] - DogGait().toe_height)
    assert heights[late].max() < 2.0 * KEEP_RANGE.stance_height * AI4Animation.scale * DogGait().step_height


def test_a_rolling_foot_does_not_slip_and_a_sliding_one_does(rng):
    """Independent of the closed form: the velocity of a point that is fixed to the shank."""
    joints = np.array(GO2.default_joint_position) + rng.uniform(-0.3, 0.3, 12)
    rate, step = rng.uniform(-2.0, 2.0, 12), 1e-6
    before, after = (joints + sign * step * rate for sign in (-1.0, 1.0))
    shanks = [shank_rotations(GO2, one) for one in (before, joints, after)]
    feet = [foot_positions(GO2, one) for one in (before, joints, after)]
    below = np.array([0.0, 0.0, -GO2.foot_radius])
    fixed = np.einsum("kji,j->ki", shanks[1], below)
    points = [foot + np.einsum("kij,kj->ki", shank, fixed) for foot, shank in zip(feet, shanks, strict=True)]
    expected = (points[2] - points[0]) / (2.0 * step)
    turn = (shanks[2] - shanks[0]) / (2.0 * step) @ np.swapaxes(shanks[1], -1, -2)
    angular = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=-1)
    velocity = (feet[2] - feet[0]) / (2.0 * step)
    np.testing.assert_allclose(contact_velocity(velocity, angular, GO2.foot_radius), expected, atol=1e-6)


def test_leg_angles_undo_the_forward_kinematics_and_shanks_point_at_the_feet(rng):
    joints = np.array(GO2.default_joint_position) + rng.uniform(-0.5, 0.5, (100, 12))
    joints[:, 2::3] = np.minimum(joints[:, 2::3], -0.9)
    np.testing.assert_allclose(leg_angles(GO2, foot_positions(GO2, joints)), joints, atol=1e-9)
    points = leg_points(GO2, joints)
    down = shank_rotations(GO2, joints) @ [0.0, 0.0, -GO2.legs[0].calf_length]
    np.testing.assert_allclose(points[..., 2, :] + down, points[..., 3, :], atol=1e-12)


@pytest.mark.parametrize("scale", [0.5, 1.7])
def test_a_time_scale_plays_the_same_poses_at_another_speed(solver, tmp_path, scale):
    clip, *_ = dog(tmp_path, solver)
    other, *_ = dog(tmp_path, solver, config=replace(KEEP_RANGE, time_scale=scale))
    assert other.period == pytest.approx(scale * clip.period * other.slow_down)
    np.testing.assert_allclose(other.joint_position, clip.joint_position, atol=1e-12)


def test_dynamically_similar_flights_are_free_falls(solver, tmp_path):
    """Hops of a robot of another size, whose base falls freely: they do so again at the size of the Go2."""
    write_solo8(generate_hops(Hop(), 150)[None], tmp_path / "hops.pt")
    entry = replace(load_catalogue()["solo8_jump_forward_a"], file="hops.pt:0", frames=FrameRange(50, 100))
    true_time, froude = (
        retarget(entry, tmp_path, solver, RetargetConfig(search_time=0.0, time_scale=scale)).clip
        for scale in (1.0, "froude")
    )
    assert froude.time_scale == pytest.approx(entry.motion_source.scale**0.5)
    assert froude.fidelity.flight_share > 0.2
    assert froude.fidelity.flight_acceleration == pytest.approx(-GRAVITY, rel=0.02)
    assert true_time.fidelity.flight_acceleration == pytest.approx(-GRAVITY * entry.motion_source.scale, rel=0.12)
    in_air = froude.stance.sum(axis=1) == 0
    inside = in_air & np.roll(in_air, 1) & np.roll(in_air, -1)
    height = froude.extended(1, 1).root_position[:, 2]
    np.testing.assert_allclose(np.diff(height, 2)[inside] / froude.frame_duration**2, -GRAVITY, rtol=0.02)


def test_flights_of_a_motion_that_motors_slow_are_free_falls_all_the_same(tmp_path):
    """Hops that ask for half the speed of the Go2's motors, by a robot whose motors are slower than that."""
    slow = replace(GO2, joint_speed=tuple(0.44 * speed for speed in GO2.joint_speed))
    write_solo8(generate_hops(Hop(foot_lift=0.12), 150)[None], tmp_path / "hops.pt")
    entry = load_catalogue()["solo8_jump_forward_a"]
    entry = replace(entry, file="hops.pt:0", frames=FrameRange(50, 100), time_scale="froude")
    clip = retarget(entry, tmp_path, InverseKinematics(slow), RetargetConfig(search_time=0.0)).clip
    assert clip.slow_down > 1.05
    assert (np.abs(clip.joint_velocity) <= np.array(slow.joint_speed) * (1.0 + 1e-9)).all()
    in_air = clip.stance.sum(axis=1) == 0
    inside = in_air & np.roll(in_air, 1) & np.roll(in_air, -1)
    assert np.count_nonzero(inside) >= 8
    height = clip.extended(1, 1).root_position[:, 2]
    np.testing.assert_allclose(np.diff(height, 2)[inside] / clip.frame_duration**2, -GRAVITY, rtol=0.03)


def test_a_clip_keeps_its_metrics_in_its_file(clip, tmp_path):
    clip.save(tmp_path / "clip.npz")
    assert type(clip).load(tmp_path / "clip.npz").fidelity.as_json() == clip.fidelity.as_json()


def test_motors_too_slow_for_similar_dynamics_slow_the_clip(solver):
    clip = retarget(motion_named("dog_trot"), None, solver, RetargetConfig(time_scale=0.2)).clip
    assert clip.slow_down > 1.0
    assert clip.frame_duration == pytest.approx(0.2 / 60.0 * clip.slow_down)
