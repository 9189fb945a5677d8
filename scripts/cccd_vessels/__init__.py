"""Vessels, airways and ducts: their centrelines, their walls, and ends that are cut open for flow."""
