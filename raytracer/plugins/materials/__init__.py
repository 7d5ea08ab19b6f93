"""Materials: how surfaces scatter and emit light."""
