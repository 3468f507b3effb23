"""BVH files: forward kinematics by hand, and every way in which a file can be wrong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.sources.bvh import read_bvh
from tests.motions.test_fuzz import FUZZ, damage

ARM = """HIERARCHY
ROOT Hips
{
  OFFSET 7 7 7
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Arm
  {
    OFFSET 10 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT Hand
    {
      OFFSET 5 0 0
      CHANNELS 3 Xposition Yposition Zposition
      End Site
      {
        OFFSET 0 2 0
      }
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.02
0 0 0  0 0 0  0 0 0  5 0 0
1 2 3  90 0 0  0 0 0  5 0 0
0 0 0  90 90 0  0 0 90  6 0 0
"""


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.bvh"
    path.write_text(ARM)
    return path


def test_joints_are_where_rotations_by_hand_put_them(arm):
    found = read_bvh(arm)
    assert found.rate == pytest.approx(50.0)
    places = found.positions()
    # The root is where its channels say; its offset is not added.
    np.testing.assert_allclose(places["Hips"], [[0, 0, 0], [1, 2, 3], [0, 0, 0]], atol=1e-12)
    # By 90 degrees about z, x becomes y.
    np.testing.assert_allclose(places["Arm"][:2], [[10, 0, 0], [1, 12, 3]], atol=1e-12)
    np.testing.assert_allclose(places["Hand"][:2], [[15, 0, 0], [1, 17, 3]], atol=1e-12)
    np.testing.assert_allclose(places["HandSite"][:2], [[15, 2, 0], [-1, 17, 3]], atol=1e-12)
    # Z, then X in the turned axes: x to y, y to z, z to x. The arm's own turn about y takes x to -z, which is -x there.
    np.testing.assert_allclose(places["Arm"][2], [0, 10, 0], atol=1e-12)
    np.testing.assert_allclose(places["Hand"][2], [-6, 10, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("HIERARCHY", "HIERARCHIE"), "not a BVH file"),
        (("MOTION", ""), "not a BVH file"),
        (("JOINT Hand", "JOINT Arm"), "line 10: a second joint 'Arm'"),
        (("OFFSET 5 0 0", "OFFSET 5 0"), "line 12: an offset is three numbers"),
        (("OFFSET 5 0 0", "OFFSET 5 0 nan"), "line 12: an offset is not finite"),
        (("CHANNELS 3 Z", "CHANNELS 4 Z"), "line 9: channels are a number"),
        (("Frames: 3", "Frames: 4"), "3 frames instead of the 4"),
        (("Frames: 3", "Frames: x"), "line 22: expected 'Frames:' and a number"),
        (("Frame Time: 0.02", "Frame Time: 0"), "frame time of 0 s"),
        (("90 90 0", "90 90"), "line 26: 11 columns instead of 12"),
        (("90 90 0", "90 inf 0"), "line 26: a value is not finite"),
        (("90 90 0", "90 x 0"), "line 26: not a number"),
        (("End Site", "End"), "'End' is nothing that a skeleton has here"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(arm, change, message):
    arm.write_text(ARM.replace(*change))
    with pytest.raises(ClipError, match=message):
        read_bvh(arm)


@FUZZ
@given(data=st.data())
def test_any_damage_is_read_or_refused(tmp_path, data):
    path = tmp_path / "arm.bvh"
    path.write_text(data.draw(damage(ARM)), encoding="utf-8", errors="surrogatepass")
    try:
        read_bvh(path).positions()
    except ClipError as error:
        assert "arm.bvh" in str(error)  # noqa: PT017 - either outcome is right
