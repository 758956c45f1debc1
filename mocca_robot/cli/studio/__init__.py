"""The studio: a local page on which one changes an assembly and sees at once what becomes of it."""
