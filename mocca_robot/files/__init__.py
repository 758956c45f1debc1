"""One format a file: configurations, drawings, assemblies, designs, meshes; read, checked, written."""
