"""Checks of a dataset: whether it is what the schema says, and whether its rows agree with one another."""
