"""Datasets in the formats of others: LeRobot, and one .npz file a trajectory."""
