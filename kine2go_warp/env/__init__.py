"""The imitation environment: Warp kernels around Newton's MuJoCo Warp solver, one captured graph a control step."""
