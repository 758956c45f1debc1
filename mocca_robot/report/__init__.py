"""What a run found, for people: one self-contained page, a comparison page, and figures that stand alone."""
