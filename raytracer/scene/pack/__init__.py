"""Pack a checked scene for the kernels: tables of objects, materials, media, textures and lights."""
