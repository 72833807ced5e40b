"""The live service: sources, session, journal, outputs."""
