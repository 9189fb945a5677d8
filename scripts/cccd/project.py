"""Where the workflow's files are: Snakefile, job scripts, rules, schemas, templates, weights, configuration.

In a checkout they lie where people look for them; the wheel carries them in the package's own folder
``pipeline``, laid out alike.
"""

from __future__ import annotations

from pathlib import Path

_CARRIED = Path(__file__).resolve().parent / "pipeline"

#: The folder of the Snakefile.
PROJECT = _CARRIED if _CARRIED.is_dir() else Path(__file__).resolve().parents[2]

#: The junction network that comes along.
SHIPPED_WEIGHTS = PROJECT / "workflow" / "models" / "junctions.pt"
