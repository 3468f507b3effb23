"""What is drawn: the robot, its reference and a floor, as a MuJoCo model that is posed and never stepped."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco as mujoco_package
import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import RenderError
from kine2go_warp.renders.camera import Pose
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.look import Colour, colours_of, link_surfaces
from kine2go_warp.robots.mesh_files import mesh_files

mujoco: Any = mujoco_package  # its module is compiled: type checkers do not know what is in it

ROBOT_GROUP, REFERENCE_GROUP, FLOOR_GROUP = 1, 2, 3
"""MuJoCo's groups of shapes, which can be shown and hidden."""

REFERENCE_COLOUR = (0.16, 0.72, 0.44, 0.28)
SKY = ((0.93, 0.94, 0.96), (0.80, 0.84, 0.89))
"""Colours of the background, at the horizon and above."""
TILES = ((0.86, 0.88, 0.90), (0.82, 0.84, 0.87))
TILE_SIZE = 0.5
"""Edge of a tile of the floor [m]."""

MESH_SUFFIXES = (".obj", ".stl")
"""Kinds of meshes that MuJoCo reads."""

_KEEP_LINKS = '<mujoco><compiler fusestatic="false"/></mujoco></robot>'


class Scene:
    """A robot and a see-through reference on a floor."""

    def __init__(self, spec: RobotSpec, meshes: Path | None = None) -> None:
        """Build the model.

        Args:
            spec: The robot, drawn as ``robots.look`` has it.
            meshes: Folder of the user's meshes of trunk and legs, drawn instead.

        Raises:
            RenderError: a mesh is missing or cannot be read.
        """
        self.model = _model(spec, meshes)
        self.data = mujoco.MjData(self.model)
        self._addresses = {
            name: [self._address(f"{name}/{joint}") for joint in ("root", *spec.joint_names)]
            for name in ("robot", "reference")
        }

    def place(self, robot: Pose, reference: Pose | None = None) -> None:
        """Put the robot and its reference into poses; without a reference its old pose stays."""
        self._put("robot", robot)
        if reference is not None:
            self._put("reference", reference)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def _put(self, name: str, pose: Pose) -> None:
        root, *joints = self._addresses[name]
        self.data.qpos[root : root + 3] = pose.root_position
        self.data.qpos[root + 3 : root + 7] = pose.root_orientation
        self.data.qpos[joints] = pose.joint_position

    def _address(self, joint: str) -> int:
        return int(self.model.joint(joint).qposadr[0])


def _model(spec: RobotSpec, meshes: Path | None) -> Any:
    """Return the compiled model of both robots and the floor."""
    files = {} if meshes is None else mesh_files(meshes, MESH_SUFFIXES, RenderError)
    scene = mujoco.MjSpec()
    _set_look(scene)
    for name, group in (("robot", ROBOT_GROUP), ("reference", REFERENCE_GROUP)):
        body = scene.worldbody.add_frame().attach_body(_robot(spec, group, files).body(spec.base_link), f"{name}/", "")
        body.add_freejoint(name=f"{name}/root")
        if group == ROBOT_GROUP:
            body.add_light(
                mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK,
                type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
                pos=[0.6, -0.8, 2.5],
                dir=[-0.25, 0.32, -1.0],
                diffuse=[0.48, 0.48, 0.48],
                castshadow=True,
            )
    try:
        return scene.compile()
    except ValueError as error:
        raise RenderError(f"{meshes}: a mesh cannot be read ({first_line(error)})") from None


def first_line(error: ValueError) -> str:
    """Return what MuJoCo says is wrong, without where in the model that is."""
    return str(error).strip().splitlines()[0]


def _robot(spec: RobotSpec, group: int, files: dict[str, Path]) -> Any:
    """Return the robot as it looks, without what is only there to collide."""
    robot = mujoco.MjSpec.from_string(spec.urdf.read_text().replace("</robot>", _KEEP_LINKS))
    for shape in list(robot.geoms):
        robot.delete(shape)
    surfaces, colours = link_surfaces(spec), colours_of(spec)
    look = {"contype": 0, "conaffinity": 0, "group": group, "type": mujoco.mjtGeom.mjGEOM_MESH}

    def add(link: str, name: str, colour: Colour, **more: Any) -> None:
        rgba = REFERENCE_COLOUR if group == REFERENCE_GROUP else (*colour, 1.0)
        robot.body(link).add_geom(name=name, rgba=rgba, **look, **more)

    for link, kind, turn in own_links(spec, files) if files else ():
        name = f"{link}_{kind}"
        robot.add_mesh(name=name, file=str(files[kind].resolve()))
        add(link, name, colours["dark" if kind in ("hip", "calf") else "shell"], meshname=name, quat=turn)
        del surfaces[link]
    for link, found in surfaces.items():
        for number, surface in enumerate(found):
            name = f"{link}_{number}"
            robot.add_mesh(name=name, uservert=surface.vertices.ravel(), userface=surface.faces.ravel())
            add(link, name, surface.colour, meshname=name)
    return robot


def own_links(spec: RobotSpec, files: dict[str, Path]) -> Iterator[tuple[str, str, tuple[float, ...]]]:
    """Yield the links that a user's meshes show, the kind of each mesh, and how it is turned (w, x, y, z)."""
    upright = (1.0, 0.0, 0.0, 0.0)
    yield spec.base_link, "trunk", upright
    turns = {"FL": upright, "FR": (0.0, 1.0, 0.0, 0.0), "RL": (0.0, 0.0, 1.0, 0.0), "RR": (0.0, 0.0, 0.0, 1.0)}
    for leg, first in zip(spec.legs, range(0, 12, 3), strict=True):
        hip, thigh, calf = spec.leg_links[first : first + 3]
        yield hip, "hip", turns[leg.name]
        for link, kind in ((thigh, "thigh"), (calf, "calf")):
            mirrored = f"{kind}_mirror"
            yield link, mirrored if leg.name[1] == "R" and mirrored in files else kind, upright


def _set_look(scene: Any) -> None:
    """Set light, background and floor."""
    scene.stat.extent = 1.5
    scene.visual.quality.shadowsize = 2048
    scene.visual.map.zfar = 40.0
    scene.visual.rgba.haze = [*SKY[0], 1.0]
    scene.visual.headlight.ambient = [0.48, 0.48, 0.48]
    scene.visual.headlight.diffuse = [0.30, 0.30, 0.30]
    scene.visual.headlight.specular = [0.05, 0.05, 0.05]
    picture = {"builtin": mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, "width": 64, "height": 384}
    scene.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, rgb1=SKY[0], rgb2=SKY[1], **picture)
    scene.add_texture(
        name="tiles",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=TILES[0],
        rgb2=TILES[1],
        width=256,
        height=256,
    )
    floor = scene.add_material(name="floor", texuniform=True, texrepeat=[0.5 / TILE_SIZE] * 2, reflectance=0.0)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    scene.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05], material="floor", group=FLOOR_GROUP
    )


def shown_shapes(reference: bool, floor: bool) -> NDArray[np.uint8]:
    """Return MuJoCo's switches for its six groups of shapes."""
    switches = np.zeros(6, np.uint8)
    switches[ROBOT_GROUP] = 1
    switches[REFERENCE_GROUP] = reference
    switches[FLOOR_GROUP] = floor
    return switches
