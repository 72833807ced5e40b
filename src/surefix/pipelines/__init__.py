"""Options in, result out: what the command line and the library run."""
