"""Where and how work runs: processes, threads, compiled code, names for content."""
