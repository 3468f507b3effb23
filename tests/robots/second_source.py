"""Figures of the package's robots by a second source, as numbers: what their URDFs and specifications are held against.

A1 and Go1: MuJoCo Menagerie (unitree_a1/a1.xml, unitree_go1/go1.xml). B2: the maker's MuJoCo models, of unitree_ros
(b2_description_mujoco/xml/b2.xml) for the legs and of unitree_mujoco (unitree_robots/b2/b2.xml) for the base. Links in
them are merged over fixed joints by MuJoCo, rotors and feet included.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Body:
    """Mass [kg], centre of mass [m], turn of the principal axes (w, x, y, z) and moments about them [kg m^2]."""

    mass: float
    centre: tuple[float, float, float]
    turn: tuple[float, float, float, float]
    moments: tuple[float, float, float]
    tolerance: float = 1e-3
    """By which moments, and centres as shares of 0.1 m, may differ."""


BODIES = {
    "a1": {
        "base": Body(4.713, (0, 0.0041, -0.0005), (1, 0, 0, 0), (0.0158533, 0.0377999, 0.0456542), 0.003),
        "FL_hip": Body(
            0.696,
            (-0.003311, 0.000635, 3.1e-05),
            (0.494499, 0.491507, 0.506268, 0.507528),
            (0.000807752, 0.00055293, 0.000468983),
        ),
        "FL_thigh": Body(
            1.013,
            (-0.003237, -0.022327, -0.027326),
            (0.999125, 0.00256393, -0.0409531, 0.00806091),
            (0.00555739, 0.00513936, 0.00133944),
        ),
        "FL_calf": Body(
            0.226,
            (0.00472659, 0, -0.131975),
            (0.706886, 0.017653, 0.017653, 0.706886),
            (0.00340344, 0.00339393, 3.54834e-05),
        ),
    },
    "go1": {
        "FL_hip": Body(
            0.68,
            (-0.0049166, -0.00762615, -8.865e-05),
            (0.482891, 0.495027, 0.514169, 0.507341),
            (0.000734064, 0.000468438, 0.000398719),
        ),
        "FL_thigh": Body(
            1.009,
            (-0.00304722, -0.019315, -0.0305004),
            (0.753383, 0.0775126, -0.0272313, 0.65243),
            (0.00478717, 0.00460903, 0.000709268),
        ),
        "FR_calf": Body(
            0.195862,
            (0.00429862, 0.000976676, -0.146197),
            (0.691246, 0.00357467, 0.00511118, 0.722592),
            (0.00149767, 0.00148468, 3.58427e-05),
        ),
    },
    "b2": {
        # Of an earlier revision of the maker's figures: 35.606 kg of trunk rather than 35.86, 3.366 of head for 3.6885.
        "base": Body(
            40.8426,
            (0.0212868, 0.0045819, 0.0106169),
            (0.00178111, 0.675412, -0.000262894, 0.737438),
            (1.73786, 1.66448, 0.343734),
            0.03,
        ),
        "FR_hip": Body(
            2.9464,
            (-0.00844158, 0.0100194, 0.000239503),
            (0.476608, 0.477229, 0.518954, 0.525151),
            (0.00485575, 0.00370656, 0.00277186),
        ),
        "FL_thigh": Body(
            4.8094,
            (-0.00592206, -0.0335174, -0.0545473),
            (0.910035, 0.0855949, -0.000888135, 0.405597),
            (0.0640934, 0.0634463, 0.00699942),
        ),
        "FL_calf": Body(
            0.53,
            (0.00792095, 0, -0.180895),
            (0.70709, -0.00488772, -0.00488772, 0.70709),
            (0.0169205, 0.0167822, 0.000404298),
        ),
    },
}

LENGTHS = {
    "a1": ((0.183, 0.047), 0.08505, 0.2, 0.2),
    "go1": ((0.1881, 0.04675), 0.08, 0.213, 0.213),
    "b2": ((0.3285, 0.072), 0.11973, 0.35, 0.35),
}
"""Left front hip from the base's origin, thigh beside the hip, lengths of thigh and calf [m]."""

RANGES = {
    "a1": ((-0.802851, 0.802851), (-1.0472, 4.18879), (-2.69653, -0.916298)),
    "go1": ((-0.863, 0.863), (-0.686, 4.501), (-2.818, -0.888)),
    "b2": ((-0.87, 0.87), (-0.94, 4.69), (-2.82, -0.43)),
}
"""Of hip, thigh and calf [rad]."""

TORQUES = {"a1": (33.5, 33.5, 33.5), "go1": (23.7, 23.7, 35.55), "b2": (200, 200, 300)}
"""Largest torques [N m]. For the B2's calves the maker's URDF has 320, which is taken."""

WEIGHTS = {"go2": 15.0, "a1": 12.0, "go1": 12.0, "b2": 60.0}
"""Of the maker's data sheets, with battery [kg]. The B2's URDF is 24 % above, all its rotors counted."""
