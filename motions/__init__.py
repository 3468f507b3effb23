"""Motion clips: their sources, the catalogue, retargeting to the robot, and the clip that the simulation tracks.

Nothing here imports torch, Warp or Newton: clips can be prepared on any machine.
"""
