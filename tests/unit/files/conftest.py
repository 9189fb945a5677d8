import sys
from pathlib import Path

for neighbour in ("geometry", "solids", "surface", "inputs"):  # for their shapes and scans
    sys.path.insert(0, str(Path(__file__).parents[1] / neighbour))
