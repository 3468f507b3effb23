"""How good a policy is: in Newton under several conditions, and exported, in plain MuJoCo."""
