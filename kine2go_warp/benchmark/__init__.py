"""A yardstick for policies that others learned from a dataset."""
