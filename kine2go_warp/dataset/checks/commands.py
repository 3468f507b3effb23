"""Checks of actions, targets and torques against one another and against the motors' law."""

import math
import re

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.records import RowCheck
from kine2go_warp.dataset.checks.statistics import largest, mean, median, root_mean_square

Array = NDArray[np.float64]

SHORTEST_SAMPLE = 20
"""Rows below which a mean of noise says nothing."""


def action_error(block: Block) -> Array:
    """Return the farthest that an action is from its joint target in units of the action scale, shape [n, num_rows]."""
    expected = (block["joint_target"] - np.array(block.spec.default_joint_position)) / block.spec.action_scale
    return largest(np.abs(block["action"] - expected), 2)


def noise_mean(block: Block) -> Array | None:
    """Return the largest mean of an action's noise, in standard errors, shape [n].

    Without noise, actions and their means must be equal; their distance is returned in thousandths then.
    """
    if "noise" not in block:
        return None
    noise = np.moveaxis(block["action"] - block["action_mean"], -1, 1)
    rows = (~np.isnan(noise)).sum(axis=-1)
    centre = mean(noise, 2)
    spread = root_mean_square(noise - centre[..., None], 2)
    errors = np.abs(centre) * np.sqrt(rows) / np.maximum(spread, 1e-9)
    scatter = largest(np.where(rows >= SHORTEST_SAMPLE, errors, np.nan), 1)
    is_quiet = block["noise"] == 0.0
    return np.where(is_quiet, 1e3 * largest(largest(np.abs(noise), 2), 1), scatter)


def mean_misplaced(block: Block) -> Array:
    """Return how much closer actions are to the means of a neighbouring row than to those of their own, shape [n]."""
    action, centre = block["action"], block["action_mean"]
    inner = action[:, 1:-1]
    own = root_mean_square(inner - centre[:, 1:-1], 1)
    others = (root_mean_square(inner - centre[:, shift : shift + inner.shape[1]], 1) for shift in (0, 2))
    closest = np.minimum(*others)
    rows = (~np.isnan(inner[..., 0])).sum(axis=-1)
    return np.where(rows >= SHORTEST_SAMPLE, own / np.maximum(closest, 1e-9) - 1.0, np.nan)


def beyond_effort(block: Block) -> Array:
    """Return by how much a torque is more than the motors can give at any speed [N m], shape [n, num_rows]."""
    limits = block.motor_limits
    return np.maximum(largest(np.abs(block["joint_torque"]) - np.maximum(limits.driving, limits.braking), 2), 0.0)


def peak_beyond_effort(block: Block) -> Array:
    """Return the same for the largest torque of a row's substeps [N m], shape [n, num_rows]."""
    most = np.maximum(block.motor_limits.driving, block.motor_limits.braking)
    return np.maximum(largest(block["joint_torque_peak"] - most, 2), 0.0)


def beyond_line(block: Block) -> Array:
    """Return by how much a torque is more than the motors can give at the joint's speed [N m], shape [n, num_rows].

    The torque belongs to the velocity at the beginning of the last substep, which lies between those of the row before
    and of its own: the one of these at which a motor gives most is taken. Impacts leave that range within a row, as
    far as the tolerance allows. Of the first row nothing is known.
    """
    torque, velocity = block["joint_torque"], block["joint_velocity"]
    before = np.concatenate([np.full_like(velocity[:, :1], np.nan), velocity[:, :-1]], axis=1)
    slowest = np.where(before * velocity < 0.0, 0.0, np.sign(velocity) * np.minimum(np.abs(before), np.abs(velocity)))
    available = [block.motor_limits.available(torque, speed) for speed in (before, velocity, slowest)]
    return np.maximum(largest(np.abs(torque) - np.max(available, axis=0), 2), 0.0)


def beyond_speed(block: Block) -> Array:
    """Return by how much a joint is faster than its motor can turn it [rad/s], shape [n, num_rows]."""
    return np.maximum(largest(np.abs(block["joint_velocity"]) - np.array(block.spec.joint_speed), 2), 0.0)


def latency_rows(latency: float, substeps: int, frequency: float) -> int:
    """Return how many rows before a state the action was chosen that ruled the last physics substep before it."""
    delay = round(latency * substeps * frequency)
    return 1 + max(0, math.ceil((delay - (substeps - 1)) / substeps))


def torque_error(block: Block) -> Array | None:
    """Return how far torques usually are from the motors' law, in parts of the usual torque, shape [n].

    The torque of row t is that of the substep which ended in state t, so its joint positions are known to have been one
    substep's way back; its joint velocities are taken as those at its end.
    """
    settings = block.settings
    if settings.physics_substeps is None or settings.control_frequency is None:
        return None
    substeps, frequency = settings.physics_substeps, settings.control_frequency
    lags = np.array([latency_rows(latency, substeps, frequency) for latency in block["randomization/latency"]])
    error = np.full(block.num_trajectories, np.nan)
    for lag in np.unique(lags[lags < block.num_rows]):
        chosen = np.flatnonzero(lags == lag)
        error[chosen] = motor_error(block.selected(chosen), int(lag), 1.0 / (substeps * frequency))
    return error


