"""Readers and sources of scans: a row of the cohort sheet -> `cccd.containers.Structure`."""

from cccd.volumes.load import load_structure

__all__ = ["load_structure"]
