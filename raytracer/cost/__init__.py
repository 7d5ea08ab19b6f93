"""What accuracy costs in time: measures a scene and its variants, predicts, and shows what was found."""
