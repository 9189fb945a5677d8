"""How wide error bands have to be: measured on organs whose surface is known, and between readers."""
