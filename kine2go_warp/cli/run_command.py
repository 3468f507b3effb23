"""The commands that run recipes, and the one that shows how far they are."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from kine2go_warp.cli.commands import limit_threads
from kine2go_warp.cli.data import ChosenMotions, DataFolder, Device, RecipePath, Robot, data_folder
from kine2go_warp.errors import PipelineError
from kine2go_warp.robots import DEFAULT_ROBOT
from kine2go_warp.settings import override

if TYPE_CHECKING:
    from kine2go_warp.pipelines.engines.base import Engine
    from kine2go_warp.pipelines.recipe import Recipe
    from kine2go_warp.pipelines.runner import RunResult
    from kine2go_warp.pipelines.workspace import Workspace

INTERRUPTED = 130


@dataclass(frozen=True)
class RecipeOptions:
    """Which recipe, with what replaced, and where."""

    recipe: RecipePath
    """A TOML file, or the name of a bundled recipe."""
    data: DataFolder = None
    out: Path | None = None
    """Folder for the results; by default runs/NAME of the recipe."""
    device: Device = None
    motions: ChosenMotions = ()
    """Motions, instead of the recipe's: names, or patterns such as 'vhdc_*'."""
    robot: str | None = None
    """Robot, instead of the recipe's: its name, or FILE.py:NAME for one of your own."""
    iterations: int | None = None
    """PPO iterations, instead of the recipe's."""
    trajectories: int | None = None
    """Rollouts of each motion, instead of the recipe's."""
    rows: int | None = None
    """Rows of a trajectory, instead of the recipe's."""
    seed: int | None = None
    """Seed of training and gathering, instead of the recipe's."""
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="[KEY=VALUE ...]")] = ()
    """Any other settings, as KEY=VALUE: train.ppo.entropy_coef=0.01 gather.action_noise_scale='[0, 1]'."""

    def resolved(self) -> "Recipe":
        """Return the recipe with everything replaced.

        Raises:
            RecipeError: the recipe or a setting is wrong.
        """
        from kine2go_warp.pipelines.recipe import load_recipe, named_motions

        robot = () if self.robot is None else (f"robot={self.robot}",)
        recipe = load_recipe(self.recipe, (*self.set, *robot))
        given = {
            "train.ppo.iterations": self.iterations,
            "train.env.seed": self.seed,
            "gather.trajectories": self.trajectories,
            "gather.rows": self.rows,
            "gather.seed": self.seed,
        }
        recipe = override(recipe, {path: value for path, value in given.items() if value is not None}, "options")
        return replace(recipe, motions=named_motions(replace(recipe, motions=self.motions))) if self.motions else recipe

    def workspace(self, recipe: "Recipe") -> "Workspace":
        """Return where the results lie."""
        from kine2go_warp.pipelines.workspace import Workspace

        return Workspace(self.out or Path("runs") / recipe.name)


