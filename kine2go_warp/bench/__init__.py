"""Measures how fast each stage is on the machine at hand."""
