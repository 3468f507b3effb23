"""The commands: what each one takes, and what it does."""

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from kine2go_warp.cli.data import (
    CatalogueFile,
    ChosenMotions,
    DataFolder,
    Device,
    OtherClips,
    PolicyPath,
    data_folder,
    read_clips,
)
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import PolicyError
from kine2go_warp.files import check_place
from kine2go_warp.rollouts.config import GatherConfig


def limit_threads() -> None:
    """Keep torch to one thread: small networks lose more to waiting than they gain, above all on shared cores."""
    import torch

    torch.set_num_threads(1)


@dataclass(frozen=True)
class Gather:
    """Roll a policy out many times and add the good rollouts to a dataset.

    Example: kine2go dataset gather runs/policies/dog_trot --trajectories 50
    """

    policy: PolicyPath
    """Policy folder made by 'kine2go policy train'."""
    motions: ChosenMotions = ()
    """Which of the clips that the policy tracks; by default all, each as a motion of its own."""
    clips: OtherClips = ()
    out: Path = Path("runs/dataset.zarr")
    """The dataset, a Zarr store; it is created, or the motions are added to it."""
    device: Device = None
    catalogue: CatalogueFile = None
    strict: bool = False
    """Stop at the first fault of the simulation and save the state before it beside the policy."""
    config: tyro.conf.OmitArgPrefixes[GatherConfig] = field(default_factory=GatherConfig)

    def run(self) -> int:
        """Gather with a progress bar and print a table."""
        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.cli.tables import print_rejections, print_summaries
        from kine2go_warp.dataset.summary import summarise
        from kine2go_warp.dataset.writer import DatasetWriter
        from kine2go_warp.learning.policy import PolicyFolder
        from kine2go_warp.rollouts.gather import gather

        policy = PolicyFolder(self.policy)
        record = policy.read_record()
        others = policy.checked_clips(record, read_clips(self.clips))
        if others and self.motions:
            raise PolicyError("--clips are others than the policy's own, which --motions names; give one of the two")
        clips = others or policy.chosen_clips(record, self.motions)
        check_place(self.out)
        limit_threads()
        results = []
        with Progress() as progress:
            for clip in clips:
                progress.stage(clip.name, "gather")
                writer = DatasetWriter(self.out, policy.robot)
                advanced = progress.advanced
                results.append(
                    gather(policy, writer, self.config, self.device, advanced, self.strict, clip, self.catalogue)
                )
        print_summaries(summarise(self.out, [clip.name for clip in clips]), self.out)
        for result in results:
            print_rejections(result)
        return 0


@dataclass(frozen=True)
class Doctor:
    """Show versions, devices and which motions can be used here, and whether this machine is ready.

    Exit status: 0 if it is, 1 if something is missing.

    Example: kine2go doctor --data clips
    """

    data: DataFolder = None
    catalogue: CatalogueFile = None

    def run(self) -> int:
        """Print what is found."""
        from kine2go_warp.cli.tables import print_machine, print_usable
        from kine2go_warp.motions.catalogue import load_catalogue

        entries, folder = list(load_catalogue(self.catalogue).values()), data_folder(self.data)
        problems = print_machine()
        print_usable(entries, folder)
        for problem in problems:
            say(f"wrong: {problem}")
        say("verdict: not ready" if problems else "verdict: ready; 'kine2go demo' tries everything")
        return 1 if problems else 0
