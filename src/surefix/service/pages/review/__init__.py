"""The review page: its markup, style and scripts."""
