"""Light fields of other programs, imported and exported: folders of views, one picture of all views, and arrays.

| | names | geometry |
|---|---|---|
| `grid` | `view_03_05.png`: row and column, or one number by rows | `geometry.json`, if it is there |
| `stanford` | `out_03_05_Y_X_.png` | places by the names; `geometry.json` |
| `hci` | `input_Cam032.png` | `parameters.cfg`; `gt_depth_lowres.pfm`, `gt_disp_lowres.pfm`; `geometry.json` |
| .npy | (rows, columns, height, width, 3) | `NAME.geometry.json`, if it is there |

Options of the importer take precedence over what files say.
"""
