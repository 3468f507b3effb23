"""Contact-aware retargeting on gaits whose truth is known, and under changes that must not matter."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.catalogue import load_catalogue, motion_named
from kine2go_warp.motions.catalogue_entry import CatalogueEntry
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.fidelity import Fidelity
from kine2go_warp.motions.generator import CROUCH, PACE, TROT, WALK, DogGait, generate, write_ai4animation
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.quality import ClipQuality, assess, clip_faults, clip_remarks, distance_to_hull
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import to_rotation
from tests.motions.test_solo8 import trot as solo_trot
from tests.motions.test_vhdc import horse
from tests.motions.test_vhdc import write as write_horse

KEEP_RANGE = RetargetConfig(search_time=0.0)


def entry_of(file, start=60, end=120, source="ai4animation", rate=60.0):
    return CatalogueEntry(
        name="made_up",
        collection="tests",
        source=source,
        file=file,
        frames=FrameRange(start, end),
        rate=rate,
        length=571,
        sample=False,
        bundled=False,
        licence="CC0",
        citation="us",
    )


def make(points, folder, solver, config=KEEP_RANGE, **options):
    write_ai4animation(points, folder / "dog.txt")
    return retarget(entry_of("dog.txt", **options), folder, solver, config)


@pytest.mark.parametrize("phases", [TROT, PACE, WALK])
@pytest.mark.parametrize("turn_rate", [0.0, 0.5])
def test_generated_gaits_become_clean_clips(solver, tmp_path, phases, turn_rate):
    gait = DogGait(phases=phases, turn_rate=turn_rate, duty=0.6)
    generated = generate(gait, 181)
    result = make(generated.points, tmp_path, solver)
    quality = assess(result, GO2)
    assert clip_faults(quality) == []
    assert quality.penetration < 5e-4
    assert quality.fidelity.contact_slip < 0.01
    truth = generated.contact[60:120]
    assert np.mean((result.clip.stance > 0.5) == truth) > 0.85
    assert quality.speed == pytest.approx(0.825 * gait.speed, rel=0.02)


def test_sliding_and_sinking_feet_are_repaired(solver, tmp_path):
    """The faults of real captures: standing toes drift back at 0.3 m/s and the floor is not level for them."""
    generated = generate(DogGait(duty=0.6), 181)
    points = generated.points.copy()
    for leg, column in enumerate((10, 15, 19, 23)):
        since = np.zeros(181)
        for frame in range(1, 181):
            since[frame] = since[frame - 1] + 1.0 if generated.contact[frame, leg] else 0.0
        points[:, column, 0] += 0.3 * since / 60.0
        points[:, column, 2] += -0.01 + 0.005 * leg
    clean, plain = (
        assess(make(points, tmp_path, solver, RetargetConfig(mode=mode, search_time=0.0)), GO2)
        for mode in ("contact", "plain")
    )
    assert plain.fidelity.contact_slip > 0.1
    assert clean.fidelity.contact_slip < 0.01
    assert clean.penetration < 5e-4


def test_a_crouching_animal_keeps_belly_and_knees_above_the_floor(solver, tmp_path):
    quality = assess(make(generate(DogGait(body_height=0.16, duty=0.6), 181).points, tmp_path, solver), GO2)
    assert quality.penetration < 2e-3
    assert quality.joint_margin > -1e-6
    plain = make(
        generate(DogGait(body_height=0.16, duty=0.6), 181).points, tmp_path, solver, RetargetConfig(mode="plain")
    )
    assert assess(plain, GO2).penetration > 0.005, "the frame-wise rule does not"


def test_a_tall_animal_does_not_lock_the_knees(solver, tmp_path):
    quality = assess(make(generate(DogGait(body_height=0.62, duty=0.6), 181).points, tmp_path, solver), GO2)
    assert quality.joint_margin > 0.03
    assert quality.residual < 2e-3


def test_a_motion_too_fast_for_the_motors_is_slowed_by_the_smallest_factor(solver, tmp_path):
    gait = DogGait(stride_frames=10, speed=2.2, step_height=0.14)
    result = make(generate(gait, 91).points, tmp_path, solver, start=30, end=60)
    assert result.clip.slow_down > 1.05
    assert assess(result, GO2).speed_share == pytest.approx(1.0, abs=1e-9)
    assert result.clip.period == pytest.approx(30 / 60 * result.clip.slow_down)


@pytest.mark.parametrize("yaw", [0.5, 2.5, -1.2])
def test_turning_and_moving_the_source_changes_nothing(solver, tmp_path, yaw):
    """A clip begins at the origin with heading 0, so that nothing at all may change."""
    points = generate(DogGait(turn_rate=0.4), 181).points
    turned = Rotation.from_rotvec([0.0, 0.0, yaw]).apply(points.reshape(-1, 3)).reshape(points.shape)
    here = make(points, tmp_path, solver).clip
    there = make(turned + np.array([7.0, -3.0, 0.0]), tmp_path, solver).clip
    np.testing.assert_allclose(there.root_position, here.root_position, atol=1e-4)
    np.testing.assert_allclose(there.joint_position, here.joint_position, atol=2e-3)
    assert there.cycle.yaw == pytest.approx(here.cycle.yaw, abs=1e-4)


def test_reading_at_60_and_at_50_hz_gives_the_same_path_in_time(solver, tmp_path):
    clips = []
    for rate in (60.0, 50.0):
        gait = DogGait(rate=rate, stride_frames=round(0.6 * rate), turn_rate=0.3)
        position = generate(gait, round(3.6 * rate) + 1).points
        write_ai4animation(position, tmp_path / "dog.txt")
        entry = entry_of("dog.txt", round(1.2 * rate), round(2.4 * rate), rate=rate)
        source = type(entry.motion_source)
        source.rate, kept = rate, source.rate
        try:
            clips.append(retarget(entry, tmp_path, solver, KEEP_RANGE).clip)
        finally:
            source.rate = kept
    assert clips[0].period == pytest.approx(clips[1].period)
    back = clips[1].resampled(60.0, GO2)
    np.testing.assert_allclose(back.root_position, clips[0].root_position, atol=4e-3)
    assert np.median(np.abs(back.joint_position - clips[0].joint_position)) < 0.02


def test_a_known_gait_of_solo8_comes_back(solver, tmp_path):
    """Foot paths within 2 mm after scaling, the right speed, and knees that bend as the Go2's do."""
    torch.save(torch.tensor(solo_trot()[None], dtype=torch.float64), tmp_path / "solo8.pt")
    entry = entry_of("solo8.pt:0", 25, 75, "solo8", 50.0)
    clip = retarget(entry, tmp_path, solver, RetargetConfig(mode="plain")).clip
    source = entry.motion_source
    motion = source.read(tmp_path / "solo8.pt:0")
    toes = source.scale * (motion.points("toe") - motion.points("hip"))[25:75]
    level = Rotation.from_rotvec([0.0, 0.0, -0.2])
    expected = level.apply(toes.reshape(-1, 3)).reshape(toes.shape)
    rotation = to_rotation(clip.root_orientation).as_matrix()
    hips = np.einsum("tij,kj->tki", rotation, np.array([leg.hip_offset for leg in GO2.legs]))
    feet = np.einsum("tij,tkj->tki", rotation, foot_positions(GO2, clip.joint_position)) - hips
    # Ends are blended into one another; heights are measured from the standing foot.
    middle = slice(13, 37)
    paths = [values[middle] - values[middle].mean(axis=0) for values in (feet[..., :2], expected[..., :2])]
    np.testing.assert_allclose(paths[0], paths[1], atol=2e-3)
    speed = np.linalg.norm([clip.cycle.x, clip.cycle.y]) / clip.period
    assert speed == pytest.approx(1.33 * 0.5, rel=1e-3)
    assert np.all(clip.joint_position[:, 2::3] < -0.8), "all knees bend backwards"


