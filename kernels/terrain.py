"""The height of the ground, and of the reference above it."""

import warp as wp


@wp.struct
class Terrain:
    """A square field of heights about the world's origin, flat where there is nothing to say."""

    height: wp.array2d(dtype=float)
    """Height of the ground [m], shape [num_points, num_points], first index along y."""
    lift: wp.array2d(dtype=float)
    """How far a reference is lifted [m]: the ground, smoothed over the length of the robot. Same shape."""
    half_extent: float
    """Half the length of a side [m]."""


@wp.func
def field_at(field: wp.array2d(dtype=float), half_extent: float, place: wp.vec2) -> float:
    """Interpolate a field of heights bilinearly at a place in the world [m]; beyond its edge it goes on level."""
    cells = float(field.shape[0] - 1)
    x = wp.clamp((place[0] + half_extent) / (2.0 * half_extent), 0.0, 1.0) * cells
    y = wp.clamp((place[1] + half_extent) / (2.0 * half_extent), 0.0, 1.0) * cells
    column = wp.min(int(x), field.shape[0] - 2)
    row = wp.min(int(y), field.shape[0] - 2)
    across = x - float(column)
    along = y - float(row)
    near = field[row, column] * (1.0 - across) + field[row, column + 1] * across
    far = field[row + 1, column] * (1.0 - across) + field[row + 1, column + 1] * across
    return near * (1.0 - along) + far * along


@wp.func
def ground_height(terrain: Terrain, place: wp.vec2) -> float:
    """Return the height of the ground [m]."""
    return field_at(terrain.height, terrain.half_extent, place)


@wp.func
def reference_lift(terrain: Terrain, place: wp.vec2) -> float:
    """Return how far a reference at a place is lifted [m]."""
    return field_at(terrain.lift, terrain.half_extent, place)


@wp.func
def reference_climb(terrain: Terrain, place: wp.vec2, velocity: wp.vec2) -> float:
    """Return the vertical speed that a reference gains by being lifted [m/s], from its planar velocity [m/s]."""
    reach = 1.0e-2
    ahead = reference_lift(terrain, place + velocity * reach)
    behind = reference_lift(terrain, place - velocity * reach)
    return (ahead - behind) / (2.0 * reach)
