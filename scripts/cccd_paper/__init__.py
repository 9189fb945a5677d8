"""The evidence: what the paper does and shows, and how other methods compare. `cccd` needs none of it."""
