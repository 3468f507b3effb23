"""The command that repeats trajectories."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from kine2go_warp.cli.data import DatasetPath, check_data
from kine2go_warp.cli.texts import say

if TYPE_CHECKING:
    from kine2go_warp.rollouts.replay import ReplayResult

DIFFERENT = 1


@dataclass(frozen=True)
class Replay:
    """Repeat the recorded commands of trajectories from their initial states and compare with the record.

    Example: kine2go dataset replay runs/demo/dataset.zarr dog_trot 0
    """

    dataset: DatasetPath
    """A dataset made by 'kine2go dataset gather' or 'kine2go run'."""
    motion: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="[MOTION]")] = None
    """Name of a motion; by default all of them."""
    trajectory: Annotated[tyro.conf.Positional[int | None], tyro.conf.arg(metavar="[K]")] = None
    """Number of a trajectory; by default the first --count."""
    count: int = 3
    """How many trajectories of each motion."""
    engine: Literal["newton", "mujoco"] = "newton"
    """newton repeats bit for bit on the CPU what was gathered there; mujoco tells how far plain MuJoCo agrees."""
    device: Annotated[str | None, tyro.conf.arg(metavar="{cpu,cuda,cuda:1}")] = None
    """Where Newton simulates; by default where the motion was gathered."""

    def run(self) -> int:
        """Replay, print a table, and return 1 if a replay on the same device is not the same bit for bit."""
        from kine2go_warp.dataset import open_dataset
        from kine2go_warp.errors import DatasetError

        if self.count < 1:
            raise DatasetError(f"count is {self.count}; it must be at least 1")
        dataset = open_dataset(self.dataset)
        spec = dataset.robot
        motions = dataset.chosen([] if self.motion is None else [self.motion])
        for motion in motions:
            dataset.left_out(motion)  # a damaged file of verdicts is an error everywhere
            check_data(dataset.motion(motion))

        from kine2go_warp.cli.progress import tracked
        from kine2go_warp.cli.tables import print_replays
        from kine2go_warp.device import choose_device, is_here
        from kine2go_warp.robots.compiled import model_difference
        from kine2go_warp.rollouts.replay import replay_motion

        results: list[tuple[str, str, list[ReplayResult]]] = []
        differs = False
        for motion in tracked(motions, "replaying"):
            opened = dataset.motion(motion)
            if note := model_difference(opened.attributes, spec):
                say(f"{motion}: made with another robot model ({note})")
            gathered_on = str(opened.attributes.get("device", "cpu"))
            device = choose_device(self.device or (gathered_on if is_here(gathered_on) else "cpu"))
            if not self.device and device != gathered_on:
                say(f"{motion}: gathered on {gathered_on}, which is not here; on {device} a replay agrees to rounding")
            chosen = list(range(min(self.count, len(opened.lengths))))
            if self.trajectory is not None:
                chosen = [self.trajectory]
            found = replay_motion(self.dataset, motion, chosen, self.engine, device)
            results.append((motion, device, found))
            # CUDA adds contacts in no fixed order, and other devices and engines round otherwise: there it is no fault.
            must_agree = self.engine == "newton" and device == gathered_on == "cpu"
            differs |= must_agree and not all(one.is_identical for one in found)
        print_replays(results, self.engine)
        return DIFFERENT if differs else 0
