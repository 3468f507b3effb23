"""Datasets and clips in the formats of others."""
