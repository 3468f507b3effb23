"""The commands: what each one takes, and what it does."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import tyro

from kine2go_warp.cli.data import data_folder
from kine2go_warp.errors import PolicyError
from kine2go_warp.learning.config import TrainConfig
from kine2go_warp.rollouts.config import GatherConfig

Positional = tyro.conf.Positional

Config = TypeVar("Config", TrainConfig, GatherConfig)


def limit_threads() -> None:
    """Keep torch to one thread: small networks lose more to waiting than they gain, above all on shared cores."""
    import torch

    torch.set_num_threads(1)


@dataclass(frozen=True)
class Train:
    """Train a policy that tracks a clip, or several. The same command continues a training that was interrupted."""

    clips: Positional[tuple[Path, ...]]
    """Clips (.npz) made by 'kine2go retarget'. One policy tracks them all, told which by the reference alone."""
    out: Path | None = None
    """Policy folder; by default runs/policies/NAME, or NAME+NAME of several clips."""
    device: str | None = None
    """cpu or cuda; by default cuda where there is one."""
    overwrite: bool = False
    """Start anew if the folder holds a policy of other clips or settings."""
    processes: int | None = None
    """Processes that share the simulation; by default one a core on a CPU, one on a GPU. They change no result."""
    strict: bool = False
    """Stop at the first fault of the simulation (full buffers, numbers not finite) and save the state before it."""
    config: TrainConfig = field(default_factory=TrainConfig)

    def run(self) -> int:
        """Train with a progress bar."""
        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.learning.train import train
        from kine2go_warp.motions.clip import MotionClip

        if not self.clips:
            raise PolicyError("name at least one clip; 'kine2go retarget' makes them")
        clips = [MotionClip.load(path) for path in self.clips]
        limit_threads()
        name = "+".join(clip.name for clip in clips)
        folder = self.out or Path("runs/policies") / name
        with Progress() as progress:
            progress.stage(name, "train")
            record = train(
                clips,
                self.config,
                folder,
                self.device,
                self.overwrite,
                lambda state: progress.advanced(state.iteration, state.total_iterations, str(state)),
                self.processes,
                self.strict,
            )
        print(f"{folder}: {record.iterations} iterations in {record.seconds:.0f} s")
        return 0


@dataclass(frozen=True)
class Gather:
    """Roll a policy out many times and add the good rollouts to a dataset."""

    policy: Positional[Path]
    """Policy folder made by 'kine2go train'."""
    motions: tuple[str, ...] = ()
    """Which of the clips that the policy tracks; by default all, each as a motion of its own."""
    out: Path = Path("runs/dataset.zarr")
    """The dataset, a Zarr store; it is created, or the motions are added to it."""
    device: str | None = None
    """cpu or cuda; by default cuda where there is one."""
    strict: bool = False
    """Stop at the first fault of the simulation and save the state before it beside the policy."""
    config: GatherConfig = field(default_factory=GatherConfig)

    def run(self) -> int:
        """Gather with a progress bar and print a table."""
        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.cli.tables import print_rejections, print_summaries
        from kine2go_warp.dataset.summary import summarise_motion
        from kine2go_warp.dataset.writer import DatasetWriter
        from kine2go_warp.learning.policy import PolicyFolder
        from kine2go_warp.robots import GO2
        from kine2go_warp.rollouts.gather import gather

        policy = PolicyFolder(self.policy)
        motions = policy.motions(self.motions)
        limit_threads()
        results = []
        with Progress() as progress:
            for motion in motions:
                progress.stage(motion, "gather")
                writer = DatasetWriter(self.out, GO2)
                results.append(gather(policy, writer, self.config, self.device, progress.advanced, self.strict, motion))
        print_summaries([summarise_motion(self.out, motion) for motion in motions], self.out)
        for result in results:
            print_rejections(result)
        return 0


@dataclass(frozen=True)
class Run:
    """Take the motions of a recipe through all stages: retarget, train, gather, record."""

    recipe: Positional[Path]
    """A TOML file, or the name of a bundled recipe."""
    data: Path | None = None
    """Folder of the source clips; by default the environment variable KINE2GO_DATA."""
    out: Path | None = None
    """Folder for the results; by default runs/NAME of the recipe."""
    device: str | None = None
    """cpu or cuda; by default cuda where there is one."""
    iterations: int | None = None
    """PPO iterations, instead of the recipe's."""
    trajectories: int | None = None
    """Rollouts of each motion, instead of the recipe's."""
    rows: int | None = None
    """Rows of a trajectory, instead of the recipe's."""
    seed: int | None = None
    """Seed of training and gathering, instead of the recipe's."""

    def run(self) -> int:
        """Run the recipe with a progress bar and print a table of the data written."""
        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.cli.tables import print_summaries
        from kine2go_warp.dataset.summary import summarise_motion
        from kine2go_warp.pipelines.recipe import load_recipe
        from kine2go_warp.pipelines.runner import RecipeRunner, Workspace

        recipe = load_recipe(self.recipe)
        training = {"iterations": self.iterations, "seed": self.seed}
        gathering = {"trajectories": self.trajectories, "rows": self.rows, "seed": self.seed}
        recipe = replace(recipe, train=overridden(recipe.train, training), gather=overridden(recipe.gather, gathering))
        folder = data_folder(self.data)
        workspace = Workspace(self.out or Path("runs") / recipe.name)
        limit_threads()
        with Progress() as progress:
            result = RecipeRunner(recipe, workspace, folder, self.device, progress).run()
        if result.finished:
            summaries = [summarise_motion(workspace.dataset, motion.motion) for motion in result.finished]
            print_summaries(summaries, workspace.dataset, workspace.root / "recordings")
        return 2 if result.failed else 0


@dataclass(frozen=True)
class Demo:
    """Run the whole pipeline on the bundled clip, in minutes and without any data of your own."""

    out: Path = Path("runs/demo")
    """Folder for the results."""
    device: str | None = None
    """cpu or cuda; by default cuda where there is one."""

    def run(self) -> int:
        """Run the recipe ``demo``."""
        return Run(recipe=Path("demo"), out=self.out, device=self.device).run()


@dataclass(frozen=True)
class Doctor:
    """Show versions, devices and which motions can be used here."""

    data: Path | None = None
    """Folder of the source clips; by default the environment variable KINE2GO_DATA."""

    def run(self) -> int:
        """Print what is found."""
        from kine2go_warp.cli.tables import print_machine, print_motions
        from kine2go_warp.motions.catalogue import load_catalogue

        print_machine()
        print_motions(list(load_catalogue().values()), data_folder(self.data))
        return 0


def overridden(config: Config, values: dict[str, int | None]) -> Config:
    """Return settings with those values that are given."""
    return replace(config, **{name: value for name, value in values.items() if value is not None})
