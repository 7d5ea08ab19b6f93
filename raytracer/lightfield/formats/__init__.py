"""Light fields of other programs, imported and exported: one module a format, which declares it in `FORMATS`.

| | names | geometry |
|---|---|---|
| `grid` | `view_03_05.png`: row and column, or one number by rows | `geometry.json`, if it is there |
| `stanford` | `out_03_05_Y_X_.png` | places by the names; `geometry.json` |
| `hci` | `input_Cam032.png` | `parameters.cfg`; `gt_depth_lowres.pfm`, `gt_disp_lowres.pfm`; `geometry.json` |
| `array` | .npy of (rows, columns, height, width, 3) | `NAME.geometry.json`, if it is there |
| `mosaic`, `interleaved` | one picture | `NAME.geometry.json`, if it is there |
| `quilt` | `NAME_qs8x6a0.75.png` | `NAME.geometry.json`, if it is there |
| `multiview` | .exr with a part for each view, or views as layers | an attribute, if it is there |
| `transforms` | `transforms.json` and pictures | a camera for each picture |

Options of the importer take precedence over what files say.
"""
