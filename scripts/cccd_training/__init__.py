"""How weights are made: data drawn or read, losses, loops. `cccd` needs none of it."""
