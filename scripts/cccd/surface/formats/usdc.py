"""USD in binary."""

from cccd.surface.formats.usd import write

__all__ = ["write"]
