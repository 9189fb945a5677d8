"""Cohorts: what is planned, run, compared and reported."""
