"""Seeded truth with sensors and faults, one file per scenario."""
