"""The configuration: one typed model per stage, with default, range, unit and reason of every key.

From the models come ``config/config.yaml``, ``workflow/schemas/config.schema.yaml`` and
``docs/configuration.md`` (``python -m cccd.settings`` writes them). Imported at every parse of the workflow,
so it imports nothing heavy.
"""

from cccd.settings.boundaries import BoundarySettings
from cccd.settings.comparisons import ComparisonSettings
from cccd.settings.curves import CurveSettings
from cccd.settings.imports import ImportSettings, PhantomSettings, RegionSettings
from cccd.settings.junctions import (
    GraphSettings,
    InferenceSettings,
    KindWeights,
    LossSettings,
    NetworkSettings,
    OptimiserSettings,
)
from cccd.settings.messages import choices, describe, nearest
from cccd.settings.report import ReportSettings
from cccd.settings.root import Settings
from cccd.settings.schema import load_schema
from cccd.settings.section import Section, setting
from cccd.settings.surface import (
    SURFACE_FORMATS,
    BlendingSettings,
    FittingSettings,
    InterpolationSettings,
    LoftSettings,
    MatchingSettings,
)
from cccd.settings.validation import validate_config

__all__ = [
    "SURFACE_FORMATS",
    "BlendingSettings",
    "BoundarySettings",
    "ComparisonSettings",
    "CurveSettings",
    "FittingSettings",
    "GraphSettings",
    "ImportSettings",
    "InferenceSettings",
    "InterpolationSettings",
    "KindWeights",
    "LoftSettings",
    "LossSettings",
    "MatchingSettings",
    "NetworkSettings",
    "OptimiserSettings",
    "PhantomSettings",
    "RegionSettings",
    "ReportSettings",
    "Section",
    "Settings",
    "choices",
    "describe",
    "load_schema",
    "nearest",
    "setting",
    "validate_config",
]
