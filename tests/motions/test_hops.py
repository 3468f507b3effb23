"""Hops in Solo8's layout: what was asked for is what its reader and the retargeter find."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.motions.catalogue import motion_named
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.hops import GRAVITY, Hop, base_height, generate_hops, write_solo8
from kine2go_warp.motions.keypoints import FrameRange
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.motions.sources import Solo8

HOP = Hop()


@pytest.fixture
def file(tmp_path):
    write_solo8(generate_hops(HOP, 120)[None], tmp_path / "hops.pt")
    return tmp_path / "hops.pt"


def test_the_base_falls_freely_in_flight_and_its_velocity_is_continuous():
    step = 1e-4
    time = np.arange(0.0, 2.0 * HOP.period, step)
    velocity = np.diff(base_height(HOP, time)) / step
    acceleration = np.diff(velocity) / step
    middle = np.abs(np.mod(time[1:-1], HOP.period) - HOP.stance_time - 0.5 * HOP.flight_time) < 0.09
    np.testing.assert_allclose(acceleration[middle], -GRAVITY, rtol=1e-3)
    assert np.abs(np.diff(velocity)).max() < 0.01
    assert base_height(HOP, time).max() == pytest.approx(HOP.height + HOP.rise, abs=1e-4)


def test_the_reader_finds_standing_feet_on_the_ground_and_lifted_ones_above(file):
    motion = Solo8().read(file.with_name("hops.pt:0"))
    toes = motion.points("toe")
    stands = np.mod(motion.time + 1e-9, HOP.period) < HOP.stance_time - 1e-6
    np.testing.assert_allclose(toes[stands][..., 2], 0.0, atol=1e-6)
    both = stands[1:] & stands[:-1]
    assert np.abs(np.diff(toes, axis=0)[both]).max() < 1e-6
    assert toes[..., 2].max() == pytest.approx(HOP.foot_lift, abs=2e-3)
    assert motion.rate == 50.0


def test_a_clip_of_hops_has_flight_phases_and_its_period(file, solver):
    entry = replace(motion_named("solo8_jump_forward_a"), name="hops", file="hops.pt:0", frames=FrameRange(25, 50))
    clip = retarget(entry, file.parent, solver, RetargetConfig()).clip
    assert clip.period == pytest.approx(HOP.period, rel=0.05)
    flight = np.mean(clip.stance.sum(axis=1) == 0)
    assert flight == pytest.approx(HOP.flight_time / HOP.period, abs=0.12)
    assert clip.cycle.x / clip.period == pytest.approx(Solo8.scale * HOP.speed, rel=0.05)
