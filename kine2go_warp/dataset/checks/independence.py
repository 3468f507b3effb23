"""Whether trajectories were drawn one by one: no rows, seeds or action noise twice in a dataset."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.commands import fresh_noise
from kine2go_warp.dataset.checks.records import Check, Finding

UNTURNED = ("joint_position", "joint_velocity", "action")
"""Row arrays that do not change when a trajectory is turned or moved."""

NOISE_ROWS = 64
"""Rows of action noise that are compared."""
FEWEST_ROWS = 20
"""Of fewer rows the noise says too little."""
CORRELATION = 0.5
"""Independent noise of ``FEWEST_ROWS`` rows of 12 joints correlates by 0.065 in the root mean square."""

DUPLICATES = Check(
    "duplicates",
    "no two trajectories of the dataset have the same joints and actions, however they are turned",
    "exact",
)
DRAWS = Check(
    "independent draws", "no two trajectories of the dataset have one seed, nor action noise that correlates",
    f"exact, {CORRELATION:g}",
)  # fmt: skip


@dataclass
class Independence:
    """What was seen of the trajectories so far, of all motions."""

    rows: dict[bytes, str] = field(default_factory=dict)
    """What holds the trajectory of that digest."""
    seeds: dict[int, str] = field(default_factory=dict)
    """What holds the trajectory of that seed."""
    noise: list[NDArray[np.float32]] = field(default_factory=list)
    """Action noise of each trajectory, of length 1, shapes [NOISE_ROWS * num_joints]."""
    noisy: list[str] = field(default_factory=list)
    """Whose it is."""

    def duplicates(self, motion: str, block: Block) -> Iterator[Finding]:
        """Yield the trajectories whose rows an earlier one has, too."""
        names = [name for name in UNTURNED if name in block]
        for number, name in trajectories(motion, block) if names else ():
            digest = hashlib.sha256()
            for array in names:
                digest.update(np.ascontiguousarray(block.stored[array][number], dtype=np.float32).tobytes())
            earlier = self.rows.setdefault(digest.digest(), name)
            if earlier != name:
                yield Finding(
                    DUPLICATES.name, motion, f"has the same rows as {earlier}", trajectory=block.first + number
                )

    def draws(self, motion: str, block: Block) -> Iterator[Finding]:
        """Yield the trajectories whose seed or action noise an earlier one has, too."""
        for number, name in trajectories(motion, block) if "seed" in block else ():
            earlier = self.seeds.setdefault(int(block["seed"][number]), name)
            if earlier != name:
                yield Finding(DRAWS.name, motion, f"has the seed of {earlier}", "seed", block.first + number)
        for number, noise in noise_of(block):
            likeness = np.abs(np.stack(self.noise) @ noise) if self.noise else np.zeros(1)
            place = int(np.argmax(likeness))
            if likeness[place] > CORRELATION:
                what = f"its action noise is that of {self.noisy[place]}: correlation"
                found = (float(likeness[place]), CORRELATION)
                yield Finding(DRAWS.name, motion, f"{what}:", "action", block.first + number, None, *found)
            self.noise.append(noise)
            self.noisy.append(f"trajectory {block.first + number} of {motion}")


def trajectories(motion: str, block: Block) -> Iterator[tuple[int, str]]:
    """Yield the place of each trajectory in a block, and what it is called."""
    for number in range(block.num_trajectories):
        yield number, f"trajectory {block.first + number} of {motion}"


def noise_of(block: Block) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Yield the place of each trajectory in a block whose actions are noisy, and its first noise, of length 1."""
    if any(name not in block for name in ("action", "action_mean", "noise_time")):
        return
    noise = np.nan_to_num(fresh_noise(block)[:, :NOISE_ROWS])
    for number, one in enumerate(noise):
        size = float(np.linalg.norm(one))
        if (one != 0.0).any(axis=-1).sum() >= FEWEST_ROWS and np.isfinite(size):
            whole = np.zeros((NOISE_ROWS, one.shape[1]), dtype=np.float32)
            whole[: len(one)] = one / size
            yield number, whole.ravel()
