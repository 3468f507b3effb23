"""Recipes and the runner that takes motions from clip to dataset."""
