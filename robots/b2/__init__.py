"""The Unitree B2."""

from pathlib import Path

from kine2go_warp.robots.unitree import GO2_FRICTION, GO2_PEAK_TORQUE, unitree_robot

PEAK_TORQUE = 200.0
"""Largest torque of a hip [N m]."""

B2 = unitree_robot(
    Path(__file__).with_name("b2.urdf"),
    # The URDF's largest speed. No curve of torque by speed is public: it is assumed to have the shape of the Go2's.
    no_load_speed=23.0,
    # Not public: assumed to be the same share of the largest torque as the Go2's.
    joint_friction=tuple(PEAK_TORQUE / GO2_PEAK_TORQUE * torque for torque in GO2_FRICTION),
    default_root_height=0.547,
    # The maker's MuJoCo model (unitree_mujoco).
    armature=0.1,
    # robot_lab, and projects after it, have 160 N m/rad and 5 N m s/rad where the Go2 has 25 and 0.5. Weight times leg
    # length, by which the torque for an angle grows, is 8.2 times the Go2's.
    stiffness_factor=6.4,
    damping_factor=10.0,
)
"""74.6 kg by the maker's URDF, with every rotor; the data sheet has about 60 kg. Legs of 0.7 m."""