@dataclass(frozen=True)
class Run(RecipeOptions):
    """Take the motions of a recipe through all stages: retarget, train, gather, score, record.

    Run again, it does only what is missing or what other settings ask for. Ctrl-C stops after a checkpoint, a second
    one at once.

    Example: kine2go run pipelines/smoke.toml --data clips --workers 2
    """

    workers: int | None = None
    """Motions worked on at once: by default one a GPU, or one a core; 0 works in this process, for debugging."""
    ray: str | None = None
    """Address of a Ray cluster that does the work instead of this machine, such as auto (docs/cluster.md)."""
    json: bool = False
    """Write one JSON object a line for everything that happens, for other programs, instead of a table."""
    report: bool = False
    """Write report.html and scores.json of the whole dataset in the end."""

    def run(self) -> int:
        """Run the recipe and print a table of the data written."""
        from kine2go_warp.cli.run_progress import observer_for
        from kine2go_warp.device import print_note
        from kine2go_warp.interruption import StopRequest
        from kine2go_warp.pipelines.runner import RecipeRunner
        from kine2go_warp.pipelines.stages.record import can_record

        recipe = self.resolved()
        workspace, folder = self.workspace(recipe), data_folder(self.data)
        limit_threads()
        engine = self._engine(recipe, workspace)
        if recipe.record.trajectories and not can_record():
            print_note("Rerun is not installed: no recordings are made; run again where it is (extra 'review')")
        message = "stopping after the present steps; once more stops at once"
        with StopRequest(message) as stop, observer_for(self.json) as observer:
            result = RecipeRunner(recipe, workspace, folder, engine, observer, stop).run()
        if not self.json:
            self._print(result, workspace)
        if self.report and result.finished and not result.stopped:
            self._report(workspace)
        if result.stopped:
            return INTERRUPTED
        return 2 if result.failed else 0

    def _engine(self, recipe: "Recipe", workspace: "Workspace") -> "Engine":
        """Return what the stages run on.

        Raises:
            PipelineError: options contradict each other, or Ray cannot be reached.
        """
        from kine2go_warp.device import choose_device
        from kine2go_warp.pipelines.engines.cluster import RayEngine
        from kine2go_warp.pipelines.engines.inline import InlineEngine
        from kine2go_warp.pipelines.engines.local import LocalEngine, default_workers

        if self.ray is not None:
            if self.workers is not None:
                raise PipelineError("either --workers or --ray: the cluster decides how much is done at once")
            return RayEngine(self.ray, self.device)
        if self.workers is not None and self.workers < 0:
            raise PipelineError(f"--workers must be 0 or more, not {self.workers}")
        device = choose_device(self.device)
        if self.workers == 0:
            return InlineEngine(device)
        workers = self.workers or default_workers(len(recipe.motions), device)
        return LocalEngine(workers, device, workspace.root.absolute() / "logs")

    def _print(self, result: "RunResult", workspace: "Workspace") -> None:
        """Print what the dataset holds now."""
        from kine2go_warp.cli.tables import print_summaries
        from kine2go_warp.dataset.summary import summarise

        if result.finished:
            summaries = summarise(workspace.dataset, result.finished)
            print_summaries(summaries, workspace.dataset, workspace.root / "recordings")

    def _report(self, workspace: "Workspace") -> None:
        """Write scores and the page of the dataset."""
        from kine2go_warp.cli.report_command import Report
        from kine2go_warp.cli.score_command import Score

        Score(workspace.dataset, json=workspace.root / "scores.json", overwrite=True).run()
        Report(workspace.dataset, out=workspace.root / "report.html", overwrite=True).run()


@dataclass(frozen=True)
class Demo:
    """Run the whole pipeline on the bundled clip, in minutes and without any data of your own.

    Example: kine2go demo --robot a1
    """

    out: Path | None = None
    """Folder for the results; by default runs/demo, or runs/demo_ROBOT for another robot than the Go2."""
    device: Device = None
    robot: Robot = DEFAULT_ROBOT

    def run(self) -> int:
        """Run the recipe ``demo``."""
        from kine2go_warp.robots import robot_named

        name = "demo" if self.robot == DEFAULT_ROBOT else f"demo_{robot_named(self.robot).name}"
        return Run(recipe=Path("demo"), out=self.out or Path("runs") / name, device=self.device, robot=self.robot).run()


@dataclass(frozen=True)
class Status(RecipeOptions):
    """Show motions and stages of a recipe: what is done, what is going on, what would run, and why.

    Example: kine2go status pipelines/smoke.toml --data clips
    """

    json: bool = False
    """Write one JSON object instead of tables."""
    markdown: Path | None = None
    """Write the results of each motion to this file, too, as a table in Markdown: iterations, why training stopped,
    acceptance with reasons, errors, power, time."""

    def run(self) -> int:
        """Print the tables."""
        from kine2go_warp.cli.status import print_status
        from kine2go_warp.device import choose_device
        from kine2go_warp.pipelines.runner import make_jobs

        recipe = self.resolved()
        workspace = self.workspace(recipe)
        # A cluster's device need not exist on this machine.
        device = self.device or choose_device(None)
        print_status(make_jobs(recipe, workspace, data_folder(self.data), device), self.json, self.markdown)
        return 0
