"""Ordered curves described by few points: chain codes, corners, closed B-splines, and what they are worth.

It loads nothing by itself: fitting (`fitting`, `describe`) needs a compiler, measuring (`measures`) none.
"""
