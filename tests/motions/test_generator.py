import numpy as np
import pytest

from kine2go_warp.motions.generator import PACE, TROT, WALK, DogGait, generate
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT

TOES = [COLUMN_OF_KEYPOINT[f"{leg}_toe"] for leg in ("FL", "FR", "RL", "RR")]


@pytest.mark.parametrize("phases", [TROT, PACE, WALK])
@pytest.mark.parametrize("turn_rate", [0.0, 0.6])
def test_standing_feet_stand_still_on_the_floor(phases, turn_rate):
    gait = DogGait(phases=phases, turn_rate=turn_rate, duty=0.6)
    motion = generate(gait, 120)
    toes = motion.points[:, TOES]
    both = motion.contact[1:] & motion.contact[:-1]
    step = np.linalg.norm(np.diff(toes, axis=0), axis=-1)
    assert step[both].max() < 1e-12
    np.testing.assert_allclose(toes[..., 2][motion.contact], gait.toe_height)
    assert toes[..., 2].max() == pytest.approx(gait.toe_height + gait.step_height, abs=2e-3)


def test_speed_turn_and_duty_are_those_asked_for():
    gait = DogGait(speed=0.9, turn_rate=0.4, duty=0.6)
    motion = generate(gait, 301)
    speed = np.linalg.norm(np.diff(motion.trunk[:, :2], axis=0), axis=1) * gait.rate
    np.testing.assert_allclose(speed, 0.9, rtol=1e-4)
    assert motion.heading[-1] == pytest.approx(0.4 * 5.0)
    np.testing.assert_allclose(motion.contact[:300].mean(axis=0), 0.6, atol=1.0 / gait.stride_frames)


def test_the_bundled_file_is_what_the_generator_writes(tmp_path):
    from kine2go_warp.motions.catalogue import motion_named
    from kine2go_warp.motions.generator import write_ai4animation

    write_ai4animation(generate(DogGait(), 91).points, tmp_path / "dog.txt")
    assert (tmp_path / "dog.txt").read_text() == motion_named("dog_trot").path(None).read_text()
