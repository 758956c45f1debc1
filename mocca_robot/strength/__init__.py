"""Will it break? Materials, contact pressures, stresses in every part, and what share of its strength is used."""
