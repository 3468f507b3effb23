"""Usual mistakes with units, frames and orders, recognised by undoing them: the failed checks then hold."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.records import Diagnosis, RowCheck
from kine2go_warp.dataset.schema import ROW_ARRAYS, ArraySpec
from kine2go_warp.rotations import to_matrices

Array = NDArray[np.float64]
Change = Callable[[Block], dict[str, Array]]

MAX_TRAJECTORIES = 4
"""Trajectories on which mistakes are tried out."""


@dataclass(frozen=True)
class KnownMistake:
    """A mistake that a writer of data can make."""

    what: str
    """Such as ``joint_position is in degrees``."""
    arrays: tuple[str, ...]
    """The arrays that it concerns."""
    undo: Change
    """Returns those arrays without it."""


def known_mistakes(block: Block) -> Iterator[KnownMistake]:
    """Yield the mistakes to try, those of one array first."""
    spec = block.spec
    joints = [spec.sdk_motor_order.index(name) for name in spec.joint_names]
    feet = [joints[3 * leg] // 3 for leg in range(len(spec.legs))]
    arrays = [array for array in ROW_ARRAYS if array.name in block]
    for array in arrays:
        yield from unit_mistakes(array)
        yield from frame_mistakes(array, block)
        for index, name, order in (("joint", "joints", joints), ("foot", "feet", feet)):
            if index in array.dims:
                what = f"{array.name} has its {name} in the motors' order"
                yield KnownMistake(what, (array.name,), reordered((array,), index, order))
        for shift in (-1, 1):
            where = "late" if shift > 0 else "early"
            yield KnownMistake(f"{array.name} is one row {where}", (array.name,), shifted((array.name,), shift))
    by_joint = tuple(array for array in arrays if "joint" in array.dims)
    names = tuple(array.name for array in by_joint)
    yield KnownMistake("all arrays have their joints in the motors' order", names, reordered(by_joint, "joint", joints))
    commands = tuple(name for name in ("action", "action_mean", "joint_target") if name in block)
    for shift, where in ((1, "late"), (-1, "early")):
        yield KnownMistake(f"actions and targets are one row {where}", commands, shifted(commands, shift))


def unit_mistakes(array: ArraySpec) -> Iterator[KnownMistake]:
    """Yield mistakes of units."""
    name = array.name
    if array.unit in ("rad", "rad/s"):
        yield KnownMistake(f"{name} is in degrees", (name,), lambda block: {name: np.radians(block.stored[name])})
    if array.unit in ("m", "m/s"):
        yield KnownMistake(f"{name} is in millimetres", (name,), lambda block: {name: 1e-3 * block.stored[name]})


def frame_mistakes(array: ArraySpec, block: Block) -> Iterator[KnownMistake]:
    """Yield mistakes of frames, origins and the order of quaternions."""
    name = array.name
    if "quaternion" in array.dims:
        yield KnownMistake(
            f"{name} is (x, y, z, w)", (name,), lambda block: {name: np.roll(block.stored[name], 1, axis=-1)}
        )
        yield KnownMistake(
            f"{name} is inverted, the world in the base link", (name,),
            lambda block: {name: block.stored[name] * np.array([1.0, -1.0, -1.0, -1.0])},
        )  # fmt: skip
    if array.unit in ("m/s", "rad/s", "N") and "axis" in array.dims and "root_orientation" in block:
        yield KnownMistake(f"{name} is in the base frame", (name,), lambda block: {name: from_base(block, name)})
    if name == "root_linear_velocity" and {"root_orientation", "root_angular_velocity"} <= set(block.stored):
        yield KnownMistake(f"{name} is that of the centre of mass", (name,), lambda block: {name: at_origin(block)})


def from_base(block: Block, name: str) -> Array:
    """Return vectors that are given in the base frame in the world frame."""
    return np.einsum("ntij,nt...j->nt...i", to_matrices(block["root_orientation"]), block.stored[name])


def at_origin(block: Block) -> Array:
    """Return the velocity of the base link's origin from that of its centre of mass [m/s]."""
    origin = ElementTree.parse(block.spec.urdf).getroot().find(f"link[@name='{block.spec.base_link}']/inertial/origin")
    centre = np.array([float(value) for value in (origin.attrib["xyz"] if origin is not None else "0 0 0").split()])
    arm = to_matrices(block["root_orientation"]) @ centre
    return block.stored["root_linear_velocity"] - np.cross(block["root_angular_velocity"], arm)


def reordered(arrays: Sequence[ArraySpec], dimension: str, order: list[int]) -> Change:
    """Return a change of the order along a dimension."""
    return lambda block: {
        array.name: np.take(block.stored[array.name], order, axis=array.dims.index(dimension)) for array in arrays
    }


def shifted(names: tuple[str, ...], rows: int) -> Change:
    """Return a change that moves arrays ``rows`` rows earlier, with NaN where nothing is known."""

    def change(block: Block) -> dict[str, Array]:
        moved = {}
        for name in names:
            moved[name] = np.roll(block.stored[name], -rows, axis=1)
            moved[name][:, -1 if rows > 0 else 0] = np.nan
        return moved

    return change


def diagnose(motion: str, block: Block, checks: Sequence[RowCheck]) -> list[Diagnosis]:
    """Return the mistakes that explain the most failed checks, none if no mistake explains any.

    Mistakes are undone in trajectories that fail only; one that makes another check fail explains nothing. Checks of
    whether single values are finite do not take part: undoing a shift leaves holes.
    """
    checks = [check for check in checks if check.name not in ("finite", "padding")]
    bad = failing(block, checks)
    chosen = np.sort(np.concatenate([np.flatnonzero(bad)[:MAX_TRAJECTORIES], np.flatnonzero(~bad)[:2]]))
    block, bad = block.selected(chosen), bad[chosen]
    failed = [check for check in checks if failing(block, [check]).any()]
    candidates = []
    for mistake in known_mistakes(block):
        concerned = [check for check in checks if set(check.needs) & set(mistake.arrays)]
        if not any(check in failed for check in concerned):
            continue
        mended = block.replaced(only(bad, block, mistake.undo(block)))
        still = [check for check in concerned if failing(mended, [check]).any()]
        fixes = dict.fromkeys(check.name for check in failed if check in concerned and check not in still)
        if fixes and all(check in failed for check in still):
            candidates.append(Diagnosis(motion, mistake.what, tuple(fixes), len({check.name for check in failed})))
    most = max((len(one.fixes) for one in candidates), default=0)
    return [one for one in candidates if len(one.fixes) == most]


def only(chosen: NDArray[np.bool_], block: Block, changes: dict[str, Array]) -> dict[str, Array]:
    """Return changed arrays with the change in some trajectories only."""
    mixed = {}
    for name, changed in changes.items():
        mixed[name] = block.stored[name].copy()
        mixed[name][chosen] = changed[chosen]
    return mixed


def failing(block: Block, checks: Sequence[RowCheck]) -> NDArray[np.bool_]:
    """Return which trajectories fail any of some checks, shape [num_trajectories]."""
    bad = np.zeros(block.num_trajectories, dtype=bool)
    for check in checks:
        values = check.off_by(block)
        if values is not None:
            bad |= np.any(values.reshape(len(bad), -1) > check.tolerance, axis=1)
    return bad
