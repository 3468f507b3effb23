"""Source file to clip."""

from pathlib import Path
from typing import Any

from kine2go_warp.errors import ClipError
from kine2go_warp.motions.catalogue_entry import CatalogueEntry
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.pipelines.artefacts import Artefact
from kine2go_warp.pipelines.job import Job, Monitor
from kine2go_warp.pipelines.stages.base import Inputs, StageOutput, robot_inputs
from kine2go_warp.settings import to_dictionary

GROSS_RESIDUAL = 0.1
"""A foot this far out of reach makes a clip useless [m]."""
GROSS_PATH = 0.2
"""So does a path whose length is off by this share, if the animal went ``LEAST_WAY``."""
LEAST_WAY = 0.3
"""[m]"""


class RetargetStage:
    """Makes ``MOTION.npz``."""

    name = "retarget"
    resumable = False

    def enabled(self, job: Job) -> bool:
        """Return whether the recipe asks for it: always."""
        del job
        return True

    def inputs(self, job: Job, upstream: Inputs) -> dict[str, Any]:
        """Return the source file, its range, and the settings.

        Raises:
            ClipError: the source file is not there.
        """
        del upstream
        if not job.entry.is_there(job.data_folder):
            path = job.entry.path(job.data_folder)
            raise ClipError(f"{path}: no such motion file; 'kine2go motion sources list' shows which are there")
        return {
            "version": 2,
            **entry_inputs(job.entry, job.data_folder),
            "robot_model": job.robot.model_hash,
            **robot_inputs(job),
            "settings": to_dictionary(job.recipe.retarget),
            **({"accepted": True} if job.motion in job.recipe.accept else {}),
        }

    def make(self, job: Job, upstream: Inputs, folder: Path, monitor: Monitor) -> StageOutput:
        """Retarget the motion and assess the clip.

        Raises:
            ClipError: it has a gross fault, and the recipe does not accept it.
        """
        from kine2go_warp.motions.inverse_kinematics import InverseKinematics
        from kine2go_warp.motions.quality import assess, clip_remarks
        from kine2go_warp.motions.retarget import retarget

        del upstream
        result = retarget(job.entry, job.data_folder, InverseKinematics(job.robot), job.recipe.retarget)
        clip = result.clip
        quality = assess(result, job.robot)
        remarks = clip_remarks(quality)
        for remark in remarks:
            monitor.note(f"clip: {remark}")
        is_gross = max(quality.residual, quality.foot_moved) > GROSS_RESIDUAL or (
            abs(quality.path_error) > GROSS_PATH and result.source_path_length > LEAST_WAY
        )
        if is_gross and job.motion not in job.recipe.accept:
            raise ClipError(
                f"the clip is unfit for training: {'; '.join(remarks)}; mend the file or the range of frames, "
                f'or accept it in the recipe with accept = ["{job.motion}"]'
            )
        clip.save(folder / f"{job.motion}.npz")
        monitor.advanced(1, 1, f"{clip.num_frames} frames")
        metrics = {"frames": clip.num_frames, "period": clip.period}
        return StageOutput(clip.content_hash(), {**metrics, "clip_remarks": remarks} if remarks else metrics)

    def publish(self, job: Job, artefact: Artefact) -> None:
        """Link the clip."""
        job.workspace.publish(job.workspace.clip(job.motion), clip_file(job, artefact))


def entry_inputs(entry: CatalogueEntry, data_folder: Path | None) -> dict[str, Any]:
    """Return the source file of a motion and what the catalogue says of it, of a sequence those of its parts."""
    if entry.members:
        parts = [entry_inputs(member, data_folder) for member in entry.members]
        return {"parts": to_dictionary(entry.parts), "members": parts, "hold": entry.hold}
    origin = entry.origin(entry.path(data_folder), entry.frames.start, entry.frames.end, entry.rate)
    return {
        "source": to_dictionary(origin),
        **({} if entry.dialect is None else {"dialect": to_dictionary(entry.dialect)}),
        **({"scale": entry.scale} if entry.scale else {}),
        **({"mode": entry.mode} if entry.mode else {}),
        **({"mirrored": True} if entry.mirrored else {}),
        **({"time_scale": entry.time_scale} if entry.time_scale else {}),
        **({} if entry.kind == "cycle" else {"kind": entry.kind, "hold": entry.hold}),
    }


def clip_file(job: Job, artefact: Artefact) -> Path:
    """Return the clip within the artefact."""
    return artefact.path / f"{job.motion}.npz"


def read_clip(job: Job, upstream: Inputs) -> MotionClip:
    """Return the clip of a motion."""
    return MotionClip.load(clip_file(job, upstream["retarget"]))
