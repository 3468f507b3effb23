"""What an environment is made of: tuples of reward, observation, termination and randomization terms."""
