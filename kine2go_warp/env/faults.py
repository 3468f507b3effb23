"""What to do when the simulation itself fails: count it, or stop and keep the evidence."""

from pathlib import Path

import numpy as np

from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.snapshot import WorldSnapshot
from kine2go_warp.errors import SimulationError


def fault_counts(environment: ImitationEnvironment) -> dict[str, int]:
    """Return how many episodes have ended by each fault since the last restart. It waits for the device."""
    counts = environment.episodes.reason_count.numpy()
    config = environment.config
    return {config.reason_names[reason]: int(counts[reason]) for reason in config.fault_reasons}


class StrictStepper:
    """Steps an environment and stops at the first fault, with the state from which it follows saved.

    It copies the state of all worlds before every step and waits for the device after it, so it is for the search of
    faults, not for speed.
    """

    def __init__(self, environment: ImitationEnvironment, folder: Path) -> None:
        self.environment, self.folder = environment, folder

    def step(self) -> None:
        """Advance all worlds by one control step.

        Raises:
            SimulationError: a world has failed; the message names the file of its state.
        """
        before = WorldSnapshot.take(self.environment)
        self.environment.step()
        reasons = self.environment.episodes.reason.numpy()
        config = self.environment.config
        failed = np.flatnonzero(np.isin(reasons, config.fault_reasons))
        if len(failed):
            world = int(failed[0])
            path = self.folder / f"fault_world_{world}.npz"
            before.selected(np.array([world])).save(path)
            raise SimulationError(
                f"{config.reason_names[reasons[world]]} in world {world} of {len(reasons)}; the state before the step "
                f"and the output that led to it are in {path}"
            )
