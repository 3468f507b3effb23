"""Learning to track a clip with RSL-RL's PPO."""
