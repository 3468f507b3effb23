"""How good the rollouts of a dataset are: tracking, distributions, contact, effort and smoothness."""
