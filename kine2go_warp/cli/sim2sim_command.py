"""The command that carries a policy over into another simulator."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from kine2go_warp.cli.commands import limit_threads
from kine2go_warp.cli.data import Device, PolicyPath
from kine2go_warp.cli.eval_command import check_output, print_early_ends, results_table
from kine2go_warp.cli.texts import say
from kine2go_warp.files import check_place

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kine2go_warp.evaluation.config import EvalConfig
    from kine2go_warp.evaluation.sim2sim import Comparison


@dataclass(frozen=True)
class Sim2Sim:
    """Let the exported policy drive the robot in plain MuJoCo, and hold it against the policy in Newton.

    Example: kine2go policy sim2sim runs/policies/dog_trot
    """

    policy: PolicyPath
    """Policy folder made by 'kine2go policy train'."""
    exported: Path | None = None
    """Its export; by default export in the policy folder, which is made if it is missing."""
    worlds: int = 32
    """Rollouts of each clip; initial phases and headings are evenly spaced."""
    seconds: float = 20.0
    """Length of a rollout [s]."""
    seed: int = 1
    """Seed of what differs between the initial states."""
    json: Path | None = None
    """Write the results to this file; by default sim2sim.json in the policy folder."""
    overwrite: bool = False
    """Replace the file if it is there; the one in the policy folder always is."""
    device: Device = None

    def run(self) -> int:
        """Export if need be, simulate with a progress bar, write, and print a table."""
        from kine2go_warp.evaluation.config import EvalConfig
        from kine2go_warp.learning.policy import PolicyFolder

        config = EvalConfig(worlds=self.worlds, seconds=self.seconds, seed=self.seed)
        check_output(self.json, self.overwrite)
        policy = PolicyFolder(self.policy)
        policy.read_record()
        policy.latest_checkpoint()
        path = self.json or policy.path / "sim2sim.json"
        check_place(path)

        from kine2go_warp.deployment.metadata import read_metadata

        if self.exported is not None:
            read_metadata(self.exported)

        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.deployment.controller import ExportedPolicy
        from kine2go_warp.deployment.export import default_folder, export_policy
        from kine2go_warp.device import choose_device
        from kine2go_warp.evaluation.report import write_comparison
        from kine2go_warp.evaluation.sim2sim import sim2sim

        limit_threads()
        device = choose_device(self.device)
        folder = self.exported or default_folder(policy)
        with Progress() as progress:
            progress.stage(policy.path.resolve().name, "sim2sim")
            if self.exported is None and not folder.exists():
                export_policy(policy, folder)
            found = sim2sim(policy, ExportedPolicy.load(folder), config, device, progress.advanced)
        write_comparison(policy, config, found, device, path)
        print_comparisons(policy.path, config, found)
        say(f"{path}: all metrics with intervals and of every rollout")
        return 0


def print_comparisons(policy: Path, config: "EvalConfig", found: "Sequence[Comparison]") -> None:
    """Print two lines for each clip, and how far the simulations part."""
    from kine2go_warp.cli.tables import print_table

    title = f"{policy}: {config.worlds} rollouts of {config.seconds:g} s from the same initial states"
    print_table(results_table(title, "simulator", [result for one in found for result in (one.newton, one.mujoco)]))
    if unknown := found[0].unknown_ends:
        say(f"plain MuJoCo does not know these terminations of the training: {', '.join(unknown)}")
    for one in found:
        parts = ", ".join(f"{1e3 * distance:.2g} mm after {time:g} s" for time, distance in one.apart.items())
        say(f"{one.newton.clip}: roots apart (median): {parts}")
        print_early_ends((one.newton, one.mujoco))
