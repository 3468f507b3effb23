"""Rollouts to scores."""

from pathlib import Path
from typing import Any

from kine2go_warp.pipelines.artefacts import Artefact
from kine2go_warp.pipelines.job import Job, Monitor
from kine2go_warp.pipelines.stages.base import Inputs, StageOutput

HEADLINES = ("joint_rmse", "root_error", "foot_slip", "power", "acceptance")
"""Metrics that are shown of every motion."""


class ScoreStage:
    """Makes ``MOTION.json`` with all metrics of the motion."""

    name = "score"
    resumable = False

    def enabled(self, job: Job) -> bool:
        """Return whether the recipe asks for it."""
        return job.recipe.score.enabled

    def inputs(self, job: Job, upstream: Inputs) -> dict[str, Any]:
        """Return the data's content and what people said of it."""
        return {"version": 1, "data": upstream["gather"].record.output, "verdicts": reviews_on(job)}

    def make(self, job: Job, upstream: Inputs, folder: Path, monitor: Monitor) -> StageOutput:
        """Score the trajectories that nobody rejected."""
        from kine2go_warp.dataset import open_dataset
        from kine2go_warp.files import sha256_of
        from kine2go_warp.scores.report import measure, score, scored_motions, write_json

        del upstream
        dataset = open_dataset(job.workspace.dataset)
        scored_motions(dataset, [job.motion])
        measured = measure(dataset.load(job.motion), dataset.robot)
        scores = score([measured])
        path = folder / f"{job.motion}.json"
        write_json(job.workspace.dataset, [measured], scores, path)
        monitor.advanced(1, 1, f"{measured.trajectories} trajectories")
        means = {name: scores.overall[name].value for name in HEADLINES}
        return StageOutput(sha256_of(path)[:32], {name: value for name, value in means.items() if value == value})  # noqa: PLR0124

    def publish(self, job: Job, artefact: Artefact) -> None:
        """Link the scores."""
        job.workspace.publish(job.workspace.scores(job.motion), artefact.path / f"{job.motion}.json")


def reviews_on(job: Job) -> list[str]:
    """Return what people said of a motion, one text a verdict."""
    from kine2go_warp.dataset.reviews import read_reviews

    if not job.workspace.dataset.is_dir():
        return []
    verdicts = read_reviews(job.workspace.dataset)
    return [f"{one.content_hash} {one.verdict} {one.when}" for one in verdicts if one.motion == job.motion]
