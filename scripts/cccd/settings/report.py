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
    viewer_triangles: int = setting(
        80000,
        "each mesh in the 3D view is simplified to at most this many triangles",
        why="At 80000 a structure takes some 1.5 MB of its page, at 150000 some 2.7 MB.",
        unit="count",
        ge=1000,
        le=150000,
    )
