"""Stages on a Ray cluster. Machines share nothing but the folder of the run and that of the source clips."""

import logging
import os
import socket
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from kine2go_warp.errors import PipelineError
from kine2go_warp.pipelines.job import Job
from kine2go_warp.pipelines.worker import Outcome, run_stage

# Under 'uv run' Ray would build the environment anew on every machine; here they all have it. Ray reads this once.
os.environ.setdefault("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")

CONNECT_TIME = 10.0
"""How long to wait for a cluster to answer [s]."""

HEAVY_STAGES = ("train", "gather")
"""Stages that simulate, and so want a GPU where there are any."""


class RayEngine:
    """Gives every stage to Ray as a task of its own, which runs on any machine of the cluster."""

    name = "ray"

    def __init__(self, address: str, device: str | None = None) -> None:
        """Join a cluster.

        Args:
            address: Such as ``auto`` or ``10.0.0.1:6379``.
            device: ``cpu``, or ``cuda`` for a GPU a simulation; by default ``cuda`` if the cluster has GPUs.

        Raises:
            PipelineError: Ray is not installed, or no cluster answers.
        """
        try:
            import ray
        except ImportError:
            raise PipelineError("Ray is not installed; install it with 'uv sync --extra cluster'") from None
        self._ray = ray
        check_reachable(address)
        if not ray.is_initialized():
            try:
                ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR, configure_logging=False)
            except Exception as error:  # noqa: BLE001 - Ray raises errors of many kinds
                said = " ".join(str(error).split())
                raise PipelineError(f"no Ray cluster at '{address}' ({said[:200]}); see docs/cluster.md") from None
        has_gpus = ray.cluster_resources().get("GPU", 0.0) >= 1.0
        self._gpus = 1 if (has_gpus if device is None else device.startswith("cuda")) else 0
        self.device = "cuda:0" if self._gpus else "cpu"
        self._running: dict[Any, tuple[str, str]] = {}

    def has_room(self) -> bool:
        """Return true: Ray keeps what cannot run yet, and uses machines that join later."""
        return True

    def start(self, job: Job, stage: str) -> None:
        """Hand a motion to Ray."""
        gpus = self._gpus if stage in HEAVY_STAGES else 0
        # The runner decides about another attempt, so that it is the same for all engines.
        task = self._ray.remote(num_cpus=1, num_gpus=gpus, max_retries=0)(run_on_node)
        job = replace(job, device=self.device, processes=1)
        self._running[task.options(name=f"{job.motion} {stage}").remote(job, stage)] = (job.motion, stage)

    def wait(self, seconds: float) -> Sequence[Outcome]:
        """Return what has ended, and what has died with its worker or machine."""
        if not self._running:
            return []
        ready, _ = self._ray.wait(list(self._running), num_returns=1, timeout=seconds)
        return [self._settle(reference) for reference in ready]

    def close(self) -> None:
        """Cancel what still runs, and leave the cluster."""
        for reference in self._running:
            self._ray.cancel(reference, force=True)
        self._running.clear()
        self._ray.shutdown()

    def _settle(self, reference: Any) -> Outcome:
        """Return the outcome of one task."""
        from ray.exceptions import RayError

        motion, stage = self._running.pop(reference)
        try:
            return self._ray.get(reference)
        except RayError as error:
            why = f"{error.__class__.__name__}: {' '.join(str(error).split())[:200]}"
            return Outcome(motion, stage, "died", why=why)


def check_reachable(address: str) -> None:
    """Look whether anybody listens, since Ray itself tries for minutes.

    Raises:
        PipelineError: nobody does.
    """
    host, _, port = address.rpartition(":")
    if not port.isdigit() or "/" in host:
        return
    try:
        socket.create_connection((host, int(port)), CONNECT_TIME).close()
    except OSError as error:
        said = error.strerror or str(error)
        raise PipelineError(f"no Ray cluster at '{address}' ({said}); see docs/cluster.md") from None


def run_on_node(job: Job, stage: str) -> Outcome:
    """Run a stage on whatever machine this is."""
    import torch

    torch.set_num_threads(1)
    if not job.workspace.root.is_dir():
        where = f"{os.uname().nodename} does not see {job.workspace.root}"
        return Outcome(job.motion, stage, "failed", why=f"{where}; the folder must be shared by all machines")
    return run_stage(job, stage)
