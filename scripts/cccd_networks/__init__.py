"""What packages with trained networks share: their files, what these say of themselves, and the device."""
