"""Policy to rollouts."""

from pathlib import Path
from typing import Any

from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.pipelines.artefacts import Artefact
from kine2go_warp.pipelines.job import Job, Monitor
from kine2go_warp.pipelines.stages.base import Inputs, StageOutput, robot_inputs
from kine2go_warp.settings import to_dictionary

STORE = "motion.zarr"
"""A dataset of this one motion, within the artefact."""


class GatherStage:
    """Makes a dataset of one motion, which is then taken into the dataset of the run."""

    name = "gather"
    resumable = False

    def enabled(self, job: Job) -> bool:
        """Return whether the recipe asks for it: always."""
        del job
        return True

    def inputs(self, job: Job, upstream: Inputs) -> dict[str, Any]:
        """Return the policy's content, that of its clip, and the settings."""
        from kine2go_warp.rollouts.gather import resolve_settings

        return {
            "version": 1,
            "policy": upstream["train"].record.output,
            "clip": upstream["retarget"].record.output,
            "robot_model": job.robot.model_hash,
            **robot_inputs(job),
            "settings": to_dictionary(resolve_settings(job.recipe.gather, job.motion, job.recipe.own_catalogue)),
        }

    def make(self, job: Job, upstream: Inputs, folder: Path, monitor: Monitor) -> StageOutput:
        """Roll the policy out."""
        from kine2go_warp.dataset.content import motion_content
        from kine2go_warp.dataset.writer import DatasetWriter
        from kine2go_warp.rollouts.gather import gather

        def report(accepted: int, total: int, detail: str) -> None:
            monitor.stop_if_asked()
            monitor.advanced(accepted, total, detail, accepted=float(accepted))

        writer = DatasetWriter(folder / STORE, job.robot)
        policy, own = PolicyFolder(upstream["train"].path), job.recipe.own_catalogue
        result = gather(policy, writer, job.recipe.gather, job.device, report, catalogue=own)
        rejected = sum(result.rejected.values())
        metrics = {"accepted": result.accepted, "rejected": rejected, "reasons": result.rejected}
        return StageOutput(motion_content(folder / STORE, job.motion), metrics)

    def publish(self, job: Job, artefact: Artefact) -> None:
        """Take the motion into the dataset of the run.

        Motions of the recipe that were simulated otherwise, with older settings, leave it: their artefacts stay.

        Raises:
            DatasetError: the dataset holds other motions, which do not go with this one.
        """
        from kine2go_warp.dataset.writer import DatasetWriter

        writer = DatasetWriter(job.workspace.dataset, job.robot)
        writer.adopt(artefact.path / STORE, job.motion, replaceable=job.recipe.motions)
