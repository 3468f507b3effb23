"""What many tests share: real clips, the bundled clip, a small environment, a policy trained for a moment."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.learning.config import TrainConfig
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.learning.train import train
from kine2go_warp.motions.catalogue import motion_named
from kine2go_warp.motions.clip import MotionClip, assemble_clip
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.cycle import CycleStep
from kine2go_warp.motions.inverse_kinematics import InverseKinematics
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.robots import GO2

REPOSITORY = Path(__file__).parent.parent

wp.config.log_level = wp.LOG_ERROR


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of the real source clips."""
    folder = Path(os.environ.get("KINE2GO_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real clips: {folder} does not exist (set KINE2GO_DATA)")
    return folder


@pytest.fixture(scope="session")
def solver() -> InverseKinematics:
    return InverseKinematics(GO2)


@pytest.fixture(scope="session")
def clip(solver: InverseKinematics) -> MotionClip:
    """The bundled dog trot on the robot."""
    return retarget(motion_named("dog_trot"), None, solver, RetargetConfig()).clip


@pytest.fixture(scope="session")
def standing_clip(clip: MotionClip) -> MotionClip:
    """A clip of the robot standing in its default pose."""
    frames = 10
    return assemble_clip(
        "standing",
        1.0 / 60.0,
        np.tile([0.0, 0.0, GO2.default_root_height], (frames, 1)),
        np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1)),
        np.tile(GO2.default_joint_position, (frames, 1)),
        np.ones((frames, 4)),
        np.zeros(frames),
        CycleStep(0.0, 0.0, 0.0),
        clip.origin,
        GO2,
    )


@pytest.fixture(scope="session")
def small_config() -> EnvConfig:
    """A small batch under the ``fast`` preset."""
    return replace(FAST.env, num_worlds=8)


@pytest.fixture
def environment(clip: MotionClip, small_config: EnvConfig) -> ImitationEnvironment:
    return ImitationEnvironment([clip], small_config, "cpu")


@pytest.fixture(scope="session")
def policy(clip: MotionClip, tmp_path_factory: pytest.TempPathFactory) -> PolicyFolder:
    """A policy after a few iterations: real, but not good."""
    folder = tmp_path_factory.mktemp("policy") / clip.name
    train([clip], TrainConfig(num_worlds=16, iterations=3), folder, "cpu")
    return PolicyFolder(folder)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)
