"""Usual mistakes with units, frames and orders, recognised by undoing them: the failed checks then hold."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block, is_rows
from kine2go_warp.dataset.checks.records import Diagnosis, RowCheck
from kine2go_warp.dataset.checks.rows import advance, turns
from kine2go_warp.dataset.schema import OPTIONAL_ROW_ARRAYS, ROW_ARRAYS, ArraySpec
from kine2go_warp.quantities import MIRRORED_LEGS
from kine2go_warp.robots import RobotSpec
from kine2go_warp.rotations import to_matrices

Array = NDArray[np.float64]
Change = Callable[[Block], dict[str, Array]]

MAX_TRAJECTORIES = 4
"""Trajectories on which mistakes are tried out."""

ORDERED = {"joint": "joints", "foot": "feet"}
"""Dimensions whose order may be wrong, and the diagnosis of each."""

SHIFTS = {
    sign * rows: f"{count} {'late' if sign > 0 else 'early'}"
    for rows, count in ((1, "one row"), (2, "two rows"), (3, "three rows"))
    for sign in (1, -1)
}
"""Rows by which commands may be shifted, other arrays by one, and the diagnosis of each."""

COMMANDS = ("action", "action_mean", "joint_target")


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
    orders = wrong_orders(block.spec)
    arrays = [array for array in (*ROW_ARRAYS, *OPTIONAL_ROW_ARRAYS) if array.name in block]
    for array in arrays:
        yield from unit_mistakes(array)
        yield from frame_mistakes(array, block)
        for dimension, plural in ORDERED.items():
            for how, order in orders[dimension].items() if dimension in array.dims else ():
                what = f"{array.name} has its {plural} {how}"
                yield KnownMistake(what, (array.name,), reordered((array,), dimension, order))
        for shift, when in SHIFTS.items():
            if abs(shift) == 1 or array.name in COMMANDS:
                yield KnownMistake(f"{array.name} is {when}", (array.name,), shifted((array.name,), shift))
    for dimension, plural in ORDERED.items():
        concerned = tuple(array for array in arrays if dimension in array.dims)
        names = tuple(array.name for array in concerned)
        for how, order in orders[dimension].items():
            what = f"all arrays have their {plural} {how}"
            yield KnownMistake(what, names, reordered(concerned, dimension, order))
    commands = tuple(name for name in COMMANDS if name in block)
    for shift, when in SHIFTS.items():
        yield KnownMistake(f"actions and targets are {when}", commands, shifted(commands, shift))
    yield from latency_mistakes(block)
    if {"phase", "cycle", "length"} <= set(block.stored):
        every = tuple(name for name, values in block.stored.items() if is_rows(name, values))
        yield KnownMistake("a row was left out of all arrays", (*every, "length"), with_missing_rows)
        yield KnownMistake("a row is there twice in all arrays", (*every, "length"), without_repeated_rows)


def wrong_orders(spec: RobotSpec) -> dict[str, dict[str, list[int]]]:
    """Return the places from which wrongly ordered joints and feet are taken, by dimension and by how they lie."""
    legs, places = len(spec.legs), np.arange(len(spec.joint_names))
    motors = [spec.sdk_motor_order.index(name) for name in spec.joint_names]
    by_kind = places.reshape(-1, legs).T.ravel().tolist()
    joints = {"in the motors' order": motors, "grouped by kind, all hips first": by_kind}
    feet = {"in the motors' order": [motors[3 * leg] // 3 for leg in range(legs)]}
    if legs == len(MIRRORED_LEGS):
        for how, order in (("swapped front for rear", [2, 3, 0, 1]), ("swapped crosswise", [3, 2, 1, 0])):
            feet[how] = order
            joints[f"of legs {how}"] = [3 * leg + joint for leg in order for joint in range(3)]
    return {"joint": joints, "foot": feet}


def latency_mistakes(block: Block) -> Iterator[KnownMistake]:
    """Yield the mistake of a latency that is not the one of the settings."""
    settings, names = block.settings, ("randomization/latency", "initial_state/delay")
    if settings.latency is None or settings.physics_substeps is None or settings.control_frequency is None:
        return
    rate = settings.physics_substeps * settings.control_frequency
    substeps = round(settings.latency * rate)
    right = dict(zip(names, (substeps / rate, float(substeps)), strict=True))
    stored = tuple(name for name in names if name in block and not np.allclose(block.stored[name], right[name]))
    for chosen in {stored, *((name,) for name in stored)} - {()}:
        what = f"{' and '.join(chosen)} {'is' if len(chosen) == 1 else 'are'} not the latency of the settings, "
        yield KnownMistake(
            f"{what}{substeps} substeps", chosen,
            lambda block, chosen=chosen: {name: np.full_like(block.stored[name], right[name]) for name in chosen},
        )  # fmt: skip


def with_missing_rows(block: Block) -> dict[str, Array]:
    """Return the rows of all trajectories with a hole where the reference's pace shows that one was left out."""
    return edited(block, lambda steps, pace: np.flatnonzero(np.abs(steps - 2.0 * pace) < 0.5 * pace) + 1, True)


