"""How wide error bands are, and from which doubt on slices are listed: found where the truth is known."""
