"""Tracks and estimates of several sensors made one."""
