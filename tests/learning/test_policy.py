"""The record of a policy."""

import pytest

from kine2go_warp.env.terms.base import find_term
from kine2go_warp.errors import PolicyError
from kine2go_warp.learning.policy import PolicyFolder, PolicyRecord, read_preset
from kine2go_warp.learning.presets import FAST
from kine2go_warp.settings import to_dictionary

BEFORE = {"max_distance": 0.2, "max_angle": 0.5, "initial_limit_scale": 4.0, "limit_anneal_time": 16.0}
"""Limits as they were recorded before ends of episodes were terms."""


def test_limits_are_read_from_the_record_of_an_older_policy():
    values = to_dictionary(FAST)
    for name in ("terminations", "initial_limit_scale", "limit_anneal_time"):
        del values["env"][name]
    env = read_preset({**values, "env": {**values["env"], "termination": BEFORE}}, "policy.json").env
    assert find_term(env.terminations, "distance").params == (("max_distance", 0.2),)
    assert find_term(env.terminations, "rotation").params == (("max_angle", 0.5),)
    assert (env.initial_limit_scale, env.limit_anneal_time) == (4.0, 16.0)
    assert env.randomization == FAST.env.randomization


def test_the_record_of_this_version_is_read_as_it_was_written():
    assert read_preset(to_dictionary(FAST), "policy.json") == FAST
    with pytest.raises(PolicyError, match=r"policy\.json: unknown key 'env.terminatons'"):
        read_preset({"env": {"terminatons": {}}}, "policy.json")


def test_a_clip_that_was_exchanged_is_refused(clip, tmp_path):
    folder = PolicyFolder(tmp_path)
    record = PolicyRecord(FAST, folder.write_clips((clip,)), "", 0, 0.0, clip_hashes=(clip.content_hash(),))
    folder.write_record(record)
    assert folder.read_clips(folder.read_record())[0].content_hash() == clip.content_hash()
    clip.resampled(50.0, clip.spec).save(tmp_path / record.clips[0])
    with pytest.raises(PolicyError, match=r"dog_trot.npz: not the clip that the policy was trained on; put that one"):
        folder.read_clips(folder.read_record())


@pytest.mark.parametrize("name", ["../clip.npz", "/tmp/clip.npz", ""])
def test_clips_outside_the_folder_are_refused(tmp_path, name):
    folder = PolicyFolder(tmp_path)
    folder.write_record(PolicyRecord(FAST, (name,), "", 0, 0.0))
    with pytest.raises(PolicyError, match="is no name for a motion"):
        folder.read_clips(folder.read_record())
