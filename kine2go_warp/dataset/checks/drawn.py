"""Checks of what was drawn for each trajectory, of where it began, and of what its motors and feet bore."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.commands import SHORTEST_SAMPLE, latency_rows
from kine2go_warp.dataset.checks.dynamics import FLOOR, PAIRS
from kine2go_warp.dataset.checks.kinematics import CLEARANCE, GRAVITY, SHORTEST_WEIGHING
from kine2go_warp.dataset.checks.records import RowCheck
from kine2go_warp.dataset.checks.statistics import largest, mean, median, root_mean_square
from kine2go_warp.metrics import CONTACT_FORCE
from kine2go_warp.quantities import RANDOMIZED_PARAMETERS

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
        change = block[f"final_state/{position}"] - block[position][each, places]
        velocities = block[velocity]
        expected = (1.0 - end) * velocities[each, places] + end * block[f"final_state/{velocity}"]
        yardstick = largest(np.abs(np.diff(velocities, axis=1)), 1) + FLOOR
        left = largest(np.abs(settings.control_frequency * change - expected), 1) / yardstick
        pushed = np.any(block["push"][each, places] != 0.0, axis=-1)
        return np.where(pushed & position.startswith("root"), np.nan, left)

    return measure


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


def noise_level_error(block: Block) -> Array | None:
    """Return how far the spread of a trajectory's action noise is from the policy's times ``noise``, in parts of it."""
    deviation = block.settings.policy_std
    if deviation is None or len(deviation) != block["action"].shape[-1]:
        return None
    noise = (block["action"] - block["action_mean"]) / np.array(deviation)
    rows = (~np.isnan(noise[..., 0])).sum(axis=-1)
    level = root_mean_square(noise, 1) / block["noise"]
    return np.where((rows >= SHORTEST_SAMPLE) & (block["noise"] > 0.0), np.abs(level - 1.0), np.nan)


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


def beyond_peak(name: str) -> Measure:
    """Return a measure of how much a last or mean value exceeds the largest of its row, in parts of it."""

    def measure(block: Block) -> Array:
        values, peak = block[name], block[f"{name.removesuffix('_mean')}_peak"]
        size = np.linalg.norm(values, axis=-1) if values.ndim > peak.ndim else np.abs(values)
        return np.maximum(largest((size - peak) / (peak + 1.0), 2), 0.0)

    return measure


def stands(block: Block) -> Array:
    """Return which trajectories are long enough to be weighed and touch the ground with feet alone."""
    rows = (~np.isnan(block["leg_contact"])).sum(axis=-1)
    return (rows >= SHORTEST_WEIGHING) & (mean(block["leg_contact"], 1) == 0.0)


def mean_weight_error(block: Block) -> Array:
    """Return how far the mean force on the feet is from what weight and rise of the base ask for, in weights, [n]."""
    velocity, frequency = block["root_linear_velocity"][..., 2], block.settings.control_frequency or np.nan
    rows = (~np.isnan(velocity)).sum(axis=-1)
    last = np.take_along_axis(velocity, np.maximum(rows - 1, 0)[:, None], axis=1)[:, 0]
    rise = (last - velocity[:, 0]) * frequency / np.maximum(rows - 1, 1)
    weight = (block.spec.mass + block["randomization/base_mass"]) * GRAVITY
    force = mean(block["foot_contact_force_mean"][:, 1:, :, 2].sum(axis=-1), 1)
    return np.where(stands(block), np.abs(force / weight - 1.0 - rise / GRAVITY), np.nan)


def last_force_error(block: Block) -> Array:
    """Return how far last substeps' forces are from the means on average, in parts of it, shape [n]."""
    last, whole = (mean(block[name][..., 2].sum(axis=-1), 1) for name in FORCES)
    return np.where(stands(block), np.abs(last / whole - 1.0), np.nan)


def foot_depth(block: Block) -> Array | None:
    """Return how deep the lowest point of a foot that the ground pushes usually is below flat ground [m], shape [n]."""
    if not block.settings.is_flat:
        return None
    feet = block["link_position"][..., -len(block.spec.foot_links) :, 2]
    bears = np.linalg.norm(block["foot_contact_force"], axis=-1) > CONTACT_FORCE
    return np.maximum(median(np.where(bears, block.spec.foot_radius - feet, np.nan), 1), 0.0)


def leg_in_the_air(block: Block) -> Array | None:
    """Return the height of the lowest thigh or calf in rows with ``leg_contact`` on flat ground [m], [n, num_rows]."""
    if not block.settings.is_flat:
        return None
    spec, height = block.spec, block["link_position"][..., 2]
    knee, foot = height[..., 2:12:3], height[..., 12:16]
    along = np.array(spec.calf_span) / spec.legs[0].calf_length
    ends = [knee + share * (foot - knee) - spec.calf_radius for share in along]
    lowest = np.minimum(np.min(ends, axis=(0, -1)), np.min(knee, axis=-1) - spec.thigh_radius)
    return np.where(block["leg_contact"] > 0.0, np.maximum(lowest - CLEARANCE, 0.0), 0.0)


FORCES = ("foot_contact_force", "foot_contact_force_mean")

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
    *(
        RowCheck(
            "final state", f"final_state/{position}",
            (f"final_state/{position}", f"final_state/{velocity}", position, velocity, "length", "push"),
            "the state after the last row is where its velocities lead", "not where the last row's velocity leads: off",
            final_error(position, velocity), 0.8, "of its own largest change",
        )
        for position, velocity in (PAIRS[0], PAIRS[2])
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
        "action noise spreads as policy_std times noise say", "the spread of the action noise is off",
        noise_level_error, 0.25, "of itself",
    ),
    RowCheck(
        "applied target", "applied_target", ("applied_target", "joint_target", "randomization/latency"),
        "applied_target is joint_target of the row that the latency says", "not the target in force: off",
        applied_error, 1e-6, "rad",
    ),
    *(
        RowCheck(
            "peaks", name, (name, f"{name.removesuffix('_mean')}_peak"),
            "no torque, power or force, of the last substep or in the mean, exceeds the row's peak", "beyond the peak",
            beyond_peak(name), 1e-3, "of 1 + the peak",
        )
        for name in ("joint_torque", "joint_torque_mean", "joint_power_mean", "foot_contact_force")
    ),
    RowCheck(
        "mean force", "foot_contact_force_mean",
        ("foot_contact_force_mean", "leg_contact", "root_linear_velocity", "randomization/base_mass"),
        f"the floor carries the weight that was drawn, over {SHORTEST_WEIGHING} rows or more on the feet alone",
        "the mean force is off", mean_weight_error, 0.02, "of the weight",
    ),
    RowCheck(
        "mean force", "foot_contact_force", (*FORCES, "leg_contact"), "", "on average not the rows' means: off",
        last_force_error, 0.1, "of them",
    ),
    RowCheck(
        "foot depth", "link_position", ("link_position", "foot_contact_force"),
        "feet that the ground pushes are usually hardly below it (flat ground)", "feet are usually in the ground",
        foot_depth, 0.01, "m",
    ),
    RowCheck(
        "leg contact", "leg_contact", ("leg_contact", "link_position"),
        "in rows with `leg_contact`, a thigh or calf is near the ground (flat ground)",
        "thighs and calves are above the ground", leg_in_the_air, 0.005, "m",
    ),
)  # fmt: skip
"""All of them."""
