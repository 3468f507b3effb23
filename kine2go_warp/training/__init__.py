"""Training: PPO from clips to a policy folder, until the policy tracks them."""
