"""The command ``review``: look at the trajectories of a dataset, or at a clip, and say what is good."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from kine2go_warp.cli.data import MotionNames
from kine2go_warp.errors import DatasetError, RecordingError

if TYPE_CHECKING:
    from kine2go_warp.dataset.motion import Motion, Trajectory
    from kine2go_warp.recordings.meshes import Meshes

Positional = tyro.conf.Positional


@dataclass(frozen=True)
class Review:
    """Look at a dataset's trajectories or at a clip in the Rerun viewer, and keep verdicts on trajectories.

    Example: kine2go dataset review runs/demo/dataset.zarr --step --worst 50
    """

    target: Positional[Path]
    """A dataset (.zarr), or a clip (.npz) made by 'kine2go motion retarget'."""
    motions: MotionNames = ()
    """Names of the dataset's motions; by default all."""
    step: bool = False
    """Go through trajectories in the terminal, those closest to a limit first, and accept or reject each by a key."""
    again: bool = False
    """With --step: also those that have a verdict already."""
    accept: tuple[str, ...] = ()
    """Accept these, MOTION or MOTION/K for one trajectory."""
    reject: tuple[str, ...] = ()
    """Reject these; loading, export and score leave them out. Say --why."""
    why: str = ""
    """Reason of the verdicts."""
    who: str | None = None
    """Your name; by default the one that you are logged in with."""
    trajectories: int | None = None
    """Show so many trajectories of each motion, those closest to a limit; by default all."""
    meshes: Path | None = None
    """Folder with trunk, hip, thigh and calf as .glb, .obj, .stl or .dae, drawn instead of primitive shapes."""
    out: Path | None = None
    """Folder of the recordings; by default 'recordings' beside the dataset or clip."""
    save: bool = False
    """Only write the recordings."""
    web: bool = False
    """Serve the viewer for a browser on this machine, until interrupted."""
    overwrite: bool = False
    """Replace recordings that were not made by this command."""

    def run(self) -> int:
        """Do what is asked."""
        self._check_options()
        if self.target.suffix == ".npz" or self.target.is_file():
            return self._show([self._record_clip()])
        if self.accept or self.reject:
            return self._judge()
        if self.step:
            from kine2go_warp.cli.review_steps import step_through

            return step_through(self.target, self._motions(), self.who, self.again)
        return self._show(self._record_motions())

    def _check_options(self) -> None:
        """Check that the options fit together.

        Raises:
            DatasetError: they do not.
        """
        is_clip = self.target.suffix == ".npz" or self.target.is_file()
        verdicts = bool(self.accept or self.reject)
        if is_clip and (verdicts or self.step or self.motions):
            raise DatasetError(f"{self.target}: a clip has neither motions nor verdicts; name a dataset for those")
        if self.reject and not self.why.strip():
            raise DatasetError("a rejection needs a reason; say it with --why")
        if verdicts and self.step:
            raise DatasetError("either --step, or --accept and --reject, not both")
        if self.trajectories is not None and self.trajectories < 1:
            raise DatasetError(f"--trajectories must be at least 1, not {self.trajectories}")
        if not (verdicts or self.step or self.save or self.web):
            from kine2go_warp.recordings.viewer import check_display

            check_display()

    def _motions(self) -> "list[Motion]":
        """Return the motions that are named, or all.

        Raises:
            DatasetError: there is no dataset, it is empty, or it lacks one of them.
        """
        from kine2go_warp.dataset import open_dataset

        dataset = open_dataset(self.target)
        return [dataset.motion(name) for name in dataset.chosen(self.motions)]

    def _meshes(self) -> "Meshes | None":
        """Return the user's meshes, if there are any."""
        from kine2go_warp.recordings.meshes import Meshes

        return None if self.meshes is None else Meshes.find(self.meshes)

    def _folder(self) -> Path:
        """Return where the recordings lie."""
        whole = self.target if self.target.name else self.target.absolute()
        return self.out or whole.parent / "recordings"

    def _record_motions(self) -> list[Path]:
        """Write the recordings that are missing or show something else, and return all."""
        from kine2go_warp.cli.progress import tracked
        from kine2go_warp.recordings.cache import RecordingCache
        from kine2go_warp.recordings.motion import Style
        from kine2go_warp.tables import counted

        cache = RecordingCache(self._folder(), Style(self.trajectories, self._meshes()), self.overwrite)
        paths = []
        for motion in tracked(self._motions(), "recording"):
            one = cache.ensure(motion)
            state = "written" if one.is_new else "up to date"
            size = one.path.stat().st_size / 1e6
            print(f"{one.path}: {counted(one.shown, 'trajectory')}, {size:.1f} MB, {state}", flush=True)
            paths.append(one.path)
        return paths

    def _record_clip(self) -> Path:
        """Write the recording of a clip.

        Raises:
            RecordingError: something lies there that may not be replaced.
        """
        from kine2go_warp.motions.clip import MotionClip
        from kine2go_warp.recordings.clip import record_clip

        clip = MotionClip.load(self.target)
        path = self._folder() / f"{clip.name}_clip.rrd"
        if path.parent.exists() and not path.parent.is_dir():
            raise RecordingError(f"{path.parent}: is a file; name a folder for the recordings")
        record_clip(clip, path, meshes=self._meshes())
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB, written", flush=True)
        return path

    def _show(self, recordings: Sequence[Path]) -> int:
        """Open the viewer, unless only files are wanted."""
        if self.save:
            return 0
        from kine2go_warp.recordings.viewer import WebViewer, open_native

        if self.web:
            viewer = WebViewer.start(recordings)
            print(f"open {viewer.url} (Ctrl-C ends it)", flush=True)
            viewer.wait()
        else:
            open_native(recordings)
        return 0

    def _judge(self) -> int:
        """Keep the verdicts that are given as options."""
        from kine2go_warp.dataset.reviews import ACCEPTED, REJECTED, add_reviews, new_review
        from kine2go_warp.tables import counted

        both = set(self.accept) & set(self.reject)
        if both:
            raise DatasetError(f"'{min(both)}' is both accepted and rejected")
        if self.motions:
            raise DatasetError("--accept and --reject name motions themselves; leave out the others")
        verdicts = [
            new_review(one, verdict, self.why.strip(), self.who)
            for verdict, names in ((ACCEPTED, self.accept), (REJECTED, self.reject))
            for name in names
            for one in self._named(name)
        ]
        add_reviews(self.target, verdicts)
        for verdict in (ACCEPTED, REJECTED):
            count = sum(one.verdict == verdict for one in verdicts)
            if count:
                print(f"{self.target}: {counted(count, 'trajectory')} {verdict}")
        return 0

    def _named(self, name: str) -> "list[Trajectory]":
        """Return the trajectories that MOTION or MOTION/K stands for, with all arrays.

        Raises:
            DatasetError: there is no such motion or trajectory.
        """
        from kine2go_warp.dataset.access import open_dataset

        motion_name, slash, number = name.partition("/")
        motion = open_dataset(self.target).motion(motion_name)
        references = [one for one in motion.references() if one.length > 0]
        if slash:
            references = [one for one in references if str(one.index) == number]
        if not references:
            count = len(motion.lengths)
            raise DatasetError(f"{self.target}: no trajectory '{name}'; {motion_name} has {count}, 0 to {count - 1}")
        return list(motion.read(references, None))
