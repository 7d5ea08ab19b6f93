"""Small pictures kept as references, and whether scenes still look like them."""
