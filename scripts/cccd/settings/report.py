"""Settings of the report."""

from __future__ import annotations

from cccd.settings.section import Section, setting

__all__ = ["ReportSettings"]


class ReportSettings(Section):
    """How large the report may get (section ``report``)."""

    pages_above: int = setting(
        12,
        "more structures than this: an index, and a page per structure",
        why="A single page of more would be slow to open.",
        unit="count",
        ge=0,
        le=50,
    )
