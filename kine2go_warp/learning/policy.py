"""The folder of a policy: checkpoints, the clips that it tracks, and how it was trained."""

import contextlib
import json
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from kine2go_warp import __version__
from kine2go_warp.env.terms.terminations import with_limits
from kine2go_warp.errors import PolicyError
from kine2go_warp.files import atomic_file, held
from kine2go_warp.learning.presets import Preset
from kine2go_warp.learning.stopping import TARGETS, Evaluation, stored_evaluation
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.names import check_distinct, check_name
from kine2go_warp.robots import DEFAULT_ROBOT, RobotSpec, stored_robot
from kine2go_warp.settings import from_dictionary, to_dictionary

FORMAT_VERSION = 2

LOCK = ".lock"
"""File in the folder that a training holds."""


@dataclass(frozen=True)
class PolicyRecord:
    """What ``policy.json`` says about a policy."""

    preset: Preset
    """Resolved settings."""
    clips: tuple[str, ...]
    """Files of the clips within the folder."""
    fingerprint: str
    """Hash of clips and settings."""
    iterations: int
    """Iterations done."""
    seconds: float
    """Time spent on training [s]."""
    core_seconds: float = 0.0
    """Processor time spent on it [s], but for that of further processes that shared the simulation."""
    restarts: int = 0
    """How often training began again because it had diverged; each time learns more slowly."""
    restart_reason: str = ""
    """What was seen when it diverged."""
    robot: str = DEFAULT_ROBOT
    """Reference of the robot; see ``robots.robot_named``."""
    clip_hashes: tuple[str, ...] = ()
    """``MotionClip.content_hash`` of each clip; empty in policies made before it was kept."""

    stop_reason: str = ""
    """Why training has stopped: targets reached, budget or diverged; empty while it is not finished."""
    evaluation: Evaluation | None = None
    """How well the policy tracks, and after how many iterations it was taken; none if it was not evaluated."""

    @property
    def policy_iterations(self) -> int:
        """Iterations after which the policy that acts was taken."""
        return self.iterations if self.evaluation is None else self.evaluation.iteration

    @property
    def complete(self) -> bool:
        """Whether training has met its targets or reached its last iteration."""
        return self.stop_reason == TARGETS or self.iterations >= self.preset.ppo.iterations


def read_preset(values: dict[str, Any], where: str) -> Preset:
    """Return the settings of a policy, also of one that was made before the ends of episodes were terms.

    Raises:
        PolicyError: they are not settings of this version.
    """
    env = dict(values["env"])
    before = env.pop("termination", None)
    preset = from_dictionary(Preset, {**values, "env": env}, where, PolicyError)
    if before is None:
        return preset
    env = preset.env
    terms = with_limits(before["max_distance"], before["max_angle"], env.terminations)
    scale, time = before["initial_limit_scale"], before["limit_anneal_time"]
    return replace(preset, env=replace(env, terminations=terms, initial_limit_scale=scale, limit_anneal_time=time))


def checkpoint_iteration(checkpoint: Path) -> int | None:
    """Return the iteration (from 0) in the name of a checkpoint, none if it is not one of ours."""
    number = checkpoint.stem.removeprefix("model_")
    return int(number) if number.isdigit() else None


