"""Policies outside the simulator: exported to ONNX and TorchScript, and driven with NumPy from measured states."""
