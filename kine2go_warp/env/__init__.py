"""The imitation environment: Warp kernels around Newton's MuJoCo Warp solver, one captured graph a control step."""

import kine2go_warp.kernels  # noqa: F401 - its configuration comes before Newton
