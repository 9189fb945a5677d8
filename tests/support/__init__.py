"""What tests share: shapes with known answers, scans, plans, and where the checkout is."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = ROOT / "scripts"
