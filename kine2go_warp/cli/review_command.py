"""The command ``review``: look at the trajectories of a dataset, or at a clip, and say what is good."""

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from kine2go_warp.cli.data import MotionNames, TargetPath
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import DatasetError, RecordingError
from kine2go_warp.metrics import FILTER_METRICS

if TYPE_CHECKING:
    from kine2go_warp.dataset.motion import Motion
    from kine2go_warp.recordings.meshes import Meshes

Named = Annotated[tuple[str, ...], tyro.conf.arg(metavar="[MOTION[/K] ...]")]


@dataclass(frozen=True)
class Review:
    """Look at a dataset's trajectories or at a clip in the Rerun viewer, and keep verdicts on trajectories.

    Example: kine2go dataset review runs/demo/dataset.zarr --step --worst 50
    """

    target: TargetPath
    """A dataset (.zarr), or a clip (.npz) made by 'kine2go motion retarget'."""
    motions: MotionNames = ()
    """Names of the dataset's motions; by default all."""
    worst: int | None = None
    """Only so many trajectories of all motions together, those closest to a limit."""
    by: Annotated[str, tyro.conf.arg(metavar="METRIC")] = ""
    """Order by this metric of the filter, such as foot_slip; by default by the one that is closest to its limit."""
    step: bool = False
    """Go through trajectories in the terminal, the most doubtful first, and accept or reject each by a key. A viewer
    shows the one in question where there is a display, or with --web."""
    sheets: Annotated[Path | None, tyro.conf.arg(metavar="FOLDER")] = None
    """With --step: draw a sheet of eight pictures of each trajectory in question into this folder, and in the terminal
    as far as it can; for machines without a viewer."""
    again: bool = False
    """With --step: also those that have a verdict already."""
    accept: Named = ()
    """Accept these, MOTION or MOTION/K for one trajectory."""
    reject: Named = ()
    """Reject these; loading, export and score leave them out. Say --why."""
    accept_rest: bool = False
    """Accept every trajectory that has no verdict."""
    withdraw: Named = ()
    """Take the verdicts on these back, MOTION or MOTION/K."""
    list: bool = False
    """List the verdicts that there are."""
    why: str = ""
    """Reason of the verdicts."""
    who: str | None = None
    """Your name; by default the one that you are logged in with."""
    trajectories: int | None = None
    """Show so many trajectories of each motion, those closest to a limit; by default all."""
    meshes: Path | None = None
    """Folder with trunk, hip, thigh and calf as .glb, .obj, .stl or .dae, drawn instead of the package's own shapes."""
    out: Path | None = None
    """Folder of the recordings; by default 'recordings' beside the dataset or clip."""
    save: bool = False
    """Only write the recordings."""
    web: bool = False
    """Serve the viewer for a browser on this machine, until interrupted."""
    port: int | None = None
    """Port of the viewer; with --web the page is there and the data are at the next one. By default free ones."""
    overwrite: bool = False
    """Replace recordings that were not made by this command."""

    def run(self) -> int:
        """Do what is asked."""
        self._check_options()
        if self._is_clip():
            return self._show([self._record_clip()])
        motions = self._motions()
        if self.step:
            return self._step(motions)
        if self.list or self.withdraw or self.accept or self.reject or self.accept_rest:
            return self._verdicts(motions)
        if not (self.save or self.web):
            from kine2go_warp.recordings.viewer import check_display

            check_display()
        return self._show(self._record_motions(motions))

    def _verdicts(self, motions: "Sequence[Motion]") -> int:
        """Give, list or take back verdicts."""
        from kine2go_warp.cli import review_verdicts

        if self.list:
            return review_verdicts.print_reviews(self.target, motions)
        if self.withdraw:
            return review_verdicts.withdraw(self.target, self.withdraw)
        if self.accept_rest:
            return review_verdicts.accept_rest(self.target, motions, self.why.strip(), self.who)
        return review_verdicts.keep(self.target, self.accept, self.reject, self.why.strip(), self.who)

    def _is_clip(self) -> bool:
        """Whether the target is a clip rather than a dataset."""
        return self.target.suffix == ".npz" or self.target.is_file()

    def _check_options(self) -> None:
        """Check that the options fit together.

        Raises:
            DatasetError: they do not.
        """
        actions = {
            "--step": self.step,
            "--accept and --reject": bool(self.accept or self.reject),
            "--accept-rest": self.accept_rest,
            "--withdraw": bool(self.withdraw),
            "--list": self.list,
        }
        asked = [name for name, wanted in actions.items() if wanted]
        if self._is_clip() and (asked or self.motions):
            raise DatasetError(f"{self.target}: a clip has neither motions nor verdicts; name a dataset for those")
        if len(asked) > 1:
            raise DatasetError(f"either {asked[0]} or {asked[1]}, not both")
        if self.reject and not self.why.strip():
            raise DatasetError("a rejection needs a reason; say it with --why")
        if self.motions and (self.accept or self.reject or self.withdraw):
            raise DatasetError("--accept, --reject and --withdraw name motions themselves; leave out the others")
        if self.sheets is not None and not self.step:
            raise DatasetError("--sheets goes with --step")
        if self.by and self.by not in (known := [limit.name for limit in FILTER_METRICS]):
            raise DatasetError(f"--by {self.by}: no metric of the filter; known are: {', '.join(known)}")
        for name, least in (("worst", 1), ("trajectories", 1), ("port", 1)):
            value = getattr(self, name)
            if value is not None and not least <= value <= 65_534:
                raise DatasetError(f"--{name} must be at least {least} and at most 65,534, not {value}")

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

    def _record_motions(self, motions: "Sequence[Motion]") -> Sequence[Path]:
        """Write the recordings that are missing or show something else, and return all."""
        from kine2go_warp.cli.progress import tracked
        from kine2go_warp.cli.review_steps import by_limit_usage
        from kine2go_warp.recordings.cache import RecordingCache
        from kine2go_warp.recordings.motion import Style
        from kine2go_warp.tables import counted

        counts: dict[str, int | None] = {motion.name: self.trajectories for motion in motions}
        if self.worst is not None:
            queue = by_limit_usage(motions, True, self.by)[: self.worst]
            counts = dict(Counter(usage.reference.motion for usage in queue))
        paths = []
        for motion in tracked([one for one in motions if one.name in counts], "recording"):
            style = Style(counts[motion.name], by=self.by, meshes=self._meshes())
            one = RecordingCache(self._folder(), style, self.overwrite).ensure(motion)
            state = "written" if one.is_new else "up to date"
            size = one.path.stat().st_size / 1e6
            say(f"{one.path}: {counted(one.shown, 'trajectory')}, {size:.1f} MB, {state}")
            paths.append(one.path)
        return paths

    def _record_clip(self) -> Path:
        """Write the recording of a clip.

        Raises:
            RecordingError: something lies there that may not be replaced.
        """
        from kine2go_warp.motions.clip import MotionClip
        from kine2go_warp.recordings.clip import record_clip
        from kine2go_warp.recordings.viewer import check_display

        clip = MotionClip.load(self.target)
        if not (self.save or self.web):
            check_display()
        path = self._folder() / f"{clip.name}_clip.rrd"
        if path.parent.exists() and not path.parent.is_dir():
            raise RecordingError(f"{path.parent}: is a file; name a folder for the recordings")
        record_clip(clip, path, meshes=self._meshes())
        say(f"{path}: {path.stat().st_size / 1e6:.1f} MB, written")
        return path

    def _show(self, recordings: "Sequence[Path]") -> int:
        """Open the viewer, unless only files are wanted."""
        if self.save:
            return 0
        from kine2go_warp.recordings.viewer import WebViewer, open_native

        if self.web:
            viewer = WebViewer.start(recordings, self.port)
            say(f"open {viewer.url} (Ctrl-C ends it)")
            viewer.wait()
        else:
            open_native(recordings)
        return 0

    def _step(self, motions: "Sequence[Motion]") -> int:
        """Go through trajectories, with what shows the one in question: a viewer, or pictures."""
        from kine2go_warp.cli.review_steps import step_through
        from kine2go_warp.cli.review_views import shown_in

        display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
        with shown_in(self.web, display and not self.sheets, self.port, self._meshes(), self.sheets) as views:
            return step_through(self.target, motions, self.who, self.again, views, self.by, self.worst)
