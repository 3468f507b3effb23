"""The stages as functions: clip, policy, data and environment in a line each. ``import kine2go_warp as k2g``.

Settings are those of the command line under the same names. Everything heavy is imported when a function is called.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kine2go_warp.extras import named_extras

if TYPE_CHECKING:
    from kine2go_warp.env.config import EnvConfig
    from kine2go_warp.evaluation.metrics import Result
    from kine2go_warp.learning.policy import PolicyFolder
    from kine2go_warp.learning.presets import Preset
    from kine2go_warp.learning.vec_env import ImitationVecEnv
    from kine2go_warp.motions.clip import MotionClip
    from kine2go_warp.rollouts.gather import GatherResult

StrPath = str | PathLike[str]


@named_extras()
def retarget(
    motion: str, data: StrPath | None = None, robot: str = "go2", catalogue: StrPath | None = None, **settings: Any
) -> "MotionClip":
    """Retarget a motion of the catalogue to a robot. Needs the extra ``retarget``.

    Args:
        motion: Its name in the catalogue, such as ``dog_trot``.
        data: Folder of the source clips; not needed for a bundled motion.
        robot: A name of ``robots.ROBOTS``, or ``my_robot.py:SPEC`` for a robot of your own.
        catalogue: TOML file with motions of your own, in the form of the catalogue.
        settings: Fields of ``RetargetConfig``.

    Raises:
        CatalogueError: there is no such motion, or its file is not there.
        ClipError: the file cannot be used.
        Kine2GoError: there is no such robot.
    """
    from kine2go_warp.motions.catalogue import motion_named
    from kine2go_warp.motions.config import RetargetConfig
    from kine2go_warp.motions.inverse_kinematics import InverseKinematics
    from kine2go_warp.motions.retarget import retarget as retarget_entry
    from kine2go_warp.robots import robot_named

    folder, own = (None if one is None else Path(one) for one in (data, catalogue))
    solver = InverseKinematics(robot_named(robot))
    return retarget_entry(motion_named(motion, own), folder, solver, RetargetConfig(**settings)).clip


@named_extras()
def train(
    clips: "MotionClip | StrPath | Sequence[MotionClip | StrPath]",
    folder: StrPath,
    preset: "Preset | None" = None,
    **options: Any,
) -> "PolicyFolder":
    """Train a policy that tracks one clip or several, or continue an interrupted training. Needs the extra ``train``.

    Args:
        clips: Clips, or the files of clips.
        folder: Policy folder; see ``training.train.train`` for what happens if it holds a policy.
        preset: Settings, by default ``presets.FAST``; ``preset.override({"ppo.iterations": 50})`` changes some.
        options: Further arguments of ``training.train.train``: ``device``, ``overwrite``, ``on_progress`` ...

    Raises:
        ClipError: a file is no clip.
        PolicyError: the folder holds another policy.
        TrainingDiverged: training has broken down twice.
    """
    from kine2go_warp.learning.policy import PolicyFolder
    from kine2go_warp.learning.presets import FAST
    from kine2go_warp.training.train import train as train_policy

    train_policy(as_clips(clips), FAST if preset is None else preset, Path(folder), **options)
    return PolicyFolder(Path(folder))


@named_extras()
def evaluate(
    policy: "PolicyFolder | StrPath",
    device: str | None = None,
    clips: "MotionClip | StrPath | Sequence[MotionClip | StrPath]" = (),
    **settings: Any,
) -> "list[Result]":
    """Evaluate a policy with and without noise, randomisation and pushes. Needs the extra ``train``.

    Args:
        policy: A trained policy, or its folder.
        device: ``cpu`` or ``cuda``; by default CUDA where there is one.
        clips: Clips to track, or their files, instead of those that it was trained on.
        settings: Fields of ``EvalConfig``.

    Raises:
        PolicyError: the policy cannot be read.
    """
    from kine2go_warp.evaluation.config import EvalConfig
    from kine2go_warp.evaluation.evaluate import evaluate as evaluate_policy

    return evaluate_policy(as_policy(policy), EvalConfig(**settings), device, clips=as_clips(clips))


@named_extras()
def gather(
    policy: "PolicyFolder | StrPath",
    dataset: StrPath,
    motions: Sequence[str] = (),
    device: str | None = None,
    on_progress: Callable[[int, int, str], None] | None = None,
    clips: "MotionClip | StrPath | Sequence[MotionClip | StrPath]" = (),
    **settings: Any,
) -> "list[GatherResult]":
    """Roll a policy out and add the good rollouts to a dataset, a motion for each clip. Needs the extra ``train``.

    Args:
        policy: A trained policy, or its folder.
        dataset: The Zarr store; it is created, or the motions are added to it.
        motions: Which of its clips the policy tracks; by default all.
        clips: Clips that it was not trained on, or their files, instead.
        device: ``cpu`` or ``cuda``; by default CUDA where there is one.
        on_progress: Called now and then with what is done, the total, and details in words.
        settings: Fields of ``GatherConfig``, such as ``trajectories``.

    Raises:
        PolicyError: the policy cannot be read, was not trained on a motion, or drives another robot than a clip's.
        DatasetError: too few rollouts were accepted.
    """
    from kine2go_warp.dataset.writer import DatasetWriter
    from kine2go_warp.rollouts.config import GatherConfig
    from kine2go_warp.rollouts.gather import gather as gather_motion

    policy, config = as_policy(policy), GatherConfig(**settings)
    robot, record = policy.robot, policy.read_record()
    return [
        gather_motion(policy, DatasetWriter(Path(dataset), robot), config, device, on_progress, clip=clip)
        for clip in as_clips(clips) or policy.chosen_clips(record, motions)
    ]


@named_extras()
def make_env(
    clips: "MotionClip | StrPath | Sequence[MotionClip | StrPath]",
    env: "EnvConfig | None" = None,
    num_worlds: int | None = None,
    device: str | None = None,
    seed: int | None = None,
) -> "ImitationVecEnv":
    """Build the environment as RSL-RL's ``VecEnv``, ready to step. Needs the extra ``train``.

    On CUDA torch launches on Warp's stream from then on. Kernels are compiled here, not in the first step; a line on
    standard error says so if it takes long. ``GymnasiumVectorEnv(env)`` is the same for Gymnasium.

    Args:
        clips: What the robots track: clips, or the files of clips.
        env: Settings; by default those of ``presets.FAST``.
        num_worlds: Worlds simulated at once, instead of the settings'.
        device: ``cpu`` or ``cuda``; by default CUDA where there is one.
        seed: Of all worlds, instead of the settings'.

    Raises:
        ClipError: a file is no clip.
        Kine2GoError: there is no such device, or a setting is wrong.
    """
    from kine2go_warp.device import choose_device, compilation_notice
    from kine2go_warp.env.environment import ImitationEnvironment
    from kine2go_warp.learning.presets import FAST
    from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream

    device = choose_device(device)
    given = {name: value for name, value in (("num_worlds", num_worlds), ("seed", seed)) if value is not None}
    config = replace(FAST.env if env is None else env, **given).on(device)
    loaded = as_clips(clips)
    share_stream(device)
    with compilation_notice():
        return ImitationVecEnv(ImitationEnvironment(loaded, config, device))


def as_clips(clips: "MotionClip | StrPath | Sequence[MotionClip | StrPath]") -> "list[MotionClip]":
    """Return clips, those given as files loaded."""
    from kine2go_warp.motions.clip import MotionClip

    several = [clips] if isinstance(clips, MotionClip | str | PathLike) else clips
    return [one if isinstance(one, MotionClip) else MotionClip.load(Path(one)) for one in several]


def as_policy(policy: "PolicyFolder | StrPath") -> "PolicyFolder":
    """Return a policy, also if its folder is given."""
    from kine2go_warp.learning.policy import PolicyFolder

    return policy if isinstance(policy, PolicyFolder) else PolicyFolder(Path(policy))
