"""Readers of scans: a `cccd.request.Request` -> `cccd.containers.Structure`."""

from cccd.inputs.load import read_request, structure_of_array
from cccd.request import Request

__all__ = ["Request", "read_request", "structure_of_array"]
