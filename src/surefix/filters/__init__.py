"""Recursive estimators as pure steps, and the loops that run them over a series."""
