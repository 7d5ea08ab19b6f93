"""Image file formats, one module a format: what a picture is written to, and what pictures are read from.

| suffix | holds | settings |
|---|---|---|
| .png | 8 bits, sRGB, by the tone curve; 16 bits are read as well | text chunks |
| .jpg .jpeg | 8 bits, sRGB, by the tone curve, quality 95, colour not subsampled | - |
| .exr | float32 (uint32 for identifiers), linear; variance and layers | attributes, `rt.` before the name |
| .hdr | 8-bit mantissas with a common exponent, linear | header lines, named as in .exr |
| .npy | float64, linear | - |
| .lf | the views of a light field, float32, linear; layers and rays | attributes |
| .pfm | a number a pixel, float32: depths and disparities, no pictures | - |
| .gif .webp | animations; a .webp is also read as a texture | - |
| .tif .tiff | 8 or 16 bits, sRGB, or float32, linear: read, not written | - |
| .bmp .tga | 8 bits, sRGB: read as textures, not written | - |

A module that declares `FORMAT = ImageFormat(...)` is found by `registry`, and all lists of suffixes are made from these
declarations: a new format is a new file, and nothing else.
"""
