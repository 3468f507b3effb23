"""Batched stochastic rollouts of trained policies."""
