"""Pictures and videos of what a dataset holds: the recorded states, drawn without a display."""

HELP = "on Debian and Ubuntu install libegl1 and libgl1-mesa-dri, or libosmesa6 and set MUJOCO_GL=osmesa"
"""What to do where nothing can draw."""
