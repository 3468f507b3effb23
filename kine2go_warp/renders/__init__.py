"""Pictures and videos of what a dataset holds: the recorded states, drawn without a display."""
