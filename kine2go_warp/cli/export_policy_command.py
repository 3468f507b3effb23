"""The command that exports a policy."""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from kine2go_warp.cli.commands import limit_threads
from kine2go_warp.cli.data import PolicyPath
from kine2go_warp.cli.texts import say


@dataclass(frozen=True)
class ExportPolicy:
    """Write a policy as ONNX and TorchScript, with all that a robot needs to know, checked against the policy.

    Example: kine2go policy export runs/policies/dog_trot
    """

    policy: PolicyPath
    """Policy folder made by 'kine2go policy train'."""
    out: Path | None = None
    """Folder to create; by default export in the policy folder."""
    overwrite: bool = False
    """Replace an older export in that folder."""

    def run(self) -> int:
        """Export and say what was written."""
        from kine2go_warp.learning.policy import PolicyFolder

        policy = PolicyFolder(self.policy)
        policy.read_record()
        limit_threads()

        from kine2go_warp.cli.tables import console
        from kine2go_warp.deployment.export import default_folder, export_policy
        from kine2go_warp.device import start_warp

        start_warp()
        out = self.out or default_folder(policy)
        output = console()
        with output.status("exporting") if output.is_terminal else nullcontext():
            metadata = export_policy(policy, out, self.overwrite)
        parity = metadata.parity
        names = ", ".join(sorted(path.name for path in out.iterdir()))
        say(
            f"{out}: {names}; largest difference from the policy {parity.onnx:.1e} (ONNX) and "
            f"{parity.torchscript:.1e} (TorchScript) on {parity.observations} observations"
        )
        return 0
