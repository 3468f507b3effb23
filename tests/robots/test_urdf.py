"""Links merged over fixed joints, against MuJoCo's own URDF compiler."""

from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.robots import GO2
from kine2go_warp.robots.urdf import merge_fixed_links

CHAIN = """<robot name="chain">
  <link name="base"><inertial><origin xyz="0.1 0 0.02" rpy="0.3 0.2 -0.4"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0.001" ixz="0.002" iyy="0.03" iyz="-0.001" izz="0.025"/></inertial></link>
  <joint name="plate_joint" type="fixed"><origin xyz="0.2 -0.1 0.3" rpy="0.5 -0.7 1.1"/>
    <parent link="base"/><child link="plate"/></joint>
  <link name="plate"><inertial><origin xyz="0.05 0.02 0" rpy="-0.2 0.1 0.6"/><mass value="0.7"/>
    <inertia ixx="0.004" ixy="0.0005" ixz="0" iyy="0.006" iyz="0.0002" izz="0.005"/></inertial>
    <collision name="plate_box"><origin xyz="0 0.1 0" rpy="0 0 0.3"/><geometry><box size="0.1 0.2 0.3"/></geometry>
    </collision></link>
  <joint name="lamp_joint" type="fixed"><origin xyz="0 0 0.4" rpy="0 1.2 0"/>
    <parent link="plate"/><child link="lamp"/></joint>
  <link name="lamp"><inertial><mass value="0.3"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.0015"/></inertial></link>
  <joint name="arm_joint" type="revolute"><origin xyz="0.1 0 0" rpy="0.4 0 0"/><axis xyz="0 1 0"/>
    <parent link="lamp"/><child link="arm"/><limit lower="-1" upper="1" effort="5" velocity="3"/></joint>
  <link name="arm"><inertial><origin xyz="0 0 -0.1"/><mass value="0.5"/>
    <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.001"/></inertial></link>
</robot>"""


def compiled(urdf, merges_itself):
    """MuJoCo's model of a floating robot."""
    spec = mujoco.MjSpec.from_string(urdf)
    spec.compiler.fusestatic = merges_itself
    spec.bodies[1].add_freejoint()
    return spec.compile()


def test_bodies_shapes_and_joints_are_those_that_mujoco_merges():
    """Case 03-merged-calf-inertia."""
    root = ElementTree.fromstring(CHAIN)
    merge_fixed_links(root)
    ours, theirs = compiled(ElementTree.tostring(root, encoding="unicode"), False), compiled(CHAIN, True)
    assert ours.nbody == theirs.nbody == 3
    np.testing.assert_allclose(ours.body_mass, theirs.body_mass)
    np.testing.assert_allclose(ours.body_ipos, theirs.body_ipos, atol=1e-12)
    np.testing.assert_allclose(ours.body_inertia, theirs.body_inertia, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(ours.body_pos, theirs.body_pos, atol=1e-12)
    for name in ("body_quat", "body_iquat", "geom_quat"):
        turn = np.abs(np.sum(getattr(ours, name) * getattr(theirs, name), axis=1))
        np.testing.assert_allclose(turn, 1.0, atol=1e-12, err_msg=name)
    np.testing.assert_allclose(ours.geom_pos, theirs.geom_pos, atol=1e-12)


def test_no_fixed_joint_remains_and_no_mass_is_lost():
    root = ElementTree.parse(GO2.urdf).getroot()
    merge_fixed_links(root)
    assert not root.findall("joint[@type='fixed']")
    assert len(root.findall("link")) == 13
    assert sum(float(mass.attrib["value"]) for mass in root.iter("mass")) == pytest.approx(GO2.mass, rel=1e-12)


def test_a_joint_without_a_child_is_named():
    root = ElementTree.fromstring(
        '<robot><joint name="odd" type="fixed"><parent link="a"/></joint><link name="a"/></robot>'
    )
    with pytest.raises(Kine2GoError, match="joint odd has no child"):
        merge_fixed_links(root)
