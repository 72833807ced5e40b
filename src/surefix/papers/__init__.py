"""The five papers: each experiment run again, one file a paper."""