def test_the_cycle_goes_on_without_a_jump(clip):
    longer = clip.extended(0, 30)
    steps = np.abs(np.diff(longer.joints, axis=0)).max(axis=1)
    assert steps[clip.num_frames - 1] <= 1.2 * steps.max()
    np.testing.assert_allclose(longer.joints[30:], longer.joints[:30])


REAL = [name for name in load_catalogue() if name.startswith(("ai4", "vhdc"))]


@pytest.mark.parametrize("name", REAL)
def test_every_real_motion_becomes_a_clean_clip(name, data_folder, solver):
    quality = assess(retarget(motion_named(name), data_folder, solver, RetargetConfig()), GO2)
    assert clip_faults(quality) == []
    assert quality.penetration <= 0.002
    assert quality.fidelity.contact_slip <= 0.05
    # A turn on the spot goes 11 cm, of which the blend of its seam takes 1.5 cm.
    assert abs(quality.path_error) <= 0.05 or abs(quality.path_error) * quality.speed * quality.period <= 0.02
    assert quality.joint_margin >= 0.0
    assert quality.speed_share <= 1.0 + 1e-9
    ours = quality.fidelity
    # In the file of that turn itself the lifted line from pelvis to neck is 1.04 deg above that from hips to shoulders.
    assert abs(ours.trunk_pitch) <= (1.1 if name == "ai4_dog_left_turn" else 1.0)
    assert min(ours.swing_front, ours.swing_hind) >= 0.85
    assert abs(ours.duty) <= 0.04
    assert ours.height_correlation >= 0.9
    assert ours.base_dip <= 0.015
    assert ours.seam_acceleration <= 1.2 * ours.other_acceleration
    assert ours.seam_acceleration <= 7.8 or ours.animal_acceleration > 7.8
    assert abs(ours.seam_shift) < 0.1


