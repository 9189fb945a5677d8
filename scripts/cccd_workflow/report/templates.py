"""Pages written from their templates."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
import yaml
from markupsafe import Markup

from cccd.store import atomic_path
from cccd_viewers.viewer import deflate
from cccd_workflow.report.facts import provenance
from cccd_workflow.report.numerals import number
from cccd_workflow.report.render import VIEWS, VTK_PACKAGE


def shared_facts(config: Mapping[str, Any]) -> dict[str, Any]:
    """Collect what all pages need."""
    plain = json.loads(json.dumps(config, default=str))  # else YAML would have Python's tags
    return {
        "run": provenance(),
        "config": yaml.safe_dump(plain, sort_keys=False, allow_unicode=True, width=100),
        "vtk_package": VTK_PACKAGE,
        "view_names": ", ".join(view.name for view in VIEWS),
    }


def write_page(output: Path, template_dir: Path, name: str, context: Mapping[str, Any]) -> None:
    """Write a page: ``name`` is its template, ``context`` what that shows."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template_dir),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number, "bound": _bound}
    environment.globals["asset"] = lambda file: Markup(_text(template_dir / file))
    environment.globals["deflated"] = lambda file: deflate((template_dir / file).read_text("utf-8"))
    with atomic_path(output) as temporary:
        temporary.write_text(environment.get_template(name).render(context), encoding="utf-8")


def _text(file: Path) -> str:
    """Text of a file, without comments: these are for those who read the source, not for every page."""
    lines = (line.rstrip() for line in file.read_text(encoding="utf-8").splitlines())
    return "\n".join(line for line in lines if not line.lstrip().startswith("// "))


def _bound(text: str) -> str:
    """Keep a number and its unit, and both sides of ``k = 3``, on one line."""
    text = re.sub(r"(?<=\d) (?=(%|mm|ms|s|[kM]?B|KB|points)\b|%)", "\u00a0", text)
    return re.sub(r"\b([kn]) = (?=\d)", "\\1\u00a0=\u00a0", text)
