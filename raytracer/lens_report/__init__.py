"""Looking at a lens by itself: what it does to light, told in numbers, curves and a drawing."""
