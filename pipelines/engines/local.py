"""Worker processes of this machine: one a GPU, or several that share the cores."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from kine2go_warp.pipelines.job import Job
from kine2go_warp.pipelines.worker import Outcome, run_stage

MEMORY_A_WORKER = 2.0
"""Memory that a worker may need [GB]."""


PATIENCE = 10.0
"""How long an idle worker may take to end [s]."""


@dataclass
class Worker:
    """One worker process, seen from the process that runs the recipe."""

    number: int
    process: BaseProcess
    connection: Connection
    lifeline: Connection
    """Closes when this process ends, however it does; then the worker ends, too."""
    job: Job | None = None
    stage: str = ""


class LocalEngine:
    """A pool of processes that live until the run ends. A worker that dies is replaced."""

    name = "local"

    def __init__(self, num_workers: int, device: str, log_folder: Path) -> None:
        """Prepare; workers start when they are first needed.

        Args:
            num_workers: Stages run at once.
            device: ``cpu``, or the first of the GPUs, which the workers share among them in turn.
            log_folder: For what workers print.
        """
        # Each worker sees one GPU, which is its first.
        self.device = "cpu" if device == "cpu" else "cuda:0"
        self._first_gpu = int(device.partition(":")[2] or 0)
        self._log_folder = log_folder
        self._processes = max(1, len(os.sched_getaffinity(0)) // num_workers) if device == "cpu" else 1
        self._context = multiprocessing.get_context("spawn")
        self._workers: list[Worker | None] = [None] * num_workers

    def worker_of(self, motion: str) -> Worker | None:
        """Return the worker that works on a motion, if one does."""
        busy = (one for one in self._workers if one is not None and one.job is not None)
        return next((one for one in busy if one.job is not None and one.job.motion == motion), None)

    def has_room(self) -> bool:
        """Return whether a worker has nothing to do."""
        return any(one is None or one.job is None for one in self._workers)

    def start(self, job: Job, stage: str) -> None:
        """Give a motion to an idle worker."""
        number = next(number for number, one in enumerate(self._workers) if one is None or one.job is None)
        worker = self._workers[number] or self._spawn(number)
        self._workers[number] = worker
        worker.job, worker.stage = replace(job, device=self.device, processes=self._processes), stage
        try:
            worker.connection.send((worker.job, stage))
        except OSError:
            # It died while idle; ``wait`` finds out.
            return

    def wait(self, seconds: float) -> Sequence[Outcome]:
        """Return what has ended, and what has died with its worker."""
        busy = [one for one in self._workers if one is not None and one.job is not None]
        ready = wait([one.connection for one in busy], seconds) if busy else []
        return [self._settle(one) for one in busy if one.connection in ready]

    def close(self) -> None:
        """Let idle workers end and kill the others; unfinished artefacts stay as after any kill."""
        for worker in self._workers:
            if worker is not None and worker.job is None:
                # It ends by itself and gives back what it holds, such as semaphores, which a kill would leave behind.
                worker.connection.close()
                worker.process.join(PATIENCE)
        for worker in self._workers:
            if worker is not None:
                self._end(worker)
        self._workers = [None] * len(self._workers)

    def _settle(self, worker: Worker) -> Outcome:
        """Take the outcome from a worker, or bury it."""
        job = worker.job
        assert job is not None
        try:
            outcome = worker.connection.recv()
            worker.job = None
        except (EOFError, OSError):
            self._end(worker)
            self._workers[worker.number] = None
            ended = worker.process.exitcode
            why = f"signal {-ended}" if ended is not None and ended < 0 else f"exit status {ended}"
            return Outcome(job.motion, worker.stage, "died", why=f"worker {worker.number} died ({why})")
        return outcome

    def _spawn(self, number: int) -> Worker:
        """Start a worker."""
        ours, theirs = self._context.Pipe()
        their_lifeline, our_lifeline = self._context.Pipe(duplex=False)
        self._log_folder.mkdir(parents=True, exist_ok=True)
        gpu = None if self.device == "cpu" else visible_gpu(self._first_gpu + number, num_gpus())
        arguments = (theirs, their_lifeline, gpu, self._log_folder / f"worker-{number}.log")
        process = self._context.Process(target=serve, args=arguments, name=f"kine2go worker {number}")
        process.start()
        theirs.close()
        their_lifeline.close()
        return Worker(number, process, ours, our_lifeline)

    def _end(self, worker: Worker) -> None:
        """Kill a worker if it lives, and give back what it held."""
        worker.process.kill()
        worker.process.join()
        worker.connection.close()
        worker.lifeline.close()


def serve(connection: Connection, lifeline: Connection, gpu: str | None, log: Path) -> None:
    """Run stages until the other end closes; runs in a process of its own."""
    # Ctrl-C reaches every process of the terminal; the one that runs the recipe decides what to do.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=die_with, args=(lifeline,), daemon=True).start()
    redirect_output(log)
    if gpu is not None:
        os.environ["CUDA_VISIBLE_DEVICES"] = gpu
    import torch

    torch.set_num_threads(1)
    while True:
        try:
            job, stage = connection.recv()
        except (EOFError, OSError):
            return
        connection.send(run_stage(job, stage))


def die_with(lifeline: Connection) -> None:
    """End this process when the other end of a pipe closes."""
    try:
        lifeline.recv()
    except (EOFError, OSError):
        os._exit(1)


def redirect_output(log: Path) -> None:
    """Let everything that this process prints, compiled code included, go to a file."""
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    for standard in (1, 2):
        os.dup2(descriptor, standard)
    os.close(descriptor)


def visible_gpu(number: int, count: int) -> str:
    """Return the name of one of the GPUs that this process may use, as ``CUDA_VISIBLE_DEVICES`` has it.

    Args:
        number: Of the worker; beyond the last GPU it begins with the first again.
        count: How many GPUs this process sees.
    """
    visible = os.environ.get("CUDA_VISIBLE_DEVICES")
    names = [name.strip() for name in visible.split(",") if name.strip()] if visible else []
    return (names[:count] or [str(gpu) for gpu in range(count)])[number % count]


def num_gpus() -> int:
    """Return how many GPUs this process sees."""
    import warp as wp

    return len(wp.get_cuda_devices())


def default_workers(num_motions: int, device: str) -> int:
    """Return how many stages to run at once: one a GPU, or one a core as far as the memory goes."""
    if device != "cpu":
        return max(1, min(num_motions, num_gpus()))
    return max(1, min(num_motions, len(os.sched_getaffinity(0)), int(available_memory() // MEMORY_A_WORKER)))


def available_memory() -> float:
    """Return the memory that can be used [GB]; 16 where the system does not tell."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("MemAvailable")).split()[1]) / 1e6
    except (OSError, StopIteration, ValueError):
        return 16.0
