"""OpenCASCADE's bindings ship no types: every module is taken as it comes."""

from typing import Any

def __getattr__(name: str) -> Any: ...
