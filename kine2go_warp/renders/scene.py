"""What is drawn: the robot, its reference and a floor, as a MuJoCo model that is posed and never stepped."""

from typing import Any

import mujoco as mujoco_package
import numpy as np
from numpy.typing import NDArray

from kine2go_warp.renders.camera import Pose
from kine2go_warp.robots import RobotSpec

mujoco: Any = mujoco_package  # its module is compiled: type checkers do not know what is in it

ROBOT_GROUP, REFERENCE_GROUP, FLOOR_GROUP = 1, 2, 3
"""MuJoCo's groups of shapes, which can be shown and hidden."""

REFERENCE_COLOUR = (0.16, 0.72, 0.44, 0.28)
SKY = ((0.93, 0.94, 0.96), (0.80, 0.84, 0.89))
"""Colours of the background, at the horizon and above."""
TILES = ((0.86, 0.88, 0.90), (0.82, 0.84, 0.87))
TILE_SIZE = 0.5
"""Edge of a tile of the floor [m]."""

_WITH_VISUALS = '<mujoco><compiler discardvisual="false" fusestatic="false"/></mujoco></robot>'


class Scene:
    """A robot and a see-through reference on a floor."""

    def __init__(self, spec: RobotSpec) -> None:
        """Build the model.

        Args:
            spec: The robot, of whose URDF the shapes that are there to be seen are drawn.
        """
        self.model = _model(spec)
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


def _model(spec: RobotSpec) -> Any:
    """Return the compiled model of both robots and the floor."""
    scene = mujoco.MjSpec()
    _set_look(scene)
    for name, group in (("robot", ROBOT_GROUP), ("reference", REFERENCE_GROUP)):
        body = scene.worldbody.add_frame().attach_body(_robot(spec, group).body(spec.base_link), f"{name}/", "")
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
    return scene.compile()


def _robot(spec: RobotSpec, group: int) -> Any:
    """Return the robot without what is only there to collide."""
    robot = mujoco.MjSpec.from_string(spec.urdf.read_text().replace("</robot>", _WITH_VISUALS))
    for shape in list(robot.geoms):
        if not shape.name.endswith("_visual"):
            robot.delete(shape)
            continue
        shape.group = group
        if group == REFERENCE_GROUP:
            shape.rgba = REFERENCE_COLOUR
        if "capsule" in shape.name:  # URDF has no capsules; the simulation rounds these cylinders' ends off, too
            shape.type = mujoco.mjtGeom.mjGEOM_CAPSULE
            shape.size[1] -= shape.size[0]
    return robot


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