def test_a_range_played_once_comes_from_rest_and_to_rest_on_the_way_of_its_source(solver, tmp_path):
    generated = generate(DogGait(), 181)
    write_ai4animation(generated.points, tmp_path / "dog.txt")
    entry = replace(entry_of("dog.txt", start=60, end=120), kind="once", hold=0.3)
    result = retarget(entry, tmp_path, solver, KEEP_RANGE)
    clip, quality = result.clip, assess(result, GO2)
    held, ramp = 18, 30
    assert clip.kind == "once"
    assert clip.num_frames == 60 + ramp + 2 * held
    assert (clip.origin.start, clip.origin.end) == (60, 120)
    assert clip_faults(quality) == []
    assert clip_remarks(quality) == []
    assert np.isnan(clip.fidelity.seam_acceleration)
    for values in (clip.joint_position, clip.root_position):
        for ends in (values[: held + 1], values[-held - 1 :]):
            assert np.ptp(ends, axis=0).max() < 2e-3
    for speeds in (clip.joint_velocity, clip.root_linear_velocity, clip.root_angular_velocity):
        assert not speeds[[0, -1]].any()
        jumps = np.abs(np.diff(speeds, axis=0)).max(axis=1)
        slowing = np.r_[: held + ramp, len(jumps) - held - ramp : len(jumps)]
        assert jumps[slowing].max() <= 1.25 * jumps[held + ramp : -held - ramp].max() + 1e-9
    # The generated dog goes straight on at one speed; half of the time of each slow-down is lost.
    scale = 0.825
    expected = scale * DogGait().speed * 59 / 60
    assert clip.displacement == pytest.approx((expected, 0.0, 0.0), abs=2e-3)


def test_a_crouch_is_played_once_in_both_modes_and_keeps_its_depth_and_its_feet(solver, tmp_path):
    write_ai4animation(generate(CROUCH, 240).points, tmp_path / "dog.txt")
    for mode in ("contact", "plain"):
        entry = replace(entry_of("dog.txt", start=30, end=121), kind="once", mode=mode)
        result = retarget(entry, tmp_path, solver, KEEP_RANGE)
        clip = result.clip
        assert clip_faults(assess(result, GO2)) == []
        depth = 0.825 * CROUCH.dip * np.array([0.0, 0.5, 1.0])
        height = clip.root_position[:, 2]
        np.testing.assert_allclose(height[-1] - np.array([height[-1], height[0], height.min()]), depth, atol=2e-3)
        assert np.ptp(clip.foot_position[..., :2], axis=0).max() < 0.02
        assert clip.stance.all()


def test_ends_on_which_no_robot_stands_are_named(solver, tmp_path):
    write_ai4animation(generate(DogGait(phases=PACE, duty=0.5), 181).points, tmp_path / "dog.txt")
    entry = replace(entry_of("dog.txt", start=65, end=115), kind="once")
    quality = assess(retarget(entry, tmp_path, solver, replace(KEEP_RANGE, slow_down_time=0.1)), GO2)
    assert [fault for fault in clip_faults(quality) if "first pose cannot be held: 2 feet stand" in fault]
    square = np.array([[0.1, 0.1], [0.1, -0.1], [-0.1, 0.1], [-0.1, -0.1]])
    beside, far = np.array([0.25, 0.0]), np.array([0.4, 0.5])
    assert distance_to_hull(square) == pytest.approx(0.0, abs=1e-6)
    assert distance_to_hull(square + beside) == pytest.approx(0.15, abs=1e-6)
    assert distance_to_hull(square + far) == pytest.approx(0.5, abs=1e-6)


