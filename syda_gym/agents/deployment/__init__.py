"""Agents and mappings outside the environment: ONNX graphs, and a runner that needs no torch."""
