"""The command that compares variants of training."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from kine2go_warp.cli.data import ClipPaths, Device, read_named_clips
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.evaluation.ablation import BUNDLED, AblationConfig
from kine2go_warp.files import check_place


@dataclass(frozen=True)
class Ablate:
    """Train with a few settings changed at a time, over clips and seeds, and print how well each policy tracks.

    Ctrl-C stops after the iteration; the same command continues. 'tensorboard --logdir OUT' shows the learning curves.

    Example: kine2go policy ablate runs/clips/dog_trot.npz --seeds 3
    """

    clips: ClipPaths
    """Clips (.npz) made by 'kine2go motion retarget'."""
    variants: Annotated[tuple[str, ...], tyro.conf.arg(metavar="[VARIANT ...]")] = ()
    """Names of variants; by default all of the file."""
    file: Path = BUNDLED
    """TOML file of variants: preset = NAME, and a section [variants.NAME] of changed settings for each."""
    out: Path = Path("runs/ablation")
    """Folder for the policies and their results; the same command runs what is missing there."""
    device: Device = None
    processes: int = 1
    """Processes that share a simulation on a CPU."""
    table: bool = False
    """Run nothing; print the tables of the results there are."""
    config: tyro.conf.OmitArgPrefixes[AblationConfig] = field(default_factory=AblationConfig)

    def run(self) -> int:
        """Train and evaluate what is missing, and print a table in Markdown for each clip."""
        from kine2go_warp.cli.commands import limit_threads
        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.device import choose_device, choose_processes
        from kine2go_warp.evaluation.ablation import RESULT_FILE, ablation_table, load_variants, run_trial, trials
        from kine2go_warp.interruption import StopRequest

        variants = load_variants(self.file, self.variants)
        clips = read_named_clips(self.clips)
        if not self.table:
            check_place(self.out)
            device = choose_device(self.device)
            choose_processes(self.processes, 1, device)
            limit_threads()
            message = "stopping after this iteration, with a checkpoint; once more stops at once"
            with StopRequest(message) as stop, Progress() as progress:
                for trial in trials(clips, variants, self.config, self.out):
                    progress.stage(trial.label, "train")
                    run_trial(
                        trial,
                        self.config,
                        device,
                        processes=self.processes,
                        on_progress=lambda state: progress.advanced(
                            state.iteration, state.total_iterations, str(state)
                        ),
                        should_stop=stop,
                        on_note=progress.note,
                    )
        elif not any(self.out.glob(f"*/*/seed-*/{RESULT_FILE}")):
            raise Kine2GoError(f"{self.out}: no results of an ablation here; leave out --table to make them")
        for clip in clips:
            say(ablation_table(clip.name, variants, self.out))
        return 0
