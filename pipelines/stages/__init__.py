"""The stages that a motion goes through, each a pure step from inputs to an artefact."""

from kine2go_warp.pipelines.stages.base import Stage, StageOutput
from kine2go_warp.pipelines.stages.gather import GatherStage
from kine2go_warp.pipelines.stages.record import RecordStage
from kine2go_warp.pipelines.stages.retarget import RetargetStage
from kine2go_warp.pipelines.stages.score import ScoreStage
from kine2go_warp.pipelines.stages.train import TrainStage

STAGES: tuple[Stage, ...] = (RetargetStage(), TrainStage(), GatherStage(), ScoreStage(), RecordStage())
"""In the order in which a motion goes through them."""

__all__ = ["STAGES", "Stage", "StageOutput"]
