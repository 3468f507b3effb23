"""Checks of what was drawn for each trajectory, of where it began, and of its contacts."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.commands import SHORTEST_SAMPLE, latency_rows
from kine2go_warp.dataset.checks.dynamics import FLOOR, PAIRS
from kine2go_warp.dataset.checks.records import RowCheck
from kine2go_warp.dataset.checks.statistics import largest, median, root_mean_square
from kine2go_warp.metrics import CONTACT_FORCE
from kine2go_warp.quantities import RANDOMIZED_PARAMETERS
from kine2go_warp.rotations import rotation_between

Array = NDArray[np.float64]
Measure = Callable[[Block], Array | None]

STARTS = {
    "joint_q": ("root_position", "root_orientation", "joint_position"),
    "joint_qd": ("root_angular_velocity", "joint_velocity"),
    "friction_anchor": ("friction_anchor",),
}
"""Arrays of the initial state and the row arrays whose first row they repeat."""


def start_error(name: str) -> Measure:
    """Return a measure of how far an array of the initial state is from the first row, shape [n]."""

    def measure(block: Block) -> Array:
        state, first = block[f"initial_state/{name}"], [block[row][:, 0] for row in STARTS[name]]
        if name == "joint_q":
            xyzw = first[1][:, [1, 2, 3, 0]]
            sign = np.where(np.sum(xyzw * state[:, 3:7], axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
            first[1] = sign * xyzw
        if name == "joint_qd":
            # The first three are the centre of mass's, the rows hold those of the base link's origin.
            state = state[:, 3:]
        return largest(np.abs(state - np.concatenate(first, axis=1)), 1)

    return measure


def final_error(position: str, velocity: str) -> Measure:
    """Return a measure of what the velocities leave unexplained of the way from the last row to the final state, [n].

    It is in parts of the trajectory's largest change of velocity, as in ``dynamics``.
    """

    def measure(block: Block) -> Array | None:
        settings = block.settings
        if settings.control_frequency is None or settings.physics_substeps is None:
            return None
        places = np.clip(block["length"].astype(int) - 1, 0, block.num_rows - 1)
        each = np.arange(block.num_trajectories)
        end = (settings.physics_substeps + 1) / (2 * settings.physics_substeps)
        before, after = block[position][each, places], block[f"final_state/{position}"]
        change = rotation_between(before, after) if position.endswith("orientation") else after - before
        velocities = block[velocity]
        expected = (1.0 - end) * velocities[each, places] + end * block[f"final_state/{velocity}"]
        yardstick = largest(np.abs(np.diff(velocities, axis=1)), 1) + FLOOR
        left = largest(np.abs(settings.control_frequency * change - expected), 1) / yardstick
        pushed = np.any(block["push"][each, places] != 0.0, axis=-1)
        return np.where(pushed & position.startswith("root"), np.nan, left)

    return measure


def reference_step_error(block: Block) -> Array | None:
    """Return how far the control steps before the first row are from those of the warm-up, shape [n]."""
    settings = block.settings
    if settings.warm_up is None or settings.control_frequency is None:
        return None
    return np.abs(block["initial_state/reference_step"] - round(settings.warm_up * settings.control_frequency))


def held_error(name: str) -> Measure:
    """Return a measure of how far a drawn parameter is from what the initial state holds, shape [n].

    Of what is added to the robot's own value the difference must be that of the other trajectories.
    """
    parameter = next(one for one in RANDOMIZED_PARAMETERS if one.name == name)

    def measure(block: Block) -> Array | None:
        settings, held = block.settings, block[f"initial_state/{parameter.state.name}"]
        drawn = block[f"randomization/{name}"]
        if name == "latency":
            if settings.physics_substeps is None or settings.control_frequency is None:
                return None
            drawn = drawn * settings.physics_substeps * settings.control_frequency
        difference = held - drawn
        if parameter.operation == "add":
            difference = difference - np.median(difference, axis=0)
        return largest(np.abs(difference), 1)

    return measure


def range_error(name: str) -> Measure:
    """Return a measure of how far a drawn parameter is outside the range of the settings, shape [n]."""
    parameter = next(one for one in RANDOMIZED_PARAMETERS if one.name == name)

    def measure(block: Block) -> Array | None:
        least, greatest, nominal = *block.settings.ranges.get(name, (0.0, 0.0)), block.settings.nominal.get(name)
        if name not in block.settings.ranges or nominal is None:
            return None
        if parameter.operation == "scale":
            least, greatest = least * nominal, greatest * nominal
        values = block[f"randomization/{name}"]
        if name == "latency" and block.settings.physics_substeps and block.settings.control_frequency:
            # Whole substeps.
            half = 0.5 / (block.settings.physics_substeps * block.settings.control_frequency)
            least, greatest = least - half, greatest + half
        return largest(np.maximum(np.maximum(least - values, values - greatest), 0.0), 1)

    return measure


STANDARD_ERRORS = 6.5
"""The spread of noise may be off by this many."""


def normal_noise(block: Block) -> Array | None:
    """Return the action noise in units of ``policy_std`` and ``noise``, NaN where there is none, [n, num_rows, 12]."""
    deviation = block.settings.policy_std
    if deviation is None or len(deviation) != block["action"].shape[-1]:
        return None
    spread = np.where(block["noise"] > 0.0, block["noise"], np.nan)[:, None, None] * np.array(deviation)
    return (block["action"] - block["action_mean"]) / spread


def spread_error(noise: Array) -> Array:
    """Return how far the spread of normal noise is from 1 in standard errors of a sample of that size, shape [n]."""
    count = (~np.isnan(noise)).sum(axis=tuple(range(1, noise.ndim)))
    errors = np.abs(root_mean_square(noise, 1) - 1.0) * np.sqrt(2.0 * count)
    return np.where(count >= SHORTEST_SAMPLE, errors, np.nan)


def noise_level_error(block: Block) -> Array | None:
    """Return how far the spread of a trajectory's action noise is from the policy's times ``noise``, shape [n]."""
    noise = normal_noise(block)
    return None if noise is None else spread_error(noise)


def policy_spread_error(block: Block) -> Array | None:
    """Return how far that of the worst joint is over all trajectories but odd ones, the same for each, shape [n]."""
    noise = normal_noise(block)
    if noise is None:
        return None
    noise = np.where((spread_error(noise) > STANDARD_ERRORS)[:, None, None], np.nan, noise)
    return np.full(block.num_trajectories, largest(spread_error(np.moveaxis(noise, -1, 0)), 0))


def applied_error(block: Block) -> Array | None:
    """Return how far ``applied_target`` is from the target of the row that the latency says [rad], shape [n, rows]."""
    settings = block.settings
    if settings.physics_substeps is None or settings.control_frequency is None:
        return None
    error = np.full(block["applied_target"].shape[:2], np.nan)
    for index, latency in enumerate(block["randomization/latency"]):
        lag = latency_rows(latency, settings.physics_substeps, settings.control_frequency)
        if lag >= block.num_rows:
            continue
        applied, target = block["applied_target"][index, lag:], block["joint_target"][index, : block.num_rows - lag]
        error[index, lag:] = largest(np.abs(applied - target), 1)
    return error


def foot_depth(block: Block) -> Array | None:
    """Return how deep the lowest point of a foot that the ground pushes usually is below flat ground [m], shape [n]."""
    if not block.settings.is_flat:
        return None
    feet = block["link_position"][..., -len(block.spec.foot_links) :, 2]
    bears = np.linalg.norm(block["foot_contact_force"], axis=-1) > CONTACT_FORCE
    return np.maximum(median(np.where(bears, block.spec.foot_radius - feet, np.nan), 1), 0.0)


def leg_contact_error(block: Block) -> Array | None:
    """Return the height of the lowest thigh or calf where it should touch flat ground, its depth elsewhere [m]."""
    if not block.settings.is_flat:
        return None
    spec, height = block.spec, block["link_position"][..., 2]
    knee, foot = height[..., 2:12:3], height[..., 12:16]
    along = np.array(spec.calf_span) / spec.legs[0].calf_length
    ends = [knee + share * (foot - knee) - spec.calf_radius for share in along]
    lowest = np.minimum(np.min(ends, axis=(0, -1)), np.min(knee, axis=-1) - spec.thigh_radius)
    return np.maximum(np.where(block["leg_contact"] > 0.0, lowest, -lowest), 0.0)


CHECKS = (
    *(
        RowCheck(
            "initial state", f"initial_state/{name}", (f"initial_state/{name}", *rows),
            "the initial state is the first row's, with the parameters that were drawn", "not the first row's: off",
            start_error(name), 1e-5,
        )
        for name, rows in STARTS.items()
    ),
    *(
        RowCheck(
            "initial state", f"initial_state/{one.state.name}",
            (f"initial_state/{one.state.name}", f"randomization/{one.name}"), "",
            f"not what randomization/{one.name} says: off", held_error(one.name),
            1e-3 if one.name == "latency" else 1e-5,
        )
        for one in RANDOMIZED_PARAMETERS
    ),
    RowCheck(
        "initial state", "initial_state/reference_step", ("initial_state/reference_step",), "",
        "not the control steps of the warm-up: off", reference_step_error, 0.0,
    ),
    RowCheck(
        "terminated", "terminated", ("terminated",),
        "accepted rollouts were truncated, not terminated", "an accepted rollout that ended early:",
        lambda block: np.abs(block["terminated"]), 0.0,
    ),
    *(
        RowCheck(
            "final state", f"final_state/{position}",
            (f"final_state/{position}", f"final_state/{velocity}", position, velocity, "length", "push"),
            "the state after the last row is where its velocities lead", "not where the last row's velocity leads: off",
            final_error(position, velocity), 0.8, "of its own largest change",
        )
        for position, velocity in PAIRS[:3]
    ),
    *(
        RowCheck(
            "drawn parameters", f"randomization/{one.name}", (f"randomization/{one.name}",),
            "drawn parameters are within the ranges of the settings, others at their nominal values",
            "outside the range of the settings", range_error(one.name), 1e-5, one.unit,
        )
        for one in RANDOMIZED_PARAMETERS
    ),
    RowCheck(
        "noise level", "noise", ("noise", "action", "action_mean"),
        "action noise spreads as policy_std times noise say, in each trajectory and, over all, in each joint",
        "the spread of the action noise is off", noise_level_error, STANDARD_ERRORS, "standard errors",
    ),
    RowCheck(
        "noise level", "action", ("noise", "action", "action_mean"), "",
        "a joint's action noise does not spread as policy_std says: off", policy_spread_error, STANDARD_ERRORS,
        "standard errors",
    ),
    RowCheck(
        "applied target", "applied_target", ("applied_target", "joint_target", "randomization/latency"),
        "applied_target is joint_target of the row that the latency says", "not the target in force: off",
        applied_error, 1e-6, "rad",
    ),
    RowCheck(
        "foot depth", "link_position", ("link_position", "foot_contact_force"),
        "feet that the ground pushes are usually hardly below it (flat ground)", "feet are usually in the ground",
        foot_depth, 0.01, "m",
    ),
    RowCheck(
        "leg contact", "leg_contact", ("leg_contact", "link_position"),
        "a thigh or calf is at the ground in rows with `leg_contact` and in no others (flat ground)",
        "not where thighs and calves touch the ground: off", leg_contact_error, 0.01, "m",
    ),
)  # fmt: skip
"""All of them."""
