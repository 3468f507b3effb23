"""Several processes that share the worlds of one environment: a CPU kernel of Warp's runs on one core only."""

import multiprocessing
import signal
from collections.abc import Sequence
from dataclasses import dataclass, replace
from multiprocessing.synchronize import Semaphore

import torch

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.faults import FAULTS
from kine2go_warp.env.motors import NUM_JOINTS
from kine2go_warp.env.observations import observation_size
from kine2go_warp.errors import SimulationError
from kine2go_warp.kernels.observations import PRIVILEGED_SIZE
from kine2go_warp.kernels.rewards import REWARD_TERMS
from kine2go_warp.learning.vec_env import BufferedVecEnv, ImitationVecEnv, StepBuffers
from kine2go_warp.motions.clip import MotionClip

LONGEST_STEP = 600.0
"""A worker that is silent for longer has died [s]; its first step may compile kernels."""


@dataclass(frozen=True)
class WorkerTask:
    """What a worker process needs."""

    clips: tuple[MotionClip, ...]
    config: EnvConfig
    """Of the worker's own worlds."""
    first_world: int
    buffers: StepBuffers
    """Of the worker's own worlds, in shared memory."""
    go: Semaphore
    done: Semaphore


def work(task: WorkerTask) -> None:
    """Step some of the worlds whenever told to; runs in a process of its own until the parent ends it."""
    from kine2go_warp.device import start_warp

    # An interrupt from the keyboard reaches every process; the parent decides what to do.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    start_warp()
    torch.set_num_threads(1)
    env = ImitationVecEnv(ImitationEnvironment(task.clips, task.config, "cpu", first_world=task.first_world))
    task.buffers.copy_results(env.buffers)
    while True:
        task.done.release()
        task.go.acquire()
        env.buffers.output.copy_(task.buffers.output)
        env.buffers.episode_length.copy_(task.buffers.episode_length)
        env.advance()
        task.buffers.copy_results(env.buffers)


class ParallelVecEnv(BufferedVecEnv):
    """An environment whose worlds are simulated by several processes on one CPU.

    World for world it gives the same bits as a single process, except that where failures decide the phases at which
    episodes begin, each process learns from its own worlds.
    """

    def __init__(self, clips: Sequence[MotionClip], config: EnvConfig, processes: int) -> None:
        """Start the workers; the first share of the worlds is simulated by this process."""
        super().__init__(config, NUM_JOINTS, "cpu", shared_buffers(config))
        shares = [len(share) for share in torch.arange(config.num_worlds).tensor_split(processes)]
        firsts = [sum(shares[:index]) for index in range(processes)]
        self._faults = 0
        # First, so that its kernels are compiled once and found in the cache by the workers.
        self.own = ImitationVecEnv(ImitationEnvironment(clips, replace(config, num_worlds=shares[0]), "cpu"))
        self._own_rows = self.buffers.rows(0, shares[0])
        self._own_rows.copy_results(self.own.buffers)
        context = multiprocessing.get_context("spawn")
        self.tasks, self.workers = [], []
        for first, count in zip(firsts[1:], shares[1:], strict=True):
            share = replace(config, num_worlds=count)
            rows = self.buffers.rows(first, count)
            task = WorkerTask(tuple(clips), share, first, rows, context.Semaphore(0), context.Semaphore(0))
            worker = context.Process(target=work, args=(task,), daemon=True, name=f"kine2go worlds from {first}")
            worker.start()
            self.tasks.append(task)
            self.workers.append(worker)
        self._wait()

    @property
    def environment(self) -> ImitationEnvironment:
        """The first worlds."""
        return self.own.environment

    def advance(self) -> None:
        """Step all worlds at once.

        Raises:
            SimulationError: a worker has died.
        """
        for task in self.tasks:
            task.go.release()
        self.own.buffers.output.copy_(self._own_rows.output)
        self.own.buffers.episode_length.copy_(self._own_rows.episode_length)
        self.own.advance()
        self._own_rows.copy_results(self.own.buffers)
        self._wait()
        reasons = self.buffers.reason
        self._faults += int(((reasons == FAULTS[0]) | (reasons == FAULTS[1])).sum())

    def fault_count(self) -> int:
        """Return how many worlds the simulation itself has failed so far."""
        return self._faults

    def close(self) -> None:
        """End the workers."""
        for worker in self.workers:
            worker.terminate()
            worker.join()

    def _wait(self) -> None:
        """Wait for all workers."""
        for task, worker in zip(self.tasks, self.workers, strict=True):
            waited = 0.0
            while not task.done.acquire(timeout=1.0):
                waited += 1.0
                if not worker.is_alive() or waited > LONGEST_STEP:
                    self.close()
                    raise SimulationError(
                        f"the process of worlds {task.first_world} and up has died (exit code {worker.exitcode}); "
                        "run the command again, perhaps with --processes 1"
                    )


def shared_buffers(config: EnvConfig) -> StepBuffers:
    """Allocate the buffers of all worlds in memory that processes share."""
    count, privileged_size = config.num_worlds, int(PRIVILEGED_SIZE) if config.privileged else 0
    buffers = StepBuffers(
        output=torch.zeros(count, NUM_JOINTS),
        observation=torch.zeros(count, observation_size(config)),
        privileged=torch.zeros(count, privileged_size),
        reward=torch.zeros(count),
        reward_terms=torch.zeros(count, len(REWARD_TERMS)),
        done=torch.zeros(count, dtype=torch.int64),
        time_out=torch.zeros(count, dtype=torch.bool),
        episode_length=torch.zeros(count, dtype=torch.int64),
        reason=torch.zeros(count, dtype=torch.int32),
    )
    for tensor in vars(buffers).values():
        tensor.share_memory_()
    return buffers
