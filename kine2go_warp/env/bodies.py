"""What differs between the worlds' robots and grounds, as the solver sees it."""

import warp as wp

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.model import host_copy
from kine2go_warp.env.simulation import Simulation
from kine2go_warp.kernels import launch, randomization
from kine2go_warp.kernels.world import BaseBody


class Bodies:
    """Base mass, centre of mass and friction of every world: write them here, then have them applied."""

    def __init__(self, config: EnvConfig, simulation: Simulation) -> None:
        """Take the robot model's own values."""
        self.num_worlds, self.simulation = config.num_worlds, simulation
        model = simulation.model
        self.bodies_per_world = model.body_count // self.num_worlds
        self.base = BaseBody()
        self.base.nominal_mass = float(host_copy(model.body_mass)[0])
        self.base.nominal_com = wp.vec3(*host_copy(model.body_com)[0].tolist())
        self.base.nominal_inertia = wp.mat33(*host_copy(model.body_inertia)[0].ravel().tolist())
        self.base.mass = wp.full(self.num_worlds, self.base.nominal_mass, dtype=float)
        self.base.com = wp.full(self.num_worlds, self.base.nominal_com, dtype=wp.vec3)
        self.friction = wp.full(self.num_worlds, config.solver.friction, dtype=float)

    def apply_bodies(self) -> None:
        """Make the physics use ``base``."""
        model = self.simulation.model
        launch(
            randomization.apply_bodies,
            dim=self.num_worlds,
            inputs=[
                self.base,
                self.bodies_per_world,
                self.simulation.robot,
                model.body_mass,
                model.body_inv_mass,
                model.body_com,
                model.body_inertia,
                model.body_inv_inertia,
            ],
        )
        self.simulation.inertia_changed()

    def apply_friction(self) -> None:
        """Make the physics use ``friction``."""
        solver_friction = self.simulation.solver.mjw_model.geom_friction
        inputs = [self.friction, self.simulation.geom_role, solver_friction]
        launch(randomization.apply_friction, dim=solver_friction.shape, inputs=inputs)
