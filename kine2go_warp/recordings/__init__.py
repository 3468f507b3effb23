"""Rerun recordings of a dataset's motions, to look at."""
