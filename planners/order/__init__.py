"""In which order the parts can be placed, and who has to be held meanwhile."""
