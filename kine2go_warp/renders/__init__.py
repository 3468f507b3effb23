"""Pictures and films of what a dataset holds: the recorded states, drawn without a display."""
