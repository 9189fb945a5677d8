"""JSON schema of the configuration, from its models."""

from __future__ import annotations

import functools
from typing import Any, cast

from cccd.settings.root import whole_settings

__all__ = ["raw_schema"]


@functools.cache
def raw_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of the whole configuration as pydantic gives it, references written out."""
    schema = whole_settings().model_json_schema()
    return cast(dict[str, Any], _written_out(schema, schema.pop("$defs")))


def _written_out(node: Any, definitions: dict[str, Any]) -> Any:
    if isinstance(node, list):
        return [_written_out(part, definitions) for part in cast(list[Any], node)]
    if not isinstance(node, dict):
        return node
    parts = cast(dict[str, Any], node)
    if "$ref" in parts:  # what stands beside a reference is the field's own, and wins
        parts = definitions[parts["$ref"].removeprefix("#/$defs/")] | parts
    return {
        key: _written_out(part, definitions)
        for key, part in parts.items()
        if key != "$ref" and not (key == "title" and isinstance(part, str))
    }
