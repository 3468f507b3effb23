"""What many tests share: real clips, the bundled clip, a small environment, a policy trained for a moment.

A machine with a GPU may lack the tools of other stages, so that what only some tests need is imported in its fixture.
"""

import importlib.util
import os
import re
import shutil
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import warp as wp
import zarr

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.writer import DatasetWriter, SimulationAttributes
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.terms.randomization import randomized
from kine2go_warp.errors import RenderError
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.motions.catalogue import motion_named
from kine2go_warp.motions.clip import MotionClip, assemble_clip
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.cycle import CycleStep
from kine2go_warp.motions.poses import Poses
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import MILD, GatherConfig
from kine2go_warp.rollouts.gather import gather
from kine2go_warp.rollouts.quality import filter_rollouts
from kine2go_warp.training.train import train

if TYPE_CHECKING:
    from kine2go_warp.motions.inverse_kinematics import InverseKinematics

REPOSITORY = Path(__file__).parent.parent

COMMITTED_CLIP = REPOSITORY / "tests" / "data" / "dog_trot.npz"
"""The bundled dog trot on the robot, for machines that cannot retarget."""

ANYTHING_GOES = {
    "max_distance": 9.0,
    "max_angle": 3.2,
    "max_joint_rmse": 9.0,
    "max_leg_contact": 2.0,
    "max_joint_limit": 2.0,
    "max_torque_saturation": 2.0,
    "max_action_saturation": 2.0,
    "max_foot_slip": 99.0,
    "max_joint_jerk": 1e9,
    "max_joint_speed": 99.0,
    "max_leg_overlap": 9.0,
}
"""Limits of gathering that only a fall exceeds: a policy after three iterations drifts far."""

wp.config.log_level = wp.LOG_ERROR

# Commands in messages have "uv run" before them where uv started this process; the tests read them without.
os.environ.pop("UV_RUN_RECURSION_DEPTH", None)


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of the real source clips."""
    folder = Path(os.environ.get("KINE2GO_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real clips: {folder} does not exist (set KINE2GO_DATA)")
    return folder


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Skip files that import a package which is not installed, such as placo, instead of failing all tests."""
    report = yield
    missing = re.findall(r"No module named '([\w.]+)'", str(report.longrepr)) if report.failed else []
    if missing and missing[-1].partition(".")[0] not in ("kine2go_warp", "tests"):
        report.outcome = "skipped"
        report.longrepr = (str(collector.path), 0, f"Skipped: {missing[-1]} is not installed")
    return report


@pytest.fixture(scope="session")
def solver() -> "InverseKinematics":
    pytest.importorskip("placo")
    from kine2go_warp.motions.inverse_kinematics import InverseKinematics

    return InverseKinematics(GO2)


@pytest.fixture(scope="session")
def clip(request: pytest.FixtureRequest) -> MotionClip:
    """The bundled dog trot on the robot; where placo is missing, as it was retargeted once."""
    if importlib.util.find_spec("placo") is None:
        return MotionClip.load(COMMITTED_CLIP)
    from kine2go_warp.motions.retarget import retarget

    return retarget(motion_named("dog_trot"), None, request.getfixturevalue("solver"), RetargetConfig()).clip


@pytest.fixture(scope="session")
def once_clip(solver: "InverseKinematics") -> MotionClip:
    """The first stride of the bundled trot, played once: from a stand over a trot to a stand, each held for 0.2 s."""
    from kine2go_warp.motions.retarget import retarget

    entry = replace(motion_named("dog_trot"), name="start_and_stop", kind="once", hold=0.2)
    return retarget(entry, None, solver, RetargetConfig()).clip


@pytest.fixture(scope="session")
def standing_clip(clip: MotionClip) -> MotionClip:
    """A clip of the robot standing in its default pose."""
    frames = 10
    poses = Poses(
        np.tile([0.0, 0.0, GO2.default_root_height], (frames, 1)),
        np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1)),
        np.tile(GO2.default_joint_position, (frames, 1)),
    )
    return assemble_clip(
        poses,
        GO2,
        name="standing",
        frame_duration=1.0 / 60.0,
        stance=np.ones((frames, 4)),
        residual=np.zeros(frames),
        cycle=CycleStep(0.0, 0.0, 0.0),
        origin=clip.origin,
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
    train([clip], FAST.override({"env.num_worlds": 16, "ppo.iterations": 3}), folder, "cpu")
    return PolicyFolder(folder)


@pytest.fixture(scope="session")
def exported(policy: PolicyFolder, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That policy, exported."""
    from kine2go_warp.deployment.export import export_policy

    folder = tmp_path_factory.mktemp("exported") / "trot"
    export_policy(policy, folder)
    return folder


@pytest.fixture(scope="session")
def clean_dataset(policy: PolicyFolder, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five rollouts of that policy, 150 rows each; number 2 is cut short after 130."""
    folder = tmp_path_factory.mktemp("dataset")
    # A policy after three iterations drifts far; these limits keep all of its rollouts.
    drawn = randomized(MILD, push_interval=(1.0, 2.0), push_speed=(0.1, 0.2))
    loose = GatherConfig(trajectories=5, rows=150, randomization=drawn, observations=True, **ANYTHING_GOES)
    gather(policy, DatasetWriter(folder / "gathered.zarr", GO2), loose, "cpu")
    motion = open_dataset(folder / "gathered.zarr", include_rejected=True).load("dog_trot")
    length = np.array([150, 150, 130, 150, 150], dtype=np.int32)
    trajectories = replace(motion.trajectories, draws={**motion.trajectories.draws, "length": length})
    rows = trajectories.padded().rows
    for name, values in trajectories.groups["final_state"].items():
        values[2] = trajectories.rows[name][2, 130]
    trajectories.groups["quality"] = filter_rollouts(rows, np.full(5, ""), loose, 1.0 / 60.0, GO2).quality
    root = zarr.open_group(folder / "gathered.zarr", mode="r").attrs
    simulation = SimulationAttributes(**{name: root[name] for name in SimulationAttributes.__dataclass_fields__})
    DatasetWriter(folder / "dataset.zarr", GO2).write("dog_trot", trajectories, simulation, motion.attributes)
    return folder / "dataset.zarr"


@pytest.fixture
def dataset_copy(clean_dataset: Path, tmp_path: Path) -> Path:
    """A copy of that dataset, to spoil."""
    return Path(shutil.copytree(clean_dataset, tmp_path / "dataset.zarr"))


@pytest.fixture(scope="session")
def walks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset with the motions ``walk`` and ``stroll``, three trajectories each, whose every pose is known."""
    from tests.walks import write_walks

    return write_walks(tmp_path_factory.mktemp("walks") / "walks.zarr")


@pytest.fixture(scope="session")
def can_draw() -> None:
    """Skip where no picture can be drawn."""
    from kine2go_warp.renders.process import RenderProcess

    try:
        RenderProcess(64, 64).close()
    except RenderError as error:
        pytest.skip(str(error))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)
