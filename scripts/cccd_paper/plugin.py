"""What the evidence adds to the core: see `cccd.plugins`."""

JUNCTION_NETWORKS = {"paper": "cccd_paper.junctions.network.PaperNetwork"}
JUNCTION_TRAINING = {"paper": "cccd_paper.junctions.training.PaperTask"}
SEGMENTATION_NETWORKS = {"paper": "cccd_paper.segmentation.NETWORKS"}
SETTINGS = {"comparisons": "cccd_paper.settings.SECTION"}
REPORT = {"paper": "cccd_paper.registry"}
