"""Policies: their settings, their folder, the environment as RSL-RL takes it, and acting."""
