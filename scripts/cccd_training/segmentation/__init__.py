"""Training of the networks that find organs in scans."""