def test_faults_are_named():
    good = assess_example()
    assert clip_faults(good) == []
    bad = replace(
        good,
        period=0.05,
        penetration=0.01,
        seam_jump=3.0,
        seam_step=4.0,
        path_error=-0.2,
        joint_margin=-0.1,
        speed_share=1.4,
        residual=0.05,
        foot_moved=0.3,
        speed=10.0,
        fidelity=replace(good.fidelity, contact_slip=0.3, seam_shift=0.5),
    )
    assert len(clip_faults(bad)) == 10


def test_what_is_no_fault_but_needs_a_word_is_remarked_on():
    good = assess_example()
    assert clip_remarks(good) == []
    other = replace(
        good,
        seam_score=1.3,
        slow_down=1.2,
        fidelity=replace(
            good.fidelity,
            trunk_pitch=12.0,
            swing_hind=0.5,
            duty=0.1,
            height_correlation=0.5,
            base_dip=0.05,
            seam_acceleration=20.0,
        ),
    )
    assert clip_faults(other) == []
    assert clip_remarks(other) == [
        "the source does not repeat itself: seam score 1.30",
        "trunk pitched by +12.0 deg",
        "swing height kept: 1.00 front, 0.50 hind",
        "feet stand +10 % of the time against the animal's",
        "base height follows the trunk's with r = 0.50",
        "base dips by 50 mm",
        "20.0 m/s^2 at the seam, 3.0 elsewhere",
        "slowed by 1.20 for the motors",
    ]
    for seam, animal in ((3.7, 5.0), (8.0, 7.7)):
        usual = 3.0 if seam < 5.0 else 7.0
        ours = replace(good.fidelity, seam_acceleration=seam, other_acceleration=usual, animal_acceleration=animal)
        assert clip_remarks(replace(good, fidelity=ours)) == [f"{seam:.1f} m/s^2 at the seam, {usual:.1f} elsewhere"]


def assess_example():
    return ClipQuality(
        name="a",
        frames=30,
        period=0.5,
        residual=1e-4,
        foot_moved=0.0,
        penetration=0.0,
        joint_margin=0.2,
        speed_share=0.5,
        seam_score=0.1,
        seam_jump=1.0,
        seam_step=1.0,
        speed=0.6,
        path_error=0.0,
        slow_down=1.0,
        start=0,
        end=30,
        fidelity=Fidelity(
            trunk_pitch=0.0,
            swing_front=1.0,
            swing_hind=1.0,
            duty=0.0,
            height_correlation=1.0,
            base_dip=0.0,
            seam_acceleration=2.0,
            other_acceleration=3.0,
            animal_acceleration=2.0,
            seam_shift=0.0,
            contact_slip=0.0,
            contact_slip_95=0.0,
            penetration=0.0,
            knee_bent_margin=0.5,
            knee_straight_margin=0.5,
            high_frequency=0.0,
            flight_acceleration=float("nan"),
            flight_share=0.0,
        ),
    )


def test_a_rate_that_is_not_the_files_own_is_refused(solver, tmp_path):
    write_horse(tmp_path / "horse.csv", *horse())
    with pytest.raises(ClipError, match=r"runs at 60\.0 Hz, but the catalogue says 120 Hz"):
        retarget(entry_of("horse.csv", rate=120.0, source="vhdc"), tmp_path, solver, KEEP_RANGE)


def test_the_rate_of_a_text_file_is_the_catalogues(solver, tmp_path):
    """Case rate-of-a-text-file: a trot at 30 Hz lasts as long as one at 60 Hz."""
    write_ai4animation(generate(DogGait(rate=30.0, stride_frames=15), 60).points, tmp_path / "dog.txt")
    quality = assess(retarget(entry_of("dog.txt", 15, 30, rate=30.0), tmp_path, solver, KEEP_RANGE), GO2)
    assert quality.period == pytest.approx(0.5)
    assert quality.speed == pytest.approx(0.825 * DogGait().speed, rel=0.02)
