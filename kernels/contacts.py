"""Contact forces on the feet and contacts of other parts, read from the solver's constraint rows."""

import warp as wp

vec5 = wp.types.vector(length=5, dtype=wp.float32)

ROLE_IGNORED = wp.constant(-1)
"""A shape whose contacts nobody asks for, such as the floor."""
ROLE_BODY = wp.constant(4)
"""Base or head: touching the floor with it is a fall. Roles 0 to 3 are the feet FL, FR, RL, RR."""
ROLE_LEG = wp.constant(5)
"""Thigh or calf."""


@wp.func
def pyramid_force(rows: wp.vec4, friction: float) -> wp.vec3:
    """Return normal and two tangential forces [N] from the four edge forces of a pyramidal friction cone."""
    return wp.vec3(
        rows[0] + rows[1] + rows[2] + rows[3], friction * (rows[0] - rows[1]), friction * (rows[2] - rows[3])
    )


@wp.kernel
def clear_contacts(
    foot_force: wp.array2d(dtype=wp.vec3), body_contact: wp.array(dtype=int), leg_contact: wp.array(dtype=int)
):
    """Set all contact results to zero. Launched over [num_worlds]."""
    world = wp.tid()
    for foot in range(4):
        foot_force[world, foot] = wp.vec3(0.0, 0.0, 0.0)
    body_contact[world] = 0
    leg_contact[world] = 0


@wp.kernel
def collect_contacts(
    count: wp.array(dtype=int),
    geom: wp.array(dtype=wp.vec2i),
    contact_world: wp.array(dtype=int),
    frame: wp.array(dtype=wp.mat33),
    friction: wp.array(dtype=vec5),
    row_address: wp.array2d(dtype=int),
    row_force: wp.array2d(dtype=float),
    geom_role: wp.array(dtype=int),
    foot_force: wp.array2d(dtype=wp.vec3),
    body_contact: wp.array(dtype=int),
    leg_contact: wp.array(dtype=int),
):
    """Sum the ground's forces on the feet in the world frame [N] and flag contacts of base, head and legs with it.

    Launched over the capacity of the contact buffer. A contact's normal points from its first to its second shape and
    its force acts on the second.
    """
    contact = wp.tid()
    if contact >= count[0]:
        return
    address = row_address[contact, 0]
    if address < 0 or address + 3 >= row_force.shape[1]:
        return
    if geom_role[geom[contact][0]] >= 0 and geom_role[geom[contact][1]] >= 0:
        # The robot touches itself.
        return
    world = contact_world[contact]
    rows = wp.vec4(
        row_force[world, address],
        row_force[world, address + 1],
        row_force[world, address + 2],
        row_force[world, address + 3],
    )
    force = wp.transpose(frame[contact]) * pyramid_force(rows, friction[contact][0])
    for side in range(2):
        role = geom_role[geom[contact][side]]
        sign = 2.0 * float(side) - 1.0
        if role >= 0 and role < 4:
            wp.atomic_add(foot_force, world, role, sign * force)
        elif role == ROLE_BODY:
            body_contact[world] = 1
        elif role == ROLE_LEG:
            leg_contact[world] = 1
