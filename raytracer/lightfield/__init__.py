"""What is made of light fields: photographs focused afterwards, views, depth, pages to look around in.

Each function takes a `LightField` (`open` reads one) and gives arrays, `Image`s or bytes; the command line and users
of Python call the same.
"""
