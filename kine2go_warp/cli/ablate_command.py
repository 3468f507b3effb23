"""The command that compares choices of training."""

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from kine2go_warp.bench.choices import CHOICES, AblationConfig
from kine2go_warp.errors import Kine2GoError


@dataclass(frozen=True)
class Ablate:
    """Train with one choice of 'fast' changed at a time, over clips and seeds, and print what each one buys."""

    clips: tyro.conf.Positional[tuple[Path, ...]]
    """Clips (.npz) made by 'kine2go retarget'."""
    choices: tuple[str, ...] = ()
    """Names of choices; by default all."""
    out: Path = Path("runs/ablation.jsonl")
    """File of results, a line a training. The same command runs those that it lacks."""
    device: str | None = None
    """cpu or cuda; by default cuda where there is one."""
    table: bool = False
    """Run nothing; print the table of the results there are."""
    plot: Path | None = None
    """Also draw the learning curves to this file (.png)."""
    config: tyro.conf.OmitArgPrefixes[AblationConfig] = field(default_factory=AblationConfig)

    def run(self) -> int:
        """Train what is missing and print a table in Markdown."""
        from kine2go_warp.bench.ablation import ablation_table, read_results, run_ablation, tasks
        from kine2go_warp.bench.curves import draw_curves
        from kine2go_warp.cli.commands import limit_threads
        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.device import choose_device
        from kine2go_warp.motions.clip import MotionClip

        if min(self.config.steps, self.config.seeds, self.config.rollouts) < 1:
            raise Kine2GoError("steps, seeds and rollouts must be at least 1")
        unknown = set(self.choices) - {choice.name for choice in CHOICES}
        if unknown:
            known = ", ".join(choice.name for choice in CHOICES)
            raise Kine2GoError(f"unknown choice '{min(unknown)}'; known are: {known}")
        chosen = [choice for choice in CHOICES if choice.name in self.choices or not self.choices]
        if not self.table:
            if not self.clips:
                raise Kine2GoError("name at least one clip; 'kine2go retarget' makes them")
            clips = [MotionClip.load(path) for path in self.clips]
            limit_threads()
            with Progress() as progress:
                run_ablation(
                    tasks(clips, chosen, self.config),
                    self.config,
                    self.out,
                    choose_device(self.device),
                    lambda task: progress.stage(task.label, "train"),
                    lambda state: progress.advanced(state.iteration, state.total_iterations, str(state)),
                )
        results = [record for record in read_results(self.out) if record["choice"] in {one.name for one in chosen}]
        print(ablation_table(results, chosen))
        if self.plot is not None:
            draw_curves(results, self.plot)
        return 0