MOTOR = ("stiffness", "damping", "strength", "motor_offset", "latency")
"""What the motors' law takes, of each trajectory."""


def motor_error(block: Block, lag: int, substep: float) -> Array:
    """Return the same for trajectories with one latency, given in rows."""
    stiffness, damping, strength, offset = (block[f"randomization/{name}"][:, None] for name in MOTOR[:4])
    velocity = block["joint_velocity"][:, lag:]
    position = block["joint_position"][:, lag:] - velocity * substep
    target = block["joint_target"][:, : block.num_rows - lag] + offset
    demand = strength * (stiffness * (target - position) - damping * velocity)
    limit = block.motor_limits.available(demand, velocity)
    expected = np.clip(demand, -limit, limit)
    torque = block["joint_torque"][:, lag:]
    return median(np.abs(torque - expected), 1) / (median(np.abs(torque), 1) + 0.1)


def observation_error(block: Block) -> Array:
    """Return how far observations are from the rows and from one another, shape [n, num_rows].

    Joints now, and the reference's in coming rows, are the rows'; what was seen now is seen again in the history
    of later rows.
    """
    observed, default = block["observation"], np.array(block.spec.default_joint_position)
    names = {name: place for place, name in enumerate(block.settings.observed)}
    rows = {
        "joint_position": block["joint_position"] - default,
        "joint_velocity": block["joint_velocity"],
        "reference_joint_position": block["reference_joint_position"] - default,
    }
    error = np.zeros(observed.shape[:2])
    for name, place in names.items():
        match = OBSERVED.fullmatch(name)
        if match is None:
            continue
        term, offset, part = match[1], int(match[2] or 0), match[3]
        if term in rows and part in block.spec.joint_names and (offset == 0 or term.startswith("reference")):
            expected, ahead = rows[term][..., block.spec.joint_names.index(part)], offset
        elif offset < 0 and f"{term}[t].{part}" in names:
            expected, ahead = observed[..., names[f"{term}[t].{part}"]], offset
        else:
            continue
        expected = np.roll(expected, -ahead, axis=1)
        expected[:, slice(-ahead, None) if ahead > 0 else slice(0, -ahead)] = np.nan
        error = np.fmax(error, np.abs(observed[..., place] - expected))
    return np.where(block.beyond, np.nan, error)


OBSERVED = re.compile(r"(\w+)\[t([+-]\d+)?\]\.(\w+)")
"""Name of a column of an observation: the term, the control steps from now, and the joint, foot or axis."""

CHECKS = (
    RowCheck(
        "action", "action", ("action", "joint_target"),
        "action is (joint_target - default pose) / action scale", "not its joint target in units of the scale: off",
        action_error, 1e-4,
    ),
    RowCheck(
        "action noise", "action_mean", ("action", "action_mean"),
        "actions scatter evenly about action_mean", "the actions' mean is off", noise_mean, 6.5, "standard errors",
    ),
    RowCheck(
        "action mean's row", "action_mean", ("action", "action_mean"),
        "actions are closest to action_mean of their own row", "the actions belong to a neighbouring row's: closer",
        mean_misplaced, 0.1, "of the distance",
    ),
    RowCheck(
        "observation", "observation", ("observation", "joint_position", "joint_velocity", "reference_joint_position"),
        "what is observed is what the rows say of joints and reference, and what earlier rows observed",
        "not what the rows say: off", observation_error, 1e-4,
    ),
    RowCheck(
        "torque limits", "joint_torque", ("joint_torque",),
        "torques keep within what the motors can give, at any speed and at the joint's",
        "beyond the motors' largest torque", beyond_effort, 1e-3, "N m",
    ),
    RowCheck(
        "torque limits", "joint_torque_peak", ("joint_torque_peak",), "",
        "beyond the motors' largest torque", peak_beyond_effort, 1e-3, "N m",
    ),
    RowCheck(
        "torque limits", "joint_torque", ("joint_torque", "joint_velocity"), "",
        "beyond the motors' torque at the joint's speed", beyond_line, 5.0, "N m",
    ),
    RowCheck(
        "joint speed", "joint_velocity", ("joint_velocity",),
        "joints are no faster than their motors", "faster than the motor can turn it", beyond_speed, 0.01, "rad/s",
    ),
    RowCheck(
        "motor law", "joint_torque",
        ("joint_torque", "joint_target", "joint_position", "joint_velocity",
         *(f"randomization/{name}" for name in MOTOR)),
        "torques are stiffness * (target - position) - damping * velocity, the target as old as the latency says",
        "usually not what targets, joints and gains give: off", torque_error, 0.5, "of the usual torque",
    ),
)  # fmt: skip
"""All of them."""
