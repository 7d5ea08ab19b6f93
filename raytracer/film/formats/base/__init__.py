"""Tools that the image formats share: their record, limits on what is read, and Pillow."""