class PolicyFolder:
    """Reads and writes the files of one policy."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def record_file(self) -> Path:
        """The file that makes a folder a policy folder."""
        return self.path / "policy.json"

    @property
    def exists(self) -> bool:
        """Whether training has begun here."""
        return self.record_file.is_file()

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other trainings out of the folder, which is made if it is not there.

        Raises:
            PolicyError: another process trains here.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        with held(self.path / LOCK) as holder:
            if holder:
                raise PolicyError(
                    f"{self.path}: another training writes here ({holder}); wait for it, or choose another folder"
                )
            yield

    def write_record(self, record: PolicyRecord) -> None:
        """Write ``policy.json``, with the table of what the policy observes."""
        from kine2go_warp.env.observations import observation_layout

        values: dict[str, Any] = {
            "format_version": FORMAT_VERSION,
            "software_version": __version__,
            "robot": record.robot,
            "clips": list(record.clips),
            "clip_hashes": record.clip_hashes,
            "fingerprint": record.fingerprint,
            "iterations": record.iterations,
            "seconds": record.seconds,
            "core_seconds": record.core_seconds,
            "restarts": record.restarts,
            "restart_reason": record.restart_reason,
            "stop_reason": record.stop_reason,
            "evaluation": asdict(record.evaluation) if record.evaluation is not None else None,
            "preset": to_dictionary(record.preset),
            "observation": [asdict(field) for field in observation_layout(record.preset.env)],
        }
        with atomic_file(self.record_file) as temporary:
            temporary.write_text(json.dumps(values, indent=2) + "\n")

    def read_record(self) -> PolicyRecord:
        """Read ``policy.json``.

        Raises:
            PolicyError: the folder is missing, not a policy, or of another format version.
        """
        try:
            values = json.loads(self.record_file.read_text())
            if values["format_version"] != FORMAT_VERSION:
                raise PolicyError(
                    f"{self.path}: written by version {values['software_version']} in policy format "
                    f"{values['format_version']}, whose settings have other names; train it again with --overwrite, "
                    "or use the version that wrote it"
                )
            return PolicyRecord(
                preset=read_preset(values["preset"], str(self.record_file)),
                robot=values.get("robot", DEFAULT_ROBOT),
                clips=tuple(values["clips"]),
                clip_hashes=tuple(values.get("clip_hashes", ())),
                fingerprint=values["fingerprint"],
                iterations=values["iterations"],
                seconds=values["seconds"],
                core_seconds=values.get("core_seconds", 0.0),
                restarts=values.get("restarts", 0),
                restart_reason=values.get("restart_reason", ""),
                stop_reason=values.get("stop_reason", ""),
                evaluation=stored_evaluation(values.get("evaluation")),
            )
        except FileNotFoundError:
            raise PolicyError(f"{self.path}: no policy here; make one with 'kine2go policy train'") from None
        except (ValueError, KeyError, TypeError, OSError) as error:
            raise PolicyError(f"{self.record_file}: cannot be read ({error})") from None

    def write_clips(self, clips: tuple[MotionClip, ...]) -> tuple[str, ...]:
        """Copy the clips into the folder, so that it stands on its own, and return their file names."""
        names = tuple(f"{clip.name}.npz" for clip in clips)
        for clip, name in zip(clips, names, strict=True):
            clip.save(self.path / name)
        return names

    def read_clips(self, record: PolicyRecord) -> tuple[MotionClip, ...]:
        """Read the clips that the policy tracks.

        Raises:
            ClipError: one cannot be read.
            PolicyError: one is not what the policy was trained on, or is for another robot.
        """
        for name in record.clips:
            check_name(name, self.record_file, PolicyError)
        clips = self.checked_clips(record, [MotionClip.load(self.path / name) for name in record.clips])
        for clip, known in zip(clips, record.clip_hashes, strict=False):
            if clip.content_hash() != known:
                raise PolicyError(
                    f"{self.path / clip.name}.npz: not the clip that the policy was trained on; put that one back, or "
                    "train again with --overwrite"
                )
        return clips

    def checked_clips(self, record: PolicyRecord, clips: Sequence[MotionClip]) -> tuple[MotionClip, ...]:
        """Return clips that the policy can track, its own or others.

        Raises:
            PolicyError: one is for another robot, or two have the same name.
        """
        check_distinct([clip.name for clip in clips], PolicyError)
        for clip in clips:
            if clip.robot != record.robot:
                raise PolicyError(
                    f"{self.path}: the clip {clip.name} is for the robot {clip.robot} and the policy for "
                    f"{record.robot}; retarget the motion to the policy's robot"
                )
        return tuple(clips)

    @property
    def robot(self) -> RobotSpec:
        """The robot that the policy drives.

        Raises:
            PolicyError: the policy cannot be read.
            Kine2GoError: the robot is not available here.
        """
        return stored_robot(self.read_record().robot, str(self.path))

    def checkpoint(self, iteration: int) -> Path:
        """Return where the checkpoint of an iteration (from 0) lies."""
        return self.path / f"model_{iteration}.pt"

    def chosen_clips(self, record: PolicyRecord, names: Sequence[str] = ()) -> tuple[MotionClip, ...]:
        """Return the clips that the policy was trained on, or those of some names.

        Raises:
            PolicyError: it was not trained on one of them.
        """
        known = {clip.name: clip for clip in self.read_clips(record)}
        for name in names:
            if name not in known:
                raise PolicyError(f"{self.path}: was not trained on '{name}'; its clips are: {', '.join(known)}")
        return tuple(known[name] for name in names or known)

    def checkpoints(self) -> list[Path]:
        """Return the checkpoints, oldest first."""
        found = [path for path in self.path.glob("model_*.pt") if checkpoint_iteration(path) is not None]
        return sorted(found, key=lambda path: checkpoint_iteration(path) or 0)

    def iterations_done(self) -> int:
        """Return after how many iterations the newest checkpoint was written, 0 if there is none."""
        found = self.checkpoints()
        return (checkpoint_iteration(found[-1]) or 0) + 1 if found else 0

    def keep_newest(self, count: int) -> None:
        """Remove all checkpoints but the newest."""
        for outdated in self.checkpoints()[:-count]:
            outdated.unlink()

    def set_attempt_aside(self) -> Path:
        """Move checkpoints and log of a training that has diverged to a folder within, and return it.

        The oldest checkpoint goes last: killed meanwhile, training continues and diverges once more.
        """
        aside = self.path / "diverged"
        shutil.rmtree(aside, ignore_errors=True)
        aside.mkdir()
        for path in [*self.path.glob("events.out.*"), *reversed(self.checkpoints())]:
            path.rename(aside / path.name)
        return aside

    def latest_checkpoint(self) -> Path:
        """Return the newest checkpoint.

        Raises:
            PolicyError: there is none.
        """
        found = self.checkpoints()
        if not found:
            raise PolicyError(f"{self.path}: holds no checkpoint; train first")
        return found[-1]

    def checkpoint_hash(self) -> str:
        """Return the SHA-256 of the policy that acts, its normaliser included; what only training needs is not part."""
        from kine2go_warp.learning.checkpoint import weights_hash

        return weights_hash(self.latest_checkpoint())
