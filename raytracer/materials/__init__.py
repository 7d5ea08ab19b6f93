"""Materials: how surfaces scatter and emit.  One file a kind."""
