"""Every metric that a dataset is scored by: name, unit, meaning, and how it is computed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp import metrics
from kine2go_warp.dataset.motion import MotionData
from kine2go_warp.metrics import FOOT_LINKS, Metric
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.kinematics import contact_velocities
from kine2go_warp.scores import transport
from kine2go_warp.tables import Cell, make_table, markdown


@dataclass(frozen=True)
class Rollouts:
    """What metrics are computed from."""

    rows: Mapping[str, NDArray[Any]]
    """Row arrays of the dataset, each of shape [num_trajectories, num_rows, ...], NaN beyond a trajectory's end."""
    length: NDArray[Any]
    """Rows of each trajectory, shape [num_trajectories]."""
    frame_duration: float
    """[s]"""
    accepted: int
    """Rollouts that are in the dataset."""
    rejected: int
    """Rollouts that were run and are not."""
    spec: RobotSpec
    """The robot."""

    @classmethod
    def of(cls, data: MotionData, spec: RobotSpec) -> "Rollouts":
        """Take them from a motion of a dataset."""
        length = data.trajectories.draws["length"]
        return cls(
            rows=data.trajectories.rows,
            length=length,
            frame_duration=data.frame_duration,
            accepted=int(data.attributes.get("accepted", len(length))),
            rejected=sum(data.attributes.get("rejected", {}).values()),
            spec=spec,
        )


@dataclass(frozen=True, kw_only=True)
class ScoredMetric(Metric):
    """A metric that a dataset is scored by."""

    compute: Callable[[Rollouts], NDArray[Any]]
    """Returns one metric a trajectory; of a share, whether it happened to each rollout."""


def stored(name: str, compute: Callable[[Rollouts], NDArray[Any]]) -> ScoredMetric:
    """Return a metric that the dataset stores, too, and how it is computed from its rows."""
    return ScoredMetric(**vars(metrics.METRICS[name]), compute=compute)


def scored(
    name: str, unit: str, description: str, compute: Callable[[Rollouts], NDArray[Any]], **more: Any
) -> ScoredMetric:
    """Return a metric that the dataset does not store."""
    return ScoredMetric(name=name, unit=unit, description=description, compute=compute, **more)


def _feet_in_base(rollouts: Rollouts) -> NDArray[Any]:
    """Return the mean distance of the feet from their references, both seen from their own base [m]."""
    rows = rollouts.rows
    feet = metrics.in_base_frame(
        rows["link_position"][:, :, FOOT_LINKS], rows["root_position"], rows["root_orientation"]
    )
    reference = metrics.in_base_frame(
        rows["reference_foot_position"], rows["reference_root_position"], rows["reference_root_orientation"]
    )
    return metrics.mean_distance(feet, reference)


def _power(rollouts: Rollouts) -> NDArray[Any]:
    """Return the mechanical power [W]."""
    return metrics.mechanical_power(rollouts.rows["joint_power_mean"])


METRICS = (
    scored(
        "joint_mse",
        "rad^2",
        "mean square joint position error",
        lambda r: metrics.mean_square(r.rows["joint_position"], r.rows["reference_joint_position"]),
    ),
    stored(
        "joint_rmse",
        lambda r: metrics.root_mean_square(r.rows["joint_position"], r.rows["reference_joint_position"]),
    ),
    stored(
        "root_error",
        lambda r: metrics.mean_distance(r.rows["root_position"], r.rows["reference_root_position"]),
    ),
    stored(
        "root_angle",
        lambda r: metrics.rotation_error(r.rows["root_orientation"], r.rows["reference_root_orientation"]),
    ),
    stored(
        "foot_error",
        lambda r: metrics.mean_distance(r.rows["link_position"][:, :, FOOT_LINKS], r.rows["reference_foot_position"]),
    ),
    scored("foot_error_in_base", "m", "the same, robot and reference each seen from its own base", _feet_in_base),
    scored(
        "root_velocity_error",
        "m/s",
        "mean length of the root's velocity error",
        lambda r: metrics.linear_velocity_error(
            r.rows["root_linear_velocity"], r.rows["reference_root_position"], r.frame_duration
        ),
    ),
    scored(
        "root_turn_rate_error",
        "rad/s",
        "mean length of the root's angular velocity error",
        lambda r: metrics.angular_velocity_error(
            r.rows["root_angular_velocity"], r.rows["reference_root_orientation"], r.frame_duration
        ),
    ),
    scored(
        "joint_velocity_error",
        "rad/s",
        "root mean square joint velocity error",
        lambda r: metrics.joint_velocity_error(
            r.rows["joint_velocity"], r.rows["reference_joint_position"], r.frame_duration
        ),
    ),
    scored(
        "joint_emd",
        "rad",
        "Earth Mover's Distance of joint positions, root mean square over the joints",
        lambda r: transport.joint_distance(r.rows),
    ),
    scored(
        "body_emd",
        "m",
        "Earth Mover's Distance of root and links, root mean square over the points",
        lambda r: transport.body_distance(r.rows, r.spec),
    ),
    stored(
        "foot_slip",
        lambda r: metrics.foot_slip(contact_velocities(r.spec, r.rows), r.rows["foot_contact_force"]),
    ),
    scored("power", "W", "mechanical power: mean over rows of the sum over joints of abs(joint_power_mean)", _power),
    scored(
        "cost_of_transport",
        "1",
        "mechanical power by weight and speed along the path",
        lambda r: metrics.cost_of_transport(
            _power(r), metrics.mean_speed(r.rows["root_position"], r.frame_duration), r.spec.mass
        ),
    ),
    stored(
        "torque_saturation",
        lambda r: metrics.torque_saturation(r.rows["torque_at_limit"]),
    ),
    stored(
        "joint_limit",
        lambda r: metrics.joint_limit_share(r.rows["joint_position"], r.spec.joint_lower, r.spec.joint_upper),
    ),
    stored(
        "action_saturation",
        lambda r: metrics.action_saturation(r.rows["joint_target"], r.spec.joint_lower, r.spec.joint_upper),
    ),
    scored(
        "action_rate",
        "1",
        "mean change of the action from row to row",
        lambda r: metrics.mean_change(r.rows["action"]),
    ),
    scored(
        "joint_acceleration",
        "rad/s^2",
        "mean size of the joint accelerations",
        lambda r: metrics.joint_acceleration(r.rows["joint_velocity"], r.frame_duration),
    ),
    stored(
        "joint_jerk",
        lambda r: metrics.joint_jerk(r.rows["joint_velocity"], r.frame_duration),
    ),
    scored(
        "survival",
        "1",
        "share of trajectories of full length",
        lambda r: r.length == r.rows["root_position"].shape[1],
        better="higher",
        is_share=True,
    ),
    scored(
        "acceptance",
        "1",
        "share of rollouts that were accepted into the dataset",
        lambda r: np.repeat([True, False], [r.accepted, r.rejected]),
        better="higher",
        is_share=True,
    ),
)
"""All metrics, in the order in which they are shown."""


def markdown_table() -> str:
    """Return the metrics and their meanings as a table in Markdown."""
    rows = [(Cell(one.name, code=True), one.unit, one.better, one.description) for one in METRICS]
    return markdown(make_table("", ("metric", "unit", "better", "meaning"), rows))
