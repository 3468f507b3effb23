"""A simulated robot with a fault that begins on demand: process for tests, with the arguments of the simulated one."""

import os
import signal
import time
from collections import deque

import numpy as np

from kine2go_warp.deployment.simulated_robot import Server, main

DELAY = 0.1
"""How late messages of a delayed wire are [s]."""


class FaultyServer(Server):
    """Lives as usual until SIGUSR1; then the environment's FAULT begins, and its time is printed."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.fault, self.began = os.environ["FAULT"], None
        self.late_states, self.late_commands = deque(), deque()
        signal.signal(signal.SIGUSR1, self.begin)

    def begin(self, *_):
        self.began = time.monotonic()
        if self.fault == "tilt":
            self.robot.robot.data.qpos[3:7] = np.cos(0.65), np.sin(0.65), 0.0, 0.0
        print(f"fault {self.began}", flush=True)

    def has(self, fault):
        return self.began is not None and self.fault == fault

    def receive(self):
        command = super().receive()
        if self.has("commands dropped"):
            return None
        if self.has("commands delayed"):
            self.late_commands.append((time.monotonic(), command))
            late = self.late_commands[0][0] < time.monotonic() - DELAY
            return self.late_commands.popleft()[1] if late else None
        return command

    def intact(self, command):
        if self.has("checksum wrong"):
            command.crc ^= 1
        return super().intact(command)

    def publish(self):
        if self.has("states dropped"):
            return
        if self.has("states delayed"):
            state = self.robot.state()
            self.late_states.append((time.monotonic(), type(state).deserialize(state.serialize())))
            if self.late_states[0][0] < time.monotonic() - DELAY:
                self._states.write(self.late_states.popleft()[1])
            self._estimates.write(self.robot.estimate())
            return
        if self.has("estimate lost"):
            self._estimates = None
        super().publish()


if __name__ == "__main__":
    main(server=FaultyServer)
