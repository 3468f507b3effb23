"""Reading a URDF: geometry and limits by name, and the tree of moving links that simulators need."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.robots.spec import LEG_JOINTS, Leg

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Inertia = tuple[float, NDArray[Any], NDArray[Any]]
"""Mass [kg], centre of mass in the link frame [m], inertia about it along the link's axes [kg m^2]."""


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

    def leg(self, name: str, joints: Sequence[str] = ()) -> Leg:
        """Return the geometry of one leg.

        Args:
            name: ``FL``, ``FR``, ``RL`` or ``RR``.
            joints: Names of its hip, thigh, calf and foot joints; by default ``FL_hip_joint`` and so on.
        """
        hip, thigh, calf, foot = joints or [f"{name}_{part}_joint" for part in (*LEG_JOINTS, "foot")]
        return Leg(
            name=name,
            hip_offset=self.joint_offset(hip),
            thigh_offset=self.joint_offset(thigh),
            thigh_length=-self.joint_offset(calf)[2],
            calf_length=-self.joint_offset(foot)[2],
        )

    def collision(self, link: str, shape: str, attribute: str) -> float:
        """Return a dimension of the first collision shape of a kind (``sphere``, ``cylinder``) of a link [m]."""
        return float(self.find(f"link[@name='{link}']/collision/geometry/{shape}").attrib[attribute])

    def capsule_span(self, link: str) -> tuple[float, float]:
        """Return beginning and end of the axis of a link's capsule, a cylinder here, below the link's origin [m]."""
        radius, length = (self.collision(link, "cylinder", name) for name in ("radius", "length"))
        middle = -float(self.find(f"link[@name='{link}']/collision/origin").attrib["xyz"].split()[2])
        return middle - 0.5 * length + radius, middle + 0.5 * length - radius

    def collision_vector(self, name: str, element: str, attribute: str) -> tuple[float, float, float]:
        """Return a vector of the collision shape of that name, such as its origin's ``xyz`` [m]."""
        text = self.find(f".//collision[@name='{name}']/{element}").attrib[attribute]
        x, y, z = (float(value) for value in text.split())
        return x, y, z


def merge_fixed_links(root: ElementTree.Element) -> None:
    """Merge every link on a fixed joint into its parent, in place: shapes, joints below it, mass and inertia.

    Newton's own merging adds inertias about different points, which doubles that of a calf with its foot.
    """
    links = {link.attrib["name"]: link for link in root.findall("link")}
    for joint in root.findall("joint[@type='fixed']"):
        # The parent may itself have been merged meanwhile: its name is read now.
        parent, child = links[joint_link(joint, "parent")], links[joint_link(joint, "child")]
        pose = read_origin(joint)
        add_inertia(parent, child, pose)
        for shape in [*child.findall("collision"), *child.findall("visual")]:
            move_origin(shape, pose)
            parent.append(shape)
        root.remove(joint)
        root.remove(child)
        for below in root.findall("joint"):
            if joint_link(below, "parent") == child.attrib["name"]:
                move_origin(below, pose)
                below.find("parent").set("link", parent.attrib["name"])  # pyright: ignore[reportOptionalMemberAccess] - found above


def joint_link(joint: ElementTree.Element, role: str) -> str:
    """Return the name of a joint's ``parent`` or ``child`` link."""
    element = joint.find(role)
    if element is None:
        raise Kine2GoError(f"URDF: joint {joint.attrib.get('name')} has no {role}")
    return element.attrib["link"]


def read_origin(element: ElementTree.Element) -> "tuple[NDArray[Any], Rotation]":
    """Return position [m] and rotation of an element in its parent's frame; the identity if it has no origin."""
    from scipy.spatial.transform import Rotation

    attributes = {} if (origin := element.find("origin")) is None else origin.attrib
    xyz, rpy = (np.array(attributes.get(name, "0 0 0").split(), dtype=float) for name in ("xyz", "rpy"))
    return xyz, Rotation.from_euler("xyz", rpy)


def move_origin(element: ElementTree.Element, pose: "tuple[NDArray[Any], Rotation]") -> None:
    """Express an element's origin in the frame in which its own frame has ``pose``."""
    position, rotation = read_origin(element)
    origin = element.find("origin")
    if origin is None:
        origin = ElementTree.SubElement(element, "origin")
    origin.set("xyz", numbers(pose[0] + pose[1].apply(position)))
    origin.set("rpy", numbers((pose[1] * rotation).as_euler("xyz")))


def read_inertia(link: ElementTree.Element) -> Inertia:
    """Return mass, centre of mass and inertia of a link, nothing for one without ``inertial``."""
    inertial = link.find("inertial")
    if inertial is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise Kine2GoError(f"URDF: link {link.attrib.get('name')} has an inertial without mass or inertia")
    xx, xy, xz, yy, yz, zz = (float(inertia.attrib[f"i{axes}"]) for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
    centre, rotation = read_origin(inertial)
    turn = rotation.as_matrix()
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return float(mass.attrib["value"]), centre, turn @ matrix @ turn.T


def add_inertia(parent: ElementTree.Element, child: ElementTree.Element, pose: "tuple[NDArray[Any], Rotation]") -> None:
    """Write the inertia of both links together into the parent; ``pose`` is the child's in the parent's frame."""
    turn = pose[1].as_matrix()
    mass, centre, inertia = read_inertia(child)
    parts = [read_inertia(parent), (mass, pose[0] + turn @ centre, turn @ inertia @ turn.T)]
    total = sum(mass for mass, _, _ in parts)
    if total == 0.0:
        return
    middle = sum((mass * centre for mass, centre, _ in parts), np.zeros(3)) / total
    matrix = np.zeros((3, 3))
    for mass, centre, inertia in parts:
        arm = centre - middle
        # The parallel axis theorem moves each inertia to the common centre of mass.
        matrix += inertia + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    if (old := parent.find("inertial")) is not None:
        parent.remove(old)
    inertial = ElementTree.SubElement(parent, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=numbers(middle))
    ElementTree.SubElement(inertial, "mass", value=repr(total))
    axes = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ElementTree.SubElement(inertial, "inertia", {name: repr(float(matrix[at])) for name, at in axes.items()})


def numbers(values: NDArray[Any]) -> str:
    """Return numbers as a URDF lists them."""
    return " ".join(repr(float(value)) for value in values)
