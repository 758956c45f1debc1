"""What replaces a contact: surfaces that are height fields along a principal direction, one family a file."""
