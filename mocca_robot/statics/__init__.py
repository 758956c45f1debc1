"""Static equilibrium of rigid parts in frictionless or frictional contact (Eq. 2–10)."""
