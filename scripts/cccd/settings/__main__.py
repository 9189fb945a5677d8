"""Write the files that are generated from the models, where they are not up to date.

``PYTHONPATH=scripts python -m cccd.settings`` in the project's folder.
"""

from __future__ import annotations

from pathlib import Path

from cccd.settings.emit import generated_files

if __name__ == "__main__":
    for path, text in generated_files(Path(__file__).resolve().parents[3]).items():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"wrote {path}")
