"""The NumPy observation against the kernels', on real rollouts."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kine2go_warp import deployment
from kine2go_warp.deployment.controller import ExportedPolicy, PolicyController
from kine2go_warp.deployment.export import action_rule
from kine2go_warp.deployment.metadata import ObservationRow
from kine2go_warp.deployment.observer import MeasuredState, ObservationBuilder
from kine2go_warp.deployment.reference import PlacedClip
from kine2go_warp.env.config import ActionConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.errors import PolicyError
from kine2go_warp.motions.cycle import CycleStep
from kine2go_warp.robots import GO2


def measured(environment, world):
    """What a robot would measure, from Newton's coordinates."""
    joint_q = environment.robot.joint_q.numpy()[world].astype(float)
    joint_qd = environment.robot.joint_qd.numpy()[world].astype(float)
    com = Rotation.from_quat(joint_q[3:7]).apply(environment.robot.com_b.numpy()[world])
    return MeasuredState(
        root_position=joint_q[:3],
        root_orientation=joint_q[[6, 3, 4, 5]],
        root_linear_velocity=joint_qd[:3] - np.cross(joint_qd[3:6], com),
        root_angular_velocity=joint_qd[3:6],
        joint_position=joint_q[7:],
        joint_velocity=joint_qd[6:],
    )


def begin_as(environment, world, controller):
    placement = environment.episodes.placement
    phase, heading = (float(values.numpy()[world]) for values in (placement.start_phase, placement.heading))
    controller.begin(phase, (0.0, 0.0), heading)


@pytest.fixture(scope="module")
def turning_clip(clip):
    """The trot along a curve: a cycle turns by 0.4 rad, with frames of 1/50 s."""
    return replace(clip, name="turning", frame_duration=0.02, cycle=CycleStep(clip.cycle.x, 0.1, 0.4)).completed(GO2)


@pytest.mark.parametrize(
    ("mode", "which"),
    [
        ("residual_ff", "turning_clip"),
        ("residual", "turning_clip"),
        ("default_offset", "clip"),
        ("absolute", "turning_clip"),
        ("residual_ff", "once_clip"),
    ],
)
def test_observations_and_joint_targets_are_the_environments_over_rollouts_with_resets(
    exported, small_config, mode, which, request
):
    clip = request.getfixturevalue(which)
    config = replace(small_config, num_worlds=4, episode_time=1.2, action=ActionConfig(mode=mode, clip=0.8))
    environment = ImitationEnvironment([clip], config, "cpu")
    policy = ExportedPolicy.load(exported)
    policy = replace(policy, clips=(clip,), metadata=replace(policy.metadata, action=action_rule(config, GO2)))
    controllers = [PolicyController(policy) for _ in range(4)]
    for world, controller in enumerate(controllers):
        begin_as(environment, world, controller)
    rng, episodes = np.random.default_rng(0), 0
    for _ in range(150):
        observation = environment.observation.numpy().copy()
        outputs = np.float32(rng.normal(0.0, 0.7, (4, 12)))
        expected_targets = []
        for world, controller in enumerate(controllers):
            own = controller.observer.observe(measured(environment, world), controller.last_action, controller.step)
            np.testing.assert_allclose(own, observation[world], atol=2e-5)
            expected_targets.append(controller.joint_target(outputs[world]))
            controller.last_action = outputs[world]
            controller.step += 1
        environment.action.assign(outputs)
        environment.step()
        np.testing.assert_allclose(environment.motors.joint_target.numpy(), expected_targets, atol=1e-5)
        for world in np.flatnonzero(environment.episodes.done.numpy()):
            begin_as(environment, world, controllers[world])
            episodes += 1
    assert episodes >= 4, "every world has begun at least one more episode"


def test_the_builder_shares_no_code_with_the_simulation():
    folder = Path(deployment.__file__).parent
    foreign = ("kine2go_warp.kernels", "kine2go_warp.env", "warp", "newton", "torch")
    for name in ("observer", "reference", "rotations", "controller", "metadata"):
        for node in ast.walk(ast.parse((folder / f"{name}.py").read_text())):
            if isinstance(node, ast.ImportFrom) and node.module:
                assert not node.module.startswith(foreign), name


def test_ten_cycles_of_the_reference_lead_where_the_clips_displacement_says(clip, turning_clip):
    placed = PlacedClip(clip, 60.0)
    placed.place(0.0, (1.0, 2.0), 0.5 * np.pi)
    period = 60.0 * clip.period
    away = placed.root(10.0 * period).position - placed.root(0.0).position
    np.testing.assert_allclose(away[:2], 10.0 * np.array([-clip.cycle.y, clip.cycle.x]), atol=1e-9)
    np.testing.assert_allclose(placed.root(0.0).position[:2], (1.0, 2.0))
    turned = PlacedClip(turning_clip, 60.0)
    turn = turned.root(60.0 * 3.0 * turning_clip.period).rotation @ turned.root(0.0).rotation.T
    np.testing.assert_allclose(Rotation.from_matrix(turn).as_rotvec(), (0.0, 0.0, 1.2), atol=1e-9)
    assert turned.phase(60.0 * 2.25 * turning_clip.period) == pytest.approx(0.25)


@pytest.mark.parametrize("name", ["smell[t]", "joint_position[t+1]", "reference_forward_h[t]", "joint_position"])
def test_a_row_that_is_not_known_is_refused(exported, name):
    metadata = ExportedPolicy.load(exported).metadata
    row = ObservationRow(name, 0, 12, "", "")
    with pytest.raises(PolicyError, match="unknown here"):
        ObservationBuilder(replace(metadata, observation=(row,)), None)
