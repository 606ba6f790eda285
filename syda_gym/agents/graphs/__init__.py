"""Graphs: agents and mappings as torch modules, from which ONNX files are made."""
