"""What physics did, to look at: films, viewers, models for other programs."""
