"""USD in text."""

from cccd.surface.formats.usd import write

__all__ = ["write"]
