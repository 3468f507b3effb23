"""Faults of the store, each with the check that must find it and the array that it must name."""

import shutil

from kine2go_warp.robots import GO2
from tests.dataset.checks.spoiling import (
    MOTION,
    Fault,
    attribute,
    copied_trajectory,
    garble,
    metadata,
    rewritten,
    shard,
    stale_index,
    stricter_limits,
    truncate,
    turned_copy,
)

INDEX = ("index",)
"""A change of metadata is also one that the index does not know."""

STORE_FAULTS = {
    "missing array": Fault(lambda path: shutil.rmtree(path / MOTION / "action"), "arrays", "action", others=INDEX),
    "missing sub-group": Fault(
        lambda path: shutil.rmtree(path / MOTION / "quality"), "arrays", "quality/root_error", others=INDEX
    ),
    "truncated shard": Fault(truncate, "readable", "joint_torque"),
    "garbled head of a shard": Fault(garble(slice(0, 8)), "readable", "joint_torque"),
    "garbled index of a shard": Fault(garble(slice(-40, -20)), "readable", "joint_torque"),
    "missing shard": Fault(lambda path: shard(path, "phase").unlink(), "readable", "phase"),
    "corrupt metadata": Fault(
        lambda path: (path / MOTION / "phase" / "zarr.json").write_text("{"), "readable", "phase"
    ),
    "attributes of another kind": Fault(
        metadata("phase", attributes=[]), "readable", "phase", others=INDEX
    ),
    "malformed index": Fault(metadata("", consolidated_metadata={"metadata": [1]}), "index", None),
    "corrupt metadata of a motion": Fault(
        lambda path: (path / MOTION / "zarr.json").write_text("{"), "readable", None, others=INDEX
    ),
    "stale index": Fault(stale_index, "index", "mass"),
    "swapped dimensions": Fault(
        metadata("phase", dimension_names=["frame", "trajectory"]), "metadata", "phase", others=INDEX
    ),
    "another type": Fault(
        rewritten("reward", lambda one: one.astype("f8")), "metadata", "reward", others=INDEX
    ),
    "fewer rows": Fault(rewritten("reward", lambda one: one[:, :-5]), "metadata", "reward", others=INDEX),
    "another unit": Fault(
        metadata("joint_position", attributes={"units": "deg", "description": "relative to the parent link"}),
        "metadata", "joint_position", others=INDEX,
    ),
    "another fill value": Fault(metadata("phase", fill_value=0.0), "metadata", "phase", others=INDEX),
    "permuted labels": Fault(
        rewritten("foot", lambda one: one[[1, 0, 3, 2]]), "labels", "foot", others=INDEX
    ),
    "another default pose": Fault(attribute("default_joint_position", [0.0] * 12), "root attributes", None,
                                  others=("attributes",)),
    "another action scale": Fault(attribute("action_scale", 0.5), "root attributes", None, others=("attributes",)),
    "another robot model": Fault(attribute("robot_model_sha256", "0" * 64), "root attributes", None),
    "another control frequency": Fault(
        attribute("control_frequency", 50.0), "attributes", None,
        others=("time", "start phase", "root linear velocity, overall", "joint position reward",
                "foot position reward", "root pose reward", "initial state", "applied target", "motor law",
                "mean force", "reference velocity", "joint velocity reward", "root velocity reward", "quality"),
    ),
    "damaged file of reviews": Fault(lambda path: (path / "verdicts.json").write_text("{"), "reviews", None),
    "no gains": Fault(attribute("stiffness", None), "root attributes", None, others=("attributes",)),
    "a motion with another joint order": Fault(
        attribute("joint_names", list(GO2.sdk_motor_order), motion=True), "attributes", None, others=INDEX
    ),
    "another number accepted": Fault(attribute("accepted", 4, motion=True), "attributes", None, others=INDEX),
    "another name": Fault(attribute("motion", "cat_trot", motion=True), "attributes", None, others=INDEX),
    "no licence": Fault(attribute("licence", "", motion=True), "attributes", None, others=INDEX),
    "limits that the rollouts break": Fault(
        stricter_limits, "acceptance", "joint_position", others=(*INDEX, "quality")
    ),
    "copied trajectory": Fault(copied_trajectory, "duplicates", None, others=("independent draws",)),
    "turned copy of a trajectory": Fault(
        turned_copy, "duplicates", None, others=("independent draws", "initial state")
    ),
}  # fmt: skip
"""Faults of the store and of what describes it."""
