"""Readers of scans: a `cccd.request.Request` -> `cccd.containers.Structure`."""

from cccd.inputs.load import load_structure, read_request, structure_of_array

__all__ = ["load_structure", "read_request", "structure_of_array"]
