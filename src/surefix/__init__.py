"""surefix."""
