"""Label maps as other programs leave them: OME-Zarr, and probabilities of nnU-Net."""
