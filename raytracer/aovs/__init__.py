"""AOVs, arbitrary output variables: what a pixel sees besides its radiance.  One file a family of quantities."""
