"""Dimensions of quantities, and what becomes of them in a mirror. It imports nothing of the package."""

from typing import Literal

LEG_NAMES = ("FL", "FR", "RL", "RR")
JOINTS_OF_A_LEG = ("hip", "thigh", "calf")

DIMENSION_SIZES = {"axis": 3, "joint": len(LEG_NAMES) * len(JOINTS_OF_A_LEG), "foot": len(LEG_NAMES)}
"""Values along each dimension."""

Mirror = Literal["scalar", "vector", "rotation", "angle"]
"""``scalar``: as it is. ``vector``: a direction, force or velocity; y points left. ``rotation``: angular velocity, or
the left axis of a frame. ``angle``: joint positions or velocities; hips turn about x, so their sign changes."""

MIRRORED_SIGNS: dict[Mirror, tuple[float, ...]] = {
    "scalar": (1.0,),
    "vector": (1.0, -1.0, 1.0),
    "rotation": (-1.0, 1.0, -1.0),
    "angle": (-1.0, 1.0, 1.0),
}
"""Signs in a mirror, repeated over the values of a quantity."""

MIRRORED_LEGS = (1, 0, 3, 2)
"""Each leg's mirror image."""


def size_of(dims: tuple[str, ...]) -> int:
    """Return the number of values of a quantity."""
    size = 1
    for dimension in dims:
        size *= DIMENSION_SIZES[dimension]
    return size


def mirrored(dims: tuple[str, ...], mirror: Mirror) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return for each value of a quantity the place of its mirror image, and the sign that it takes."""
    size, signs = size_of(dims), MIRRORED_SIGNS[mirror]
    places = tuple(range(size))
    if dims[:1] in (("joint",), ("foot",)):
        part = size // len(LEG_NAMES)
        places = tuple(part * leg + offset for leg in MIRRORED_LEGS for offset in range(part))
    return places, tuple(signs[index % len(signs)] for index in range(size))
