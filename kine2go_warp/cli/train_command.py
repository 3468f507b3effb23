"""The command that trains, and its settings: a preset, over it a file, over that the options."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from kine2go_warp.benchmark.splits import split_of
from kine2go_warp.cli.commands import limit_threads
from kine2go_warp.cli.data import ClipPaths, Device, read_named_clips
from kine2go_warp.cli.texts import say
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.errors import PolicyError
from kine2go_warp.files import check_place
from kine2go_warp.learning.presets import FAST, PpoConfig, Preset, base_preset, find_preset
from kine2go_warp.learning.stopping import StoppingConfig
from kine2go_warp.settings import from_dictionary, to_dictionary
from kine2go_warp.toml import place_in, read_toml, to_toml

NAMED_CLIPS = 4
"""Most clips whose names make that of their policy."""


@dataclass(frozen=True)
class Train:
    """Train a policy that tracks a clip, or several.

    Ctrl-C stops after the iteration, with a checkpoint from which the same command continues exactly; a second one
    stops at once.

    Example: kine2go policy train runs/clips/dog_trot.npz --iterations 200
    """

    clips: ClipPaths = ()
    """Clips (.npz) made by 'kine2go motion retarget'. One policy tracks them all, told which by the reference alone."""
    held_out: bool = True
    """Train also on those that the benchmark holds out, so that figures on them say nothing of new motions."""
    out: Path | None = None
    """Policy folder; by default runs/policies/NAME, NAME+NAME of a few clips, or 52_clips of so many."""
    device: Device = None
    overwrite: bool = False
    """Start anew if the folder holds a policy of other clips or settings."""
    processes: int | None = None
    """Processes that share the simulation; by default one a core on a CPU, one on a GPU. They change no result."""
    strict: bool = False
    """Stop at the first fault of the simulation (full buffers, numbers not finite) and save the state before it."""
    rerun: bool = False
    """Watch in the Rerun viewer: some worlds beside their references, rewards, errors, lengths of episodes."""
    rerun_web: bool = False
    """The same in a browser on this machine, for as long as the training runs."""
    rerun_save: Path | None = None
    """Write the same to this file (.rrd) instead."""
    preset: str = FAST.preset
    """Settings to begin with: fast, paper, robust, generalist, finetune, no_state_estimation, or FILE.py:NAME for a
    preset of your own."""
    config: Path | None = None
    """TOML file whose section [train] replaces some of the preset's settings, as in a recipe."""
    print_config: bool = False
    """Train nothing; write all settings as a TOML file that --config and recipes take."""
    iterations: int | None = None
    """Short for --ppo.iterations."""
    num_worlds: int | None = None
    """Short for --env.num-worlds."""
    seed: int | None = None
    """Short for --env.seed."""
    terrain: str | None = None
    """Short for --env.terrain.kind."""
    env: EnvConfig = field(default_factory=lambda: FAST.env)
    ppo: PpoConfig = field(default_factory=lambda: FAST.ppo)
    stopping: StoppingConfig = field(default_factory=lambda: FAST.stopping)
    initial_policy: str = ""
    """Policy folder whose networks training begins with, instead of new ones."""

    def settings(self) -> Preset:
        """Return all settings, the short options included.

        Raises:
            Kine2GoError: a value is wrong.
        """
        short = {
            "ppo.iterations": self.iterations,
            "env.num_worlds": self.num_worlds,
            "env.seed": self.seed,
            "env.terrain.kind": self.terrain,
        }
        given = {path: value for path, value in short.items() if value is not None}
        return Preset(self.preset, self.env, self.ppo, self.stopping, self.initial_policy).override(given)

    def run(self) -> int:
        """Train with a progress bar."""
        settings = self.settings()
        if self.print_config:
            print(to_toml({"train": to_dictionary(settings)}), end="")
            return 0
        clips = [clip for clip in read_named_clips(self.clips) if self.held_out or split_of(clip.name) == "train"]
        if not clips:
            raise PolicyError("all of the clips are held out by the benchmark; name others, or leave out --no-held-out")
        name = "+".join(clip.name for clip in clips) if len(clips) <= NAMED_CLIPS else f"{len(clips)}_clips"
        folder = self.out or Path("runs/policies") / name
        check_place(folder)

        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.cli.watching import watching
        from kine2go_warp.device import choose_device, choose_processes, silent_standard_error
        from kine2go_warp.interruption import StopRequest
        from kine2go_warp.motions.clip import robot_of
        from kine2go_warp.training.ranks import Ranks

        choose_processes(self.processes, settings.env.num_worlds, choose_device(self.device))
        limit_threads()

        from kine2go_warp.training.train import train

        if not Ranks.of_torchrun().is_first:
            with StopRequest("") as stop, silent_standard_error():
                train(clips, settings, folder, self.device, self.overwrite, None, self.processes, self.strict, stop)
            return 0
        message = "stopping after this iteration, with a checkpoint; once more stops at once"
        watch = watching(name, robot_of(clips), self.rerun, self.rerun_web, self.rerun_save)
        with StopRequest(message) as stop, watch as observer, Progress() as progress:
            progress.stage(name, "train")
            record = train(
                clips,
                settings,
                folder,
                self.device,
                self.overwrite,
                lambda state: progress.advanced(state.iteration, state.total_iterations, str(state)),
                self.processes,
                self.strict,
                stop,
                progress.note,
                observer,
            )
        say(f"{folder}: {record.iterations} iterations in {record.seconds:.0f} s, stopped: {record.stop_reason}")
        if record.evaluation is not None:
            say(f"the policy after {record.evaluation.iteration} iterations is kept: {record.evaluation}")
        return 0


def default_train(arguments: Sequence[str]) -> Train:
    """Return what the command takes where no option says otherwise: the settings of ``--preset`` and ``--config``.

    Raises:
        Kine2GoError: there is no such preset or file, or a setting in the file is wrong.
    """
    preset, config = option(arguments, "--preset"), option(arguments, "--config")
    found = find_preset(FAST.preset if preset is None else preset)
    if config is not None:
        values, text = read_toml(Path(config))
        if "train" not in values:
            raise PolicyError(f"{config}: has no section [train]")
        section, locate = values["train"], partial(place_in, text)
        base = found if preset else base_preset(section, config, locate=locate)
        section = {**section, "preset": base.preset} if isinstance(section, dict) else section
        found = from_dictionary(Preset, section, config, locate=lambda key: locate(f"train.{key}"), base=base)
    return Train(
        preset=found.preset,
        env=found.env,
        ppo=found.ppo,
        stopping=found.stopping,
        initial_policy=found.initial_policy,
    )


def option(arguments: Sequence[str], name: str) -> str | None:
    """Return the value of an option, none if it is not given."""
    for number, argument in enumerate(arguments):
        if argument == name and number + 1 < len(arguments):
            return arguments[number + 1]
        if argument.startswith(f"{name}="):
            return argument.partition("=")[2]
    return None
