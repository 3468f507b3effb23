"""The typed description of a quadruped with three joints a leg."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

from kine2go_warp.errors import Kine2GoError

LEG_JOINTS = ("hip", "thigh", "calf")


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
    joint_lower: tuple[float, ...]
    """Lower joint limits [rad], shape [12]."""
    joint_upper: tuple[float, ...]
    """Upper joint limits [rad], shape [12]."""
    joint_effort: tuple[float, ...]
    """Largest joint torques [N m], shape [12]."""
    joint_speed: tuple[float, ...]
    """Largest joint speeds [rad/s], shape [12]."""
    default_joint_position: tuple[float, ...]
    """Standing pose that actions are offsets from [rad], shape [12]."""
    default_root_height: float
    """Height of the base origin in the standing pose [m]."""
    armature: float
    """Rotor inertia seen at each joint [kg m^2]."""
    action_scale: float
    """Radians of joint offset for an action of 1 (appendix, hyperparameter table)."""
    sdk_motor_order: tuple[str, ...]
    """Joint names in the order of the manufacturer's motor interface."""

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        """Names of the 16 points that a dataset stores: twelve joint centres, then four feet."""
        return tuple(name.removesuffix("_joint") for name in self.joint_names) + self.foot_links

    @cached_property
    def mass(self) -> float:
        """Mass of all links of the URDF [kg]."""
        return sum(float(mass.attrib["value"]) for mass in ElementTree.parse(self.urdf).iter("mass"))

    @cached_property
    def model_hash(self) -> str:
        """SHA-256 of the URDF, to tell which model a dataset was made with."""
        return hashlib.sha256(self.urdf.read_bytes()).hexdigest()


class UrdfReader:
    """Looks up geometry and limits in a URDF by name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.root = ElementTree.parse(path).getroot()

    def find(self, query: str) -> ElementTree.Element:
        """Return the element that matches an XPath query.

        Raises:
            Kine2GoError: nothing matches.
        """
        element = self.root.find(query)
        if element is None:
            raise Kine2GoError(f"{self.path}: no element matches {query}")
        return element

    def joint_offset(self, joint: str) -> tuple[float, float, float]:
        """Return the position of a joint in its parent link [m]."""
        x, y, z = (float(value) for value in self.find(f"joint[@name='{joint}']/origin").attrib["xyz"].split())
        return x, y, z

    def joint_limits(self, joints: tuple[str, ...], field: str) -> tuple[float, ...]:
        """Return one attribute of the limits (``lower``, ``upper``, ``effort``, ``velocity``) for several joints."""
        return tuple(float(self.find(f"joint[@name='{joint}']/limit").attrib[field]) for joint in joints)

    def leg(self, name: str) -> Leg:
        """Return the geometry of one leg."""
        return Leg(
            name=name,
            hip_offset=self.joint_offset(f"{name}_hip_joint"),
            thigh_offset=self.joint_offset(f"{name}_thigh_joint"),
            thigh_length=-self.joint_offset(f"{name}_calf_joint")[2],
            calf_length=-self.joint_offset(f"{name}_foot_joint")[2],
        )

    def collision(self, link: str, shape: str, attribute: str) -> float:
        """Return a dimension of the first collision shape of a kind (``sphere``, ``cylinder``) of a link [m]."""
        return float(self.find(f"link[@name='{link}']/collision/geometry/{shape}").attrib[attribute])

    def collision_vector(self, name: str, element: str, attribute: str) -> tuple[float, float, float]:
        """Return a vector of the collision shape of that name, such as its origin's ``xyz`` [m]."""
        text = self.find(f".//collision[@name='{name}']/{element}").attrib[attribute]
        x, y, z = (float(value) for value in text.split())
        return x, y, z
