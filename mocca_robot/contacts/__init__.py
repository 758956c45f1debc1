"""Parts → contacts: what a contact is, where parts share one, and where they penetrate."""
