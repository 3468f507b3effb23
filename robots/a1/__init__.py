"""The Unitree A1."""

from pathlib import Path

from kine2go_warp.robots.unitree import unitree_robot

A1 = unitree_robot(
    Path(__file__).with_name("a1.urdf"),
    # The URDF's largest speed. No curve of torque by speed is public: it is assumed to have the shape of the Go2's.
    no_load_speed=21.0,
    # The maker's URDF and MuJoCo Menagerie have 0.2 N m at all joints.
    joint_friction=(0.2, 0.2, 0.2),
    default_root_height=0.315,
    # MuJoCo Menagerie.
    armature=0.01,
)
"""12.5 kg, legs of 0.4 m. Isaac Lab gives its motors the gains of the Go2's (25 N m/rad, 0.5 N m s/rad)."""
