import json
from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.motions.cycle import CycleStep


def rewritten(path, **changes):
    """Write arrays, or entries of the header, of a clip's file anew."""
    with np.load(path) as data:
        content = {name: data[name] for name in data.files}
    header = json.loads(str(content["header"]))
    for name, value in changes.items():
        if name in content:
            content[name] = np.asarray(value(content[name]))
        else:
            header[name] = value
    np.savez(path, **{**content, "header": np.array(json.dumps(header))})
    return path


def with_row(row, value):
    def change(values):
        values = values.copy()
        values[row] = value
        return values

    return change


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "../../evil"}, "is no name for a motion; use at most 100 letters, digits"),
        ({"name": "/tmp/evil"}, "is no name for a motion"),
        ({"name": "red\x1b[31m"}, r"'red\\x1b\[31m' is no name"),
        ({"name": ""}, "is no name"),
        ({"name": 3}, "3 is no name"),
        ({"name": "reviews.json"}, "a name that other files have"),
        ({"frame_duration": 0.0}, "frame_duration is 0 s, not within"),
        ({"frame_duration": -0.016}, "frame_duration is -0.016 s"),
        ({"frame_duration": "x"}, "frame_duration is 'x', not a finite number"),
        ({"frame_duration": float("nan")}, "frame_duration is nan"),
        ({"slow_down": 0.0}, "slow_down is 0 and must be positive"),
        ({"joint_position": lambda v: v[:, :8]}, r"joint_position has shape \(\d+, 8\), not \(\d+, 12\)"),
        ({"joint_position": lambda v: v.astype(str)}, "joint_position holds <U32, not numbers"),
        ({"joint_position": np.degrees}, "beyond its limit; joints are in radians"),
        ({"joint_position": with_row((4, 2), np.nan)}, "joint_position is not finite in frame 4"),
        ({"joint_velocity": lambda v: 2.0 * v}, "joint_velocity is up to .* off what follows from the poses"),
        ({"foot_position": lambda v: v[:, ::-1]}, "foot_position is up to .* off what follows"),
        ({"root_orientation": with_row(3, 0.0)}, "root_orientation has length 0, not 1, in frame 3"),
        ({"root_position": lambda v: v[:-1]}, "root_orientation has shape"),
        ({"root_position": lambda v: v[:1]}, r"1 frame; a clip needs at least 3"),
        ({"foot_position": lambda v: v + np.array([0.0, 0.0, 50.0])}, "the lowest foot is 50 m over the floor"),
        ({"stance": lambda v: 7.0 * v}, "stance holds numbers beyond 0 to 1"),
        ({"body_rests": lambda v: v - 1.0}, "body_rests holds numbers beyond 0 to 1"),
        ({"robot": 7}, "robot is 7, not a text"),
        ({"origin": {"licence": ["own"]}}, "origin.licence is .'own'., not a text"),
        ({"origin": {"start": "0"}}, "origin.start is '0', not a number"),
        ({"cycle": {"x": 0.1, "y": float("inf"), "yaw": 0.0}}, "cycle.y is inf"),
    ],
)
def test_what_no_clip_can_be_is_refused(clip, tmp_path, changes, message):
    clip.save(tmp_path / "clip.npz")
    with pytest.raises(ClipError, match=message) as caught:
        MotionClip.load(rewritten(tmp_path / "clip.npz", **changes))
    assert "\n" not in str(caught.value)
    assert "\x1b" not in str(caught.value)


def test_a_clip_played_once_must_be_at_rest_at_its_ends(clip, once_clip, tmp_path):
    once_clip.save(tmp_path / "once.npz")
    assert MotionClip.load(tmp_path / "once.npz").kind == "once"
    replace(clip, cycle=None).completed(clip.spec).save(tmp_path / "moving.npz")
    with pytest.raises(ClipError, match=r"it is played once, but moves at \d"):
        MotionClip.load(tmp_path / "moving.npz")


def test_a_short_and_a_slowed_clip_are_clips(clip, tmp_path):
    slowed = replace(clip, frame_duration=3.0 * clip.frame_duration, slow_down=3.0).completed(clip.spec)
    slowed.save(tmp_path / "slow.npz")
    assert MotionClip.load(tmp_path / "slow.npz").slow_down == 3.0
    few = clip.resampled(3.0 / clip.period, clip.spec)
    few.save(tmp_path / "few.npz")
    assert MotionClip.load(tmp_path / "few.npz").num_frames == 3
    assert isinstance(MotionClip.load(tmp_path / "few.npz").cycle, CycleStep)
