"""Horses: a synthetic one on a treadmill, whose speed is known, and the real ones."""

import numpy as np
import pytest

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.generator import DogGait, generate
from kine2go_warp.motions.sources import Vhdc
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.motions.sources.vhdc import HEADER, belt_velocity


def horse(speed=1.5, rate=60.0, num_frames=240, duty=0.6):
    """A gait three times the size of a dog's, on a treadmill that cancels its speed: markers in millimetres."""
    gait = DogGait(speed=speed / 3.0, rate=rate, stride_frames=int(rate), duty=duty)
    points = 3.0 * generate(gait, num_frames).points
    time = np.arange(num_frames) / rate
    points[..., 0] -= (speed * time)[:, None]
    names = {"Withers": "neck", "Sacrum": "pelvis", "HFL": "FL_toe", "HFR": "FR_toe", "HHL": "RL_toe", "HHR": "RR_toe"}
    markers = [
        points[:, COLUMN_OF_KEYPOINT[names.get(marker, "neck")]]
        for marker in ("Head", "Withers", "Sacrum", "HFL", "HFR", "HHL", "HHR")
    ]
    return time, 1e3 * np.stack(markers, axis=1)


def write(path, time, markers):
    rows = [",".join(f'"{name}"' for name in HEADER)]
    for index, (stamp, frame) in enumerate(zip(time, markers, strict=True)):
        rows.append(f"{index + 1},{stamp:.3f}," + ",".join(f"{value:.5f}" for value in frame.ravel()))
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize("rate", [60.0, 120.0])
def test_rate_and_speed_are_recovered_from_a_treadmill(tmp_path, rate):
    motion = Vhdc().read(write(tmp_path / "horse.csv", *horse(rate=rate, num_frames=int(4 * rate))))
    assert motion.rate == pytest.approx(rate, rel=1e-3)
    speed = np.diff(motion.point("neck")[:, 0]) * motion.rate
    np.testing.assert_allclose(speed.mean(), 1.5, rtol=0.003)
    assert motion.point("neck")[:, 2].std() < 0.05, "heights take no part"


def test_a_horse_does_not_climb_and_standing_hooves_do_not_slide(tmp_path):
    time, markers = horse()
    motion = Vhdc().read(write(tmp_path / "horse.csv", time, markers))
    np.testing.assert_allclose(motion.point("FL_toe")[:, 2], 1e-3 * markers[:, 3, 2], atol=1e-5)
    toes = motion.points("toe")
    low = toes[..., 2] - toes[..., 2].min(axis=0) < 1e-3
    slip = np.linalg.norm(np.diff(toes[..., :2], axis=0), axis=-1) * motion.rate
    assert slip[low[1:] & low[:-1]].mean() < 0.1


@pytest.mark.parametrize(
    ("speed", "rate", "duty"), [(1.6, 60.0, 0.6), (2.9, 120.0, 0.4), (0.8, 240.0, 0.7), (3.5, 60.0, 0.35)]
)
def test_the_belt_runs_at_one_speed_found_within_half_a_percent(rng, speed, rate, duty):
    _, markers = horse(speed, rate, int(5 * rate), duty)
    hooves = 1e-3 * markers[:, 3:] + rng.normal(0.0, 5e-4, markers[:, 3:].shape)
    belt, standing = belt_velocity(hooves, 1.0 / rate)
    np.testing.assert_allclose(belt, [-speed, 0.0], atol=0.005 * speed)
    assert standing.mean() == pytest.approx(duty, abs=0.12)


def change(text, old, new, count=1):
    assert old in text
    return text.replace(old, new, count)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: change(text, '"Time"', '"Zeit"'), "line 1: not the header"),
        (lambda text: change(text, "\n5,", "\n5,1,"), "line 6: 24 columns instead of 23"),
        (lambda text: change(text, ",0.050,", ",0.010,"), "does not increase"),
        (lambda text: change(text, ",0.050,", ",nan,"), "line 5: .*finite"),
        (lambda text: "\n".join(text.splitlines()[:1]), "1 line"),
    ],
    ids=["header", "columns", "time", "nan", "no frames"],
)
def test_a_malformed_file_is_refused_with_its_line(tmp_path, damage, message):
    path = write(tmp_path / "horse.csv", *horse(num_frames=30))
    path.write_text(damage(path.read_text()))
    with pytest.raises(ClipError, match=message):
        Vhdc().read(path)


def test_a_gap_in_time_and_a_horse_100_m_tall_are_refused(tmp_path):
    time, markers = horse(num_frames=60)
    with pytest.raises(ClipError, match="not evenly spaced"):
        Vhdc().read(write(tmp_path / "gap.csv", np.where(time > 0.5, time + 0.2, time), markers))
    with pytest.raises(ClipError, match="millimetres"):
        Vhdc().read(write(tmp_path / "tall.csv", time, 80.0 * markers))


@pytest.mark.parametrize("session", ["M1", "M2"])
@pytest.mark.parametrize("gait", ["walk1", "trot1"])
def test_real_horses_last_as_long_as_their_time_column_says(data_folder, session, gait):
    path = data_folder / "vhdc" / f"Horse1_{session}_{gait}_kinematics.csv"
    motion = Vhdc().read(path)
    last = float(path.read_text().rstrip().splitlines()[-1].split(",")[1])
    assert motion.time[-1] == pytest.approx(last, abs=2e-3)
    assert motion.rate == pytest.approx(60.0 if session == "M1" else 120.0, rel=1e-3)
    speed = np.linalg.norm(motion.point("neck")[-1, :2] - motion.point("neck")[0, :2]) / last
    assert 1.0 < speed < 2.0 if gait == "walk1" else 2.0 < speed < 4.5


@pytest.mark.parametrize(("gait", "expected"), [("trot1", 2.903), ("walk1", 1.530)])
def test_the_belts_speed_is_that_of_mid_stance_on_real_horses(data_folder, gait, expected):
    motion = Vhdc().read(data_folder / "vhdc" / f"Horse1_M1_{gait}_kinematics.csv")
    toes = motion.points("toe")
    way = np.linalg.norm(motion.point("neck")[-1, :2] - motion.point("neck")[0, :2])
    assert way / motion.time[-1] == pytest.approx(expected, rel=0.01)
    # A hoof in the middle of its stance is at rest on the ground.
    low = toes[..., 2] < np.quantile(toes[..., 2], 0.3, axis=0)
    middle = low & np.roll(low, 6, axis=0) & np.roll(low, -6, axis=0)
    speed = np.linalg.norm(np.gradient(toes[..., :2], 1.0 / motion.rate, axis=0), axis=-1)
    assert np.median(speed[middle]) < 0.03 * expected
