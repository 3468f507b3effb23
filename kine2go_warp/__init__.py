"""From quadruped motion clips to state-action data for the Unitree Go2."""

__version__ = "0.1.0"
