"""Light fields: geometry and radiance of views, their layouts in pictures, and `.lf` files."""
