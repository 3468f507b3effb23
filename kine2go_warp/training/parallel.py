"""Several processes that share the worlds of one environment: a CPU kernel of Warp's runs on one core only."""

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Semaphore
from typing import NoReturn

import torch

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.observations import observation_size, privileged_size
from kine2go_warp.env.snapshot import EnvironmentSnapshot
from kine2go_warp.errors import SimulationError
from kine2go_warp.kernels.state import NUM_JOINTS
from kine2go_warp.learning.vec_env import BufferedVecEnv, ImitationVecEnv, StepBuffers
from kine2go_warp.motions.clip import MotionClip

LONGEST_STEP = 600.0
"""A worker that is silent for longer has died [s]; its first step may compile kernels."""

PATIENCE = 5.0
"""How often an idle worker looks whether its parent still lives [s]."""

TAKE, RESTORE = "take", "restore"
"""Orders to a worker about the state of its worlds; without an order it steps them."""


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
    states: Connection
    """Orders and states of the worlds go through here."""


def work(task: WorkerTask) -> None:
    """Step some of the worlds whenever told to; runs in a process of its own until the parent ends it, or has died."""
    from kine2go_warp.device import start_warp

    # A signal to the parent's whole group must not kill the worlds before the parent has saved them.
    os.setpgid(0, 0)
    start_warp()
    torch.set_num_threads(1)
    env = ImitationVecEnv(ImitationEnvironment(task.clips, task.config, "cpu", first_world=task.first_world))
    task.buffers.copy_results(env.buffers)
    parent = multiprocessing.parent_process()
    while True:
        task.done.release()
        while not task.go.acquire(timeout=PATIENCE):
            if parent is not None and not parent.is_alive():
                return
        if task.states.poll():
            obey(task, env)
        else:
            env.buffers.action.copy_(task.buffers.action)
            env.buffers.episode_length.copy_(task.buffers.episode_length)
            env.advance()
        task.buffers.copy_results(env.buffers)


def obey(task: WorkerTask, env: ImitationVecEnv) -> None:
    """Send the state of the worlds to the parent, or put them into the state that it sends."""
    if task.states.recv() == TAKE:
        task.states.send(env.snapshot())
    else:
        env.restore(task.states.recv())


@contextlib.contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C: processes that are started meanwhile inherit this, and leave the decision to their parent."""
    earlier = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, earlier)


class ParallelVecEnv(BufferedVecEnv):
    """An environment whose worlds are simulated by several processes on one CPU.

    World for world it gives the same bits as a single process, except that where failures decide the phases at which
    episodes begin, each process learns from its own worlds.
    """

    def __init__(self, clips: Sequence[MotionClip], config: EnvConfig, processes: int) -> None:
        """Start the workers; the first share of the worlds is simulated by this process."""
        super().__init__(config, NUM_JOINTS, "cpu", shared_buffers(config))
        self.shares = [len(share) for share in torch.arange(config.num_worlds).tensor_split(processes)]
        firsts = [sum(self.shares[:index]) for index in range(processes)]
        self._faults = 0
        # First, so that its kernels are compiled once and found in the cache by the workers.
        own_config = replace(config, num_worlds=self.shares[0])
        self.own = ImitationVecEnv(ImitationEnvironment(clips, own_config, "cpu"))
        self._own_rows = self.buffers.rows(0, self.shares[0])
        self._own_rows.copy_results(self.own.buffers)
        context = multiprocessing.get_context("spawn")
        self.tasks, self.workers, self.states = [], [], []
        for first, count in zip(firsts[1:], self.shares[1:], strict=True):
            share, rows = replace(config, num_worlds=count), self.buffers.rows(first, count)
            mine, theirs = context.Pipe()
            task = WorkerTask(tuple(clips), share, first, rows, context.Semaphore(0), context.Semaphore(0), theirs)
            worker = context.Process(target=work, args=(task,), daemon=True, name=f"kine2go worlds from {first}")
            with interrupts_blocked():
                worker.start()
            # Closed here, so that reading from a worker that has died ends.
            theirs.close()
            self.tasks.append(task)
            self.workers.append(worker)
            self.states.append(mine)
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
        self.own.buffers.action.copy_(self._own_rows.action)
        self.own.buffers.episode_length.copy_(self._own_rows.episode_length)
        self.own.advance()
        self._own_rows.copy_results(self.own.buffers)
        self._wait()
        self._faults += sum(int((self.buffers.reason == fault).sum()) for fault in self.config.fault_reasons)

    def snapshot(self) -> EnvironmentSnapshot:
        """Return all that the worlds need to go on exactly.

        Raises:
            SimulationError: a worker has died.
        """
        with self._death_reported():
            for task, states in zip(self.tasks, self.states, strict=True):
                states.send(TAKE)
                task.go.release()
            parts = [self.own.snapshot(), *(states.recv() for states in self.states)]
        self._wait()
        return EnvironmentSnapshot.joined(parts)

    def restore(self, snapshot: EnvironmentSnapshot) -> None:
        """Put all worlds back to where a snapshot was taken, by however many processes.

        Raises:
            Kine2GoError: processes have learned from failures of their own, and there were more or fewer of them.
            SimulationError: a worker has died.
        """
        own, *others = snapshot.split(self.shares)
        with self._death_reported():
            for task, states, part in zip(self.tasks, self.states, others, strict=True):
                states.send(RESTORE)
                task.go.release()
                states.send(part)
        self.own.restore(own)
        self._own_rows.copy_results(self.own.buffers)
        self._wait()

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
        for index, (task, worker) in enumerate(zip(self.tasks, self.workers, strict=True)):
            waited = 0.0
            while not task.done.acquire(timeout=1.0):
                waited += 1.0
                if not worker.is_alive() or waited > LONGEST_STEP:
                    self._give_up(index)

    @contextlib.contextmanager
    def _death_reported(self) -> Iterator[None]:
        """Turn a broken pipe into an error that says which process has died."""
        try:
            yield
        except (EOFError, BrokenPipeError, ConnectionResetError):
            dead = [index for index, worker in enumerate(self.workers) if not worker.is_alive()]
            self._give_up(dead[0] if dead else 0)

    def _give_up(self, index: int) -> NoReturn:
        """End all workers and report the death of one."""
        exit_code, first_world = self.workers[index].exitcode, self.tasks[index].first_world
        self.close()
        raise SimulationError(
            f"the process of worlds {first_world} and up has died (exit code {exit_code}); "
            "run the command again, perhaps with --processes 1"
        )


def shared_buffers(config: EnvConfig) -> StepBuffers:
    """Allocate the buffers of all worlds in memory that processes share."""
    count = config.num_worlds
    buffers = StepBuffers(
        action=torch.zeros(count, NUM_JOINTS),
        observation=torch.zeros(count, observation_size(config)),
        privileged=torch.zeros(count, privileged_size(config)),
        reward=torch.zeros(count),
        reward_terms=torch.zeros(count, len(config.reward_names)),
        done=torch.zeros(count, dtype=torch.int64),
        time_out=torch.zeros(count, dtype=torch.bool),
        episode_length=torch.zeros(count, dtype=torch.int64),
        reason=torch.zeros(count, dtype=torch.int32),
    )
    for tensor in vars(buffers).values():
        tensor.share_memory_()
    return buffers
