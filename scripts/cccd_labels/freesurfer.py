"""Names of FreeSurfer's labels: its subcortical segmentation and the gyri of its default atlas."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

__all__ = ["freesurfer_names"]

_PAIRED = {
    2: "Cerebral-White-Matter", 3: "Cerebral-Cortex", 4: "Lateral-Ventricle", 5: "Inf-Lat-Vent",
    7: "Cerebellum-White-Matter", 8: "Cerebellum-Cortex", 10: "Thalamus", 11: "Caudate", 12: "Putamen",
    13: "Pallidum", 17: "Hippocampus", 18: "Amygdala", 26: "Accumbens-area", 28: "VentralDC", 30: "vessel",
    31: "choroid-plexus",
}  # fmt: skip
#: The right side's labels, by the left's.
_RIGHT = {
    2: 41, 3: 42, 4: 43, 5: 44, 7: 46, 8: 47, 10: 49, 11: 50, 12: 51, 13: 52, 17: 53, 18: 54, 26: 58,
    28: 60, 30: 62, 31: 63,
}  # fmt: skip
_SINGLE = {
    14: "3rd-Ventricle", 15: "4th-Ventricle", 16: "Brain-Stem", 24: "CSF", 72: "5th-Ventricle",
    77: "WM-hypointensities", 80: "non-WM-hypointensities", 85: "Optic-Chiasm", 251: "CC_Posterior",
    252: "CC_Mid_Posterior", 253: "CC_Central", 254: "CC_Mid_Anterior", 255: "CC_Anterior",
}  # fmt: skip
#: Gyri by their number beyond 1000 (left) and 2000 (right).
_GYRI = (
    "unknown", "bankssts", "caudalanteriorcingulate", "caudalmiddlefrontal", "corpuscallosum", "cuneus",
    "entorhinal", "fusiform", "inferiorparietal", "inferiortemporal", "isthmuscingulate", "lateraloccipital",
    "lateralorbitofrontal", "lingual", "medialorbitofrontal", "middletemporal", "parahippocampal",
    "paracentral", "parsopercularis", "parsorbitalis", "parstriangularis", "pericalcarine", "postcentral",
    "posteriorcingulate", "precentral", "precuneus", "rostralanteriorcingulate", "rostralmiddlefrontal",
    "superiorfrontal", "superiorparietal", "superiortemporal", "supramarginal", "frontalpole",
    "temporalpole", "transversetemporal", "insula",
)  # fmt: skip


def freesurfer_names(path: Path, labels: Iterable[int]) -> dict[str, str]:
    """Names of labels (Desikan et al. 2006 for gyri), by number; none for a file that is not FreeSurfer's.

    Examples
    --------
    >>> freesurfer_names(Path("aparc+aseg.mgz"), [17, 53, 2035])
    {'17': 'Left-Hippocampus', '53': 'Right-Hippocampus', '2035': 'ctx-rh-insula'}
    >>> freesurfer_names(Path("liver.nii.gz"), [17])
    {}
    """
    name = path.name.lower()
    if not (name.endswith((".mgz", ".mgh")) or re.search(r"aseg|aparc|wmparc|synthseg", name)):
        return {}
    known = dict(_SINGLE)
    known |= {number: f"Left-{part}" for number, part in _PAIRED.items()}
    known |= {_RIGHT[number]: f"Right-{part}" for number, part in _PAIRED.items()}
    for start, side in ((1000, "lh"), (2000, "rh")):
        known |= {start + number: f"ctx-{side}-{gyrus}" for number, gyrus in enumerate(_GYRI)}
    return {str(label): known[label] for label in labels if label in known}