def without_repeated_rows(block: Block) -> dict[str, Array]:
    """Return the rows of all trajectories without those in which the reference stands still."""
    return edited(block, lambda steps, pace: np.flatnonzero(np.abs(steps) < 0.5 * pace) + 1, False)


def edited(block: Block, find: Callable[[Array, float], NDArray[np.intp]], is_added: bool) -> dict[str, Array]:
    """Return all rows with a hole at the first place found in each trajectory, or without that row; one row longer."""
    turn, pace = turns(block), float(advance(block)[0])
    names = [name for name, values in block.stored.items() if is_rows(name, values)]
    length, changed = block.stored["length"].copy(), {}
    places = [find(np.diff(one), pace)[:1] for one in turn]
    for name in names:
        values = block.stored[name]
        changed[name] = np.full((len(values), values.shape[1] + 1, *values.shape[2:]), np.nan)
        for index, own in enumerate(values):
            rows = np.insert(own, places[index], np.nan, axis=0) if is_added else np.delete(own, places[index], axis=0)
            changed[name][index, : len(rows)] = rows
    length += np.array([len(place) for place in places]) * (1 if is_added else -1)
    return {**changed, "length": length}


def unit_mistakes(array: ArraySpec) -> Iterator[KnownMistake]:
    """Yield mistakes of units and signs."""
    name = array.name
    if array.unit != "1" and "quaternion" not in array.dims:
        yield KnownMistake(f"{name} has the wrong sign", (name,), lambda block: {name: -block.stored[name]})
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
            moved[name][:, slice(-rows, None) if rows > 0 else slice(0, -rows)] = np.nan
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
        wrong = [check for check in concerned if check in failed]
        still = [check for check in wrong if not holds(mended, check, block)]
        fixes = dict.fromkeys(check.name for check in wrong if check not in still)
        if fixes and not any(failing(mended, [check]).any() for check in concerned if check not in failed):
            candidates.append(Diagnosis(motion, mistake.what, tuple(fixes), len({check.name for check in failed})))
    most = max((len(one.fixes) for one in candidates), default=0)
    return [one for one in candidates if len(one.fixes) == most]


def holds(mended: Block, check: RowCheck, block: Block) -> bool:
    """Return whether a check finds nothing wrong, and still judges each trajectory that it judged before."""
    values, before = check.off_by(mended), check.off_by(block)
    if values is None or before is None:
        return False
    after, known = (one.reshape(block.num_trajectories, -1) for one in (values, before))
    is_judged = (~np.isnan(after)).any(axis=1) | np.isnan(known).all(axis=1)
    return bool(is_judged.all() and not np.any(after > check.tolerance))


def only(chosen: NDArray[np.bool_], block: Block, changes: dict[str, Array]) -> dict[str, Array]:
    """Return changed arrays with the change in some trajectories only."""
    mixed = {}
    for name, changed in changes.items():
        if changed.shape != block.stored[name].shape:
            # Rows were added, in all trajectories.
            mixed[name] = changed
            continue
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
