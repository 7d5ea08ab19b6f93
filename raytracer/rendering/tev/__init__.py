"""Pictures in the viewer tev while they are rendered, by its protocol."""
