"""What a workshop makes: cutting sheets, print beds, clearances, thin places, the bill of parts."""
