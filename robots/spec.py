"""The typed description of a quadruped with three joints a leg."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

LEG_JOINTS = ("hip", "thigh", "calf")

GO2_LEG_LENGTH, GO2_THIGH_OFFSET = 0.426, 0.0955
"""Thigh and calf together, and the thigh joint's distance from the hip joint, of the Go2 [m]."""


@dataclass(frozen=True)
class Leg:
    """Geometry of one leg. All offsets are expressed in the frame of the parent link at zero joint positions."""

    name: str
    """``FL``, ``FR``, ``RL`` or ``RR``."""
    hip_offset: tuple[float, float, float]
    """Base origin to hip joint (roll axis) [m]."""
    thigh_offset: tuple[float, float, float]
    """Hip joint to thigh joint (pitch axis) [m]."""
    thigh_length: float
    """Thigh joint to calf joint, straight down [m]."""
    calf_length: float
    """Calf joint to foot centre, straight down [m]."""


FRICTION_STIFFNESS, FRICTION_DAMPING = 200.0, 1.5
"""Joint friction is a damped spring that slides where its torque would exceed the friction's [N m/rad, N m s/rad].

A joint at rest is thus held without creeping, at most 0.2 degrees from where it stopped. At 240 Hz the explicit
integration of the lightest joint, 0.015 kg m^2, is stable with twice these values and a motor's damping.
"""


@dataclass(frozen=True)
class MotorLimits:
    """Largest torques of the joints' motors at the joints' speed; every field has 12 values."""

    driving: tuple[float, ...]
    """With the motion, up to ``full_torque_speed``; from there it falls to none at ``no_load_speed`` [N m]."""
    braking: tuple[float, ...]
    """Against the motion, at any speed [N m]."""
    full_torque_speed: tuple[float, ...]
    """[rad/s]"""
    no_load_speed: tuple[float, ...]
    """[rad/s]"""

    @classmethod
    def constant(cls, effort: tuple[float, ...]) -> "MotorLimits":
        """Return limits that do not depend on the speed."""
        endless = (1e6,) * len(effort)
        return cls(effort, effort, endless, tuple(2.0 * speed for speed in endless))

    def available(self, torque: NDArray[Any], velocity: NDArray[Any]) -> NDArray[Any]:
        """Return the largest size of a torque in the direction of ``torque`` [N m], shape [..., 12].

        Args:
            torque: Its sign tells whether the motor drives or brakes [N m], shape [..., 12].
            velocity: Joint velocities [rad/s], shape [..., 12].
        """
        full, free = np.array(self.full_torque_speed), np.array(self.no_load_speed)
        share = np.clip((free - np.abs(velocity)) / (free - full), 0.0, 1.0)
        return np.where(torque * velocity < 0.0, np.array(self.braking), share * np.array(self.driving))


@dataclass(frozen=True)
class RobotSpec:
    """Everything about a robot that is not in the simulator: orders, poses, gains and limits.

    Joint arrays are ordered leg by leg (FL, FR, RL, RR), each hip, thigh, calf; foot arrays FL, FR, RL, RR.
    """

    name: str
    urdf: Path
    """The model file shared by placo, Newton and Rerun."""
    legs: tuple[Leg, ...]
    joint_names: tuple[str, ...]
    base_link: str
    foot_links: tuple[str, ...]
    foot_radius: float
    """Radius of the foot sphere [m]."""
    trunk_size: tuple[float, float, float]
    """Edges of the trunk's box, centred on the base origin [m]."""
    head_centre: tuple[float, float, float]
    """Centre of the head's sphere in the base frame [m]."""
    head_radius: float
    """Radius of the head's sphere [m]."""
    thigh_radius: float
    """Radius of the thigh's capsule, which ends at the knee [m]."""
    calf_radius: float
    """Radius of the calf's capsule [m]."""
    calf_span: tuple[float, float]
    """Beginning and end of the calf capsule's axis below the knee [m]."""
    joint_lower: tuple[float, ...]
    """Lower joint limits [rad], shape [12]."""
    joint_upper: tuple[float, ...]
    """Upper joint limits [rad], shape [12]."""
    joint_effort: tuple[float, ...]
    """Largest joint torques by the URDF, whatever the speed [N m], shape [12]."""
    joint_speed: tuple[float, ...]
    """Largest joint speeds [rad/s], shape [12]."""
    motor_limits: MotorLimits
    """What the motors give, by speed."""
    joint_friction: tuple[float, ...]
    """Coulomb friction of the joints [N m], shape [12]."""
    default_joint_position: tuple[float, ...]
    """Standing pose that actions are offsets from [rad], shape [12]."""
    default_root_height: float
    """Height of the base origin in the standing pose [m]."""
    armature: float
    """Rotor inertia seen at each joint [kg m^2]."""
    stiffness_factor: float
    """Stiffness of the motors' PD law over that of the Go2, for which presets state theirs."""
    damping_factor: float
    """The same for the damping."""
    action_scale: float
    """Radians of joint offset for an action of 1 (appendix, hyperparameter table)."""
    sdk_motor_order: tuple[str, ...]
    """Joint names in the order of the manufacturer's motor interface."""
    defined_in: str = ""
    """Where a robot from outside the package is defined, such as ``/home/me/my_robot.py:SPEC``; set on loading."""

    @property
    def reference(self) -> str:
        """By which clips, policies and datasets name the robot: its name, or where it is defined."""
        return self.defined_in or self.name

    @property
    def size(self) -> float:
        """Length of a leg over that of the Go2, for which sources state their scale."""
        return (self.legs[0].thigh_length + self.legs[0].calf_length) / GO2_LEG_LENGTH

    @property
    def width(self) -> float:
        """Distance of the thighs from the hips over that of the Go2, for which sources move feet outwards."""
        return abs(self.legs[0].thigh_offset[1]) / GO2_THIGH_OFFSET

    @cached_property
    def leg_links(self) -> tuple[str, ...]:
        """Names of the links that the joints move, in the order of ``joint_names``."""
        moved = {
            joint.attrib["name"]: child.attrib["link"]
            for joint in ElementTree.parse(self.urdf).iter("joint")
            if (child := joint.find("child")) is not None
        }
        return tuple(moved[name] for name in self.joint_names)

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        """Names of the 16 points that a dataset stores: twelve joint centres, then four feet."""
        return tuple(name.removesuffix("_joint") for name in self.joint_names) + self.foot_links

    @cached_property
    def mass(self) -> float:
        """Mass of all links of the URDF [kg]."""
        return sum(float(mass.attrib["value"]) for mass in ElementTree.parse(self.urdf).iter("mass"))

    @property
    def training_values(self) -> list[str | float]:
        """What a training depends on of the robot, as JSON values."""
        return [self.model_hash, *self.default_joint_position, self.stiffness_factor, self.damping_factor]

    @cached_property
    def model_hash(self) -> str:
        """SHA-256 of the compiled model's numbers and the motors', to tell which model a dataset was made with."""
        from kine2go_warp.robots.compiled import model_parts

        return hashlib.sha256(repr(sorted(model_parts(self).items())).encode()).hexdigest()
