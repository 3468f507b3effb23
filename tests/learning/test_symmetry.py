"""Left for right: a mirrored robot that tracks a mirrored clip sees the mirror image."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from kine2go_warp.env.config import ResetConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.observations import place_privileged, place_terms
from kine2go_warp.learning.presets import PRESETS
from kine2go_warp.learning.symmetry import Mirrored, mirrored_action, with_mirrored
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.motions.catalogue import motion_named
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.robots import GO2
from kine2go_warp.training.train import train

EXACTLY_ON_THE_REFERENCE = ResetConfig(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def mirror_clip(clip):
    """The clip left for right."""
    cycle = replace(clip.cycle, y=-clip.cycle.y, yaw=-clip.cycle.yaw)
    joints = mirrored_action(torch.from_numpy(clip.joint_position)).numpy()
    mirrored = replace(
        clip,
        root_position=clip.root_position * [1.0, -1.0, 1.0],
        root_orientation=clip.root_orientation * [1.0, -1.0, 1.0, -1.0],
        joint_position=joints,
        stance=clip.stance[:, [1, 0, 3, 2]],
        cycle=cycle,
    )
    return mirrored.completed(GO2)


@pytest.fixture(scope="module")
def turning_clip(data_folder, solver):
    """A clip that is not symmetric in any way: a walk along a curve."""
    return retarget(motion_named("ai4_dog_walk_06"), data_folder, solver, RetargetConfig()).clip


@pytest.fixture(scope="module")
def pair(turning_clip, small_config):
    """Worlds that begin on the clip, and their mirror images."""
    config = replace(small_config, num_worlds=32, reset=EXACTLY_ON_THE_REFERENCE, privileged=True)
    clips = turning_clip, mirror_clip(turning_clip)
    return [ImitationVecEnv(ImitationEnvironment([clip], config, "cpu")) for clip in clips]


def test_a_mirrored_robot_sees_and_earns_the_mirror_image_also_after_steps(pair, rng):
    ours, theirs = pair
    mirror = Mirrored.of(place_terms(ours.config))
    critic_mirror = Mirrored.of(place_privileged(ours.config))
    seen, images = ours.get_observations(), theirs.get_observations()
    torch.testing.assert_close(mirror(seen["policy"]), images["policy"], rtol=0.0, atol=2e-5)
    for _ in range(6):
        outputs = torch.from_numpy(np.float32(rng.normal(0.0, 0.3, (32, 12))))
        seen, reward, *_ = ours.step(outputs)
        images, their_reward, *_ = theirs.step(mirrored_action(outputs))
    # The robot's own inertias are not quite symmetric, so the worlds part in time, but slowly.
    difference = (mirror(seen["policy"]) - images["policy"]).abs()
    assert difference.median() < 2e-3
    assert (mirror(seen["policy"]) - seen["policy"]).abs().median() > 20 * difference.median(), "not alike anyway"
    torch.testing.assert_close(reward, their_reward, rtol=0.05, atol=1e-3)
    apart = (critic_mirror(seen["privileged"]) - images["privileged"]).abs()
    unmirrored = (seen["privileged"] - images["privileged"]).abs()
    assert apart.sum() < 0.2 * unmirrored.sum()


def test_mirroring_twice_changes_nothing(pair):
    env = pair[0]
    for layout in (place_terms(env.config), place_privileged(env.config)):
        mirror = Mirrored.of(layout)
        values = torch.arange(1.0, layout[-1].field.stop + 1.0)
        assert torch.equal(mirror(mirror(values)), values)
        assert not torch.equal(mirror(values), values)


def test_mirrored_samples_follow_the_others_as_rsl_rl_expects(pair):
    env = pair[0]
    seen = env.get_observations()
    outputs = torch.rand(32, 12)
    both, both_outputs = with_mirrored(env, seen, outputs)
    assert isinstance(both, TensorDict)
    assert both.batch_size[0] == 64
    assert torch.equal(both["policy"][:32], seen["policy"])
    assert torch.equal(both_outputs[:32], outputs)
    assert torch.equal(both_outputs[32:], mirrored_action(outputs))
    assert with_mirrored(env, None, outputs)[0] is None


def test_the_joints_are_named_in_the_order_that_is_swapped():
    names = np.array(GO2.joint_names)
    swapped = mirrored_action(torch.arange(12.0) + 1.0).abs().int().numpy() - 1
    sides = str.maketrans("LR", "RL")
    assert [
        name[:2].translate(sides) + name[2:] if name[0] != "R" else "R" + name[1].translate(sides) + name[2:]
        for name in names
    ] == list(names[swapped])


@pytest.mark.parametrize("name", ["fast", "robust"])
def test_training_with_symmetry_runs(clip, tmp_path, name):
    preset = PRESETS[name].override({"env.num_worlds": 16, "ppo.iterations": 1, "ppo.symmetry": True})
    record = train([clip], preset, tmp_path / "policy", "cpu")
    assert record.preset.ppo.symmetry
    assert record.complete
