"""Frame-by-frame inverse kinematics with placo (paper, section 3.1)."""

import numpy as np
import placo  # pyright: ignore[reportMissingImports] - a compiled module
from numpy.typing import NDArray

from kine2go_warp.motions.body import joints_for
from kine2go_warp.motions.poses import Poses
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.rotations import continuous, to_rotation

Array = NDArray[np.float64]


class InverseKinematics:
    """Solves for the joint positions that put base and feet on their targets, within the joint limits.

    A frame is solved until no foot is farther than ``tolerance``
    from its target or ``max_iterations`` are used up, which happens only where a target is out of reach.
    """

    def __init__(self, spec: RobotSpec, tolerance: float = 1e-4, max_iterations: int = 8) -> None:
        self.spec = spec
        self.tolerance = tolerance
        self.max_iterations = max_iterations
        self.robot = placo.RobotWrapper(str(spec.urdf), placo.Flags.ignore_collisions)
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.enable_joint_limits(True)
        self.base_task = self.solver.add_frame_task(spec.base_link, np.eye(4))
        self.base_task.configure(spec.base_link, "soft", 1.0, 1.0)
        self.foot_tasks = [self.solver.add_position_task(link, np.zeros(3)) for link in spec.foot_links]
        for task, link in zip(self.foot_tasks, spec.foot_links, strict=True):
            task.configure(link, "soft", 1.0)
        self.joint_slots = [self.robot.get_joint_offset(joint) for joint in spec.joint_names]

    def solve(self, targets: Poses) -> tuple[Poses, Array]:
        """Solve all frames, each from the closed-form solution of its legs, which disregards the limits.

        Args:
            targets: Poses of the base, with feet.

        Returns:
            Poses with joints, and the largest distance of a foot from its target [m], shape [num_frames].
        """
        assert targets.feet is not None
        matrices = np.tile(np.eye(4), (len(targets), 1, 1))
        matrices[:, :3, :3] = to_rotation(targets.root_orientation).as_matrix()
        matrices[:, :3, 3] = targets.root_position
        coordinates = np.empty((len(targets), len(self.robot.state.q)))
        coordinates[:, :3], coordinates[:, 3:7] = targets.root_position, targets.root_orientation[:, [1, 2, 3, 0]]
        coordinates[:, self.joint_slots] = joints_for(self.spec, targets)
        residual = np.full(len(targets), np.inf)
        for _ in range(self.max_iterations):
            missed = np.flatnonzero(residual >= self.tolerance)
            if len(missed) == 0:
                break
            for frame in missed:
                coordinates[frame] = self._stepped(coordinates[frame], matrices[frame], targets.feet[frame])
            residual[missed] = self._distances(coordinates[missed], targets.feet[missed])
        # Where feet are out of reach the base gives way to them, so it is read back like the joints.
        orientation = continuous(coordinates[:, [6, 3, 4, 5]])
        return Poses(coordinates[:, :3], orientation, coordinates[:, self.joint_slots]), residual

    def _stepped(self, coordinates: Array, base: Array, feet: Array) -> Array:
        """Return placo's coordinates of one frame after one iteration."""
        self.robot.state.q = coordinates
        self.base_task.T_world_frame = base
        for task, target in zip(self.foot_tasks, feet, strict=True):
            task.target_world = target
        self.robot.update_kinematics()
        self.solver.solve(True)
        return self.robot.state.q

    def _distances(self, coordinates: Array, feet: Array) -> Array:
        """Return the largest distance of a foot from its target [m], shape [num_frames]."""
        rotation = to_rotation(coordinates[:, [6, 3, 4, 5]]).as_matrix()
        reached = np.einsum("tij,tkj->tki", rotation, foot_positions(self.spec, coordinates[:, self.joint_slots]))
        return np.linalg.norm(reached + coordinates[:, None, :3] - feet, axis=-1).max(axis=-1)
