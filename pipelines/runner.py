"""Takes the motions of a recipe through all stages, skipping what is already there."""

import json
from dataclasses import dataclass
from pathlib import Path

from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.errors import ClipError, Kine2GoError
from kine2go_warp.files import atomic_file
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.train import train
from kine2go_warp.motions.catalogue import CatalogueEntry, motion_named
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.pipelines.recipe import Recipe
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.gather import GatherResult, gather
from kine2go_warp.settings import to_dictionary


@dataclass(frozen=True)
class Workspace:
    """Where the results of a run lie."""

    root: Path

    @property
    def dataset(self) -> Path:
        """The Zarr store."""
        return self.root / "dataset.zarr"

    def clip(self, motion: str) -> Path:
        """The retargeted clip of a motion."""
        return self.root / "clips" / f"{motion}.npz"

    def policy(self, motion: str) -> Path:
        """The policy folder of a motion."""
        return self.root / "policies" / motion

    def recording(self, motion: str) -> Path:
        """The Rerun recording of a motion."""
        return self.root / "recordings" / f"{motion}.rrd"


class RunObserver:
    """Is told how a run goes. This one does not listen; the command line's shows progress."""

    def stage(self, motion: str, stage: str) -> None:
        """A stage of a motion begins."""

    def advanced(self, done: int, total: int, detail: str) -> None:
        """The present stage has done some of its steps."""

    def finished(self, motion: str, result: GatherResult) -> None:
        """All stages of a motion are done."""

    def failed(self, motion: str, error: Kine2GoError) -> None:
        """A motion ended with an error; the others go on."""


@dataclass(frozen=True)
class RunResult:
    """What became of a run's motions."""

    finished: tuple[GatherResult, ...]
    failed: tuple[str, ...]


class RecipeRunner:
    """Runs one recipe in one workspace."""

    def __init__(
        self,
        recipe: Recipe,
        workspace: Workspace,
        data_folder: Path | None,
        device: str | None = None,
        observer: RunObserver | None = None,
    ) -> None:
        """Check that every motion is known, before anything is written.

        Raises:
            CatalogueError: a motion is not in the catalogue, or needs a data folder and there is none.
        """
        self.recipe, self.workspace, self.data_folder, self.device = recipe, workspace, data_folder, device
        self.observer = observer or RunObserver()
        self.entries = [motion_named(name) for name in recipe.motions]
        for entry in self.entries:
            entry.path(data_folder)

    def run(self) -> RunResult:
        """Take every motion through all stages. A motion that fails does not stop the others."""
        self.workspace.root.mkdir(parents=True, exist_ok=True)
        with atomic_file(self.workspace.root / "recipe.json") as temporary:
            temporary.write_text(json.dumps(to_dictionary(self.recipe), indent=2) + "\n")
        finished, failed = [], []
        for entry in self.entries:
            try:
                result = self._run_motion(entry)
            except Kine2GoError as error:
                failed.append(entry.name)
                self.observer.failed(entry.name, error)
            else:
                finished.append(result)
                self.observer.finished(entry.name, result)
        return RunResult(tuple(finished), tuple(failed))

    def _run_motion(self, entry: CatalogueEntry) -> GatherResult:
        """Take one motion through all stages."""
        clip = self._retarget(entry)
        self.observer.stage(entry.name, "train")
        train(
            [clip],
            self.recipe.train,
            self.workspace.policy(entry.name),
            self.device,
            overwrite=True,
            on_progress=lambda progress: self.observer.advanced(
                progress.iteration, progress.total_iterations, str(progress)
            ),
        )
        self.observer.stage(entry.name, "gather")
        writer = DatasetWriter(self.workspace.dataset, GO2)
        result = gather(
            PolicyFolder(self.workspace.policy(entry.name)),
            writer,
            self.recipe.gather,
            self.device,
            on_progress=self.observer.advanced,
        )
        self._record(entry.name)
        return result

    def _retarget(self, entry: CatalogueEntry) -> MotionClip:
        """Retarget a motion. It takes a moment, so it is done each time and written if it changed."""
        from kine2go_warp.motions.inverse_kinematics import InverseKinematics
        from kine2go_warp.motions.retarget import retarget

        self.observer.stage(entry.name, "retarget")
        clip = retarget(entry, self.data_folder, InverseKinematics(GO2), self.recipe.retarget).clip
        path = self.workspace.clip(entry.name)
        try:
            known = MotionClip.load(path)
            # Files of older versions lack the keypoints, which the hash leaves out.
            is_same = known.content_hash() == clip.content_hash() and known.keypoints is not None
        except ClipError:
            is_same = False
        if not is_same:
            clip.save(path)
        return clip

    def _record(self, motion: str) -> None:
        """Write the recording of a motion, unless it shows the same rollouts already."""
        from kine2go_warp.dataset.motion import Motion
        from kine2go_warp.recordings.motion import Style
        from kine2go_warp.recordings.shelf import Shelf

        if self.recipe.record.trajectories == 0:
            return
        folder = self.workspace.recording(motion).parent
        shelf = Shelf(folder, Style(self.recipe.record.trajectories), overwrite=True)
        shelf.put(Motion(self.workspace.dataset, motion), lambda: self.observer.stage(motion, "record"))
