"""Organs that share their walls."""
