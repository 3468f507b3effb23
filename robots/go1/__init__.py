"""The Unitree Go1."""

from pathlib import Path

from kine2go_warp.robots.unitree import GO2_NO_LOAD_SPEED, unitree_robot

GO1 = unitree_robot(
    Path(__file__).with_name("go1.urdf"),
    # Largest torques and speeds are the Go2's; the curve between them is assumed to be, too.
    no_load_speed=GO2_NO_LOAD_SPEED,
    # MuJoCo Menagerie; the maker's URDF has none.
    joint_friction=(0.2, 0.2, 0.2),
    default_root_height=0.334,
    # MuJoCo Menagerie. The maker's rotor, 0.000112 kg m^2, by a gear of 6.33 gives 0.0045 at hips and thighs, 0.0101 at
    # the calves.
    armature=0.01,
)
"""13.1 kg, legs of 0.426 m. Its published controllers use the gains of the Go2's (20 N m/rad, 0.5 N m s/rad)."""
