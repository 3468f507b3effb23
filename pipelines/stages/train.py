"""Clip to policy."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.pipelines.artefacts import Artefact
from kine2go_warp.pipelines.job import Job, Monitor
from kine2go_warp.pipelines.stages.base import Inputs, StageOutput, robot_inputs
from kine2go_warp.pipelines.stages.retarget import read_clip

if TYPE_CHECKING:
    from kine2go_warp.training.logger import TrainingProgress


class TrainStage:
    """Makes a policy folder."""

    name = "train"
    resumable = True

    def enabled(self, job: Job) -> bool:
        """Return whether the recipe asks for it: always."""
        del job
        return True

    def inputs(self, job: Job, upstream: Inputs) -> dict[str, Any]:
        """Return the clip's content and the resolved settings."""
        from kine2go_warp.training.train import deciding_settings

        settings = deciding_settings(job.recipe.train.on(job.device))
        return {"version": 1, "clip": upstream["retarget"].record.output, "settings": settings, **robot_inputs(job)}

    def make(self, job: Job, upstream: Inputs, folder: Path, monitor: Monitor) -> StageOutput:
        """Train, or continue an interrupted training, or one of fewer iterations."""
        from kine2go_warp.training.train import train

        clip = read_clip(job, upstream)
        if not PolicyFolder(folder).exists:
            self._begin_from_shorter(job, upstream, folder)

        def report(progress: "TrainingProgress") -> None:
            metrics = {"reward": progress.reward, "episode_length": progress.episode_length}
            if progress.evaluation is not None:
                metrics |= progress.evaluation.curves
            monitor.advanced(progress.iteration, progress.total_iterations, str(progress), **metrics)

        record = train(
            [clip],
            job.recipe.train,
            folder,
            job.device,
            overwrite=True,
            on_progress=report,
            processes=job.processes,
            should_stop=monitor.should_stop,
            on_note=monitor.note,
        )
        metrics = {"iterations": record.iterations, "seconds": round(record.seconds, 1), "stopped": record.stop_reason}
        if record.evaluation is not None:
            metrics["evaluation"] = record.evaluation.described()
        return StageOutput(PolicyFolder(folder).checkpoint_hash(), metrics)

    def _begin_from_shorter(self, job: Job, upstream: Inputs, folder: Path) -> None:
        """Begin with a copy of a finished training that differs in its number of iterations alone, if there is one."""
        from kine2go_warp.training.train import training_fingerprint

        preset = job.recipe.train.on(job.device)
        fingerprint = training_fingerprint([read_clip(job, upstream)], preset)
        best: tuple[int, Path] | None = None
        for path in folder.parent.glob(f"{job.motion}-{'[0-9a-f]' * 16}"):
            if (path / "policy.json").is_file():
                record = PolicyFolder(path).read_record()
                is_shorter = record.iterations < preset.ppo.iterations
                if record.fingerprint == fingerprint and is_shorter and (best is None or record.iterations > best[0]):
                    best = (record.iterations, path)
        if best is not None:
            shutil.copytree(best[1], folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("artefact.json"))

    def publish(self, job: Job, artefact: Artefact) -> None:
        """Link the policy folder."""
        job.workspace.publish(job.workspace.policy(job.motion), artefact.path)
