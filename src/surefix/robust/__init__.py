"""Robust losses: the weight of a residual, and gates."""
