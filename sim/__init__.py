"""What physics says: MuJoCo as a judge that shares nothing with the statics but the geometry."""
