"""Time, angles and the local frame."""
