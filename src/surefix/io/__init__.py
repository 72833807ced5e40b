"""Reading logs and writing tracks."""
